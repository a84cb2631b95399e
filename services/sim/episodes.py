"""The simulator's live episodes. They meet only where they share something real: the renderer's thread, the worker
threads, and the building of a new scene."""

import secrets
import time

from contracts.sim import EpisodeQuestion, PoseJudged, PoseReport, Truth, TruthQuestion
from episode_kit.episodes import LiveEpisodes, Opened
from episode_kit.lease import Clock
from episode_kit.limits import Limits
from services.sim.episode import LiveEpisode
from services.sim.render.thread import RenderThread
from services.sim.scene_cache import SceneCache
from services.sim.scenes import SceneBuilder
from services.sim.senses import Senses, check


class Episodes(LiveEpisodes[EpisodeQuestion, LiveEpisode, Senses]):
    """Owns its worker threads, not the renderer's."""

    def __init__(
        self,
        build: SceneBuilder,
        renderer: RenderThread,
        limits: Limits,
        clock: Clock = time.monotonic,
        truth: bool = False,
    ) -> None:
        """truth: whether `truth` will be asked; then every look keeps what each pixel shows."""
        super().__init__(limits, clock)
        self._labelled = truth
        self._renderer = renderer
        self._cache = SceneCache(build, renderer, self._workers, limits.kept_scenes)

    @property
    def scenes(self) -> int:
        """Built scenes in memory."""
        return len(self._cache)

    async def put(self, episode_id: str, report: PoseReport) -> PoseJudged:
        """Raises NotFound, and Conflict on its way and after the claim."""
        async with self._turn(episode_id) as live:
            return await self._work(live.episode.put, report)

    async def truth(self, episode_id: str, question: TruthQuestion) -> Truth:
        """Raises NotFound or Unavailable."""
        async with self._turn(episode_id) as live:
            return await live.senses.truth(question)

    async def _open(self, question: EpisodeQuestion) -> Opened[LiveEpisode, Senses]:
        check(question.rig.cameras)
        cached, renderer = await self._cache.acquire(question.scene), self._renderer
        try:
            episode = await self._work(
                LiveEpisode, secrets.token_hex(16), cached.ready, question, renderer.name, renderer.detail
            )
        except BaseException:
            await self._cache.release(cached)
            raise
        senses = Senses(episode, cached, renderer, self._workers, labelled=self._labelled)

        async def close() -> None:
            await self._work(episode.close)
            await self._cache.release(cached)

        return Opened(episode, senses, close)
