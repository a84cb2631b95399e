"""All live episodes: who may fly, who waits for whom, and when an idle one is given up.

Calls on one episode run one after the other. Different episodes meet only where they share something real: the
renderer's thread, the worker threads, and the building of a new scene.
"""

import asyncio
import os
import secrets
import time
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import DEFAULT_RIG, shipped_rig
from contracts.cameras import Camera as RigCamera
from contracts.geometry import Heading, Pose
from contracts.images import encode_depth_units, encode_jpeg
from contracts.sim import (
    Camera,
    Claim,
    Episode,
    EpisodeQuestion,
    Move,
    MoveResult,
    Observation,
    SensedView,
    Truth,
    TruthQuestion,
    Verdict,
)
from service_kit.errors import NotFound, TooMany
from services.sim.episode import LiveEpisode
from services.sim.render.thread import RenderThread
from services.sim.scenes import SceneBuilder
from services.sim.shelf import SceneShelf, Shelved, draw
from services.sim.truth import truth_view

T = TypeVar("T")


class Limits(NamedTuple):
    """max_episodes: live at once; idle_s: seconds without a call until one is given up; kept_scenes: built scenes
    that stay though nobody flies in them."""

    max_episodes: int = 16
    idle_s: float = 900.0
    kept_scenes: int = 4


class _Labels(NamedTuple):
    """The ids that were drawn beside the last pictures: until the drone moves they are the truth's pictures too."""

    pose: Pose
    size: int
    views: dict[Heading, NDArray[np.uint16]]


class _Seat:
    def __init__(self, episode: LiveEpisode, shelved: Shelved) -> None:
        self.episode = episode
        self.shelved = shelved
        self.turn = asyncio.Lock()
        self.labels: _Labels | None = None


class Episodes:
    """Lives on one event loop. Owns its worker threads, not the renderer's."""

    def __init__(
        self,
        build: SceneBuilder,
        renderer: RenderThread,
        limits: Limits,
        clock: Callable[[], float] = time.monotonic,
        truth: bool = False,
    ) -> None:
        """truth: whether `truth` will be asked; then every look keeps what each pixel shows."""
        self.limits = limits
        self._labelled = truth
        self._renderer = renderer
        self._clock = clock
        self._workers = ThreadPoolExecutor(max(4, os.cpu_count() or 1), thread_name_prefix="sim")
        self._shelf = SceneShelf(build, renderer, self._workers, limits.kept_scenes)
        self._seats: dict[str, _Seat] = {}
        self._touched: dict[str, float] = {}
        self._starting = 0

    @property
    def live(self) -> int:
        return len(self._seats)

    @property
    def scenes(self) -> int:
        """Built scenes in memory."""
        return len(self._shelf)

    async def start(self, question: EpisodeQuestion) -> Episode:
        """Raises TooMany, BadQuestion or Unavailable."""
        await self.expire()
        if len(self._seats) + self._starting >= self.limits.max_episodes:
            raise TooMany(
                f"{self.limits.max_episodes} episodes are live, which is all that this simulator keeps; end one with "
                f"DELETE /v1/episodes/<id>, or wait: after {self.limits.idle_s:g} s without a call one expires",
                code="too_many_episodes",
                details={"max_episodes": self.limits.max_episodes},
            )
        self._starting += 1
        try:
            shelved = await self._shelf.borrow(question.scene)
            try:
                episode = await self._work(
                    LiveEpisode,
                    secrets.token_hex(16),
                    shelved.ready,
                    question.flight,
                    self._renderer.name,
                    self._renderer.detail,
                )
            except BaseException:
                await self._shelf.give_back(shelved)
                raise
        finally:
            self._starting -= 1
        self._seats[episode.id] = _Seat(episode, shelved)
        self._touched[episode.id] = self._clock()
        return episode.state(self.limits.idle_s)

    def state(self, episode_id: str) -> Episode:
        """As it stands between calls; asking doesn't keep an episode alive. Raises NotFound."""
        seat = self._seat(episode_id)
        return seat.episode.state(self.limits.idle_s - (self._clock() - self._touched[episode_id]))

    async def look(self, episode_id: str, headings: Sequence[Heading], size: int, depth: bool) -> Observation:
        """All views of one moment. Raises NotFound or Unavailable."""
        async with self._turn(episode_id) as seat:
            pose, uploaded = seat.episode.pose, seat.shelved.uploaded
            started = time.perf_counter()
            labelled = self._labelled
            drawn = await draw(
                self._renderer,
                lambda renderer: renderer.render(uploaded, pose, _cameras(headings, size), labelled=labelled),
            )
            if drawn.ids is not None:
                seat.labels = _Labels(pose, size, dict(zip(headings, drawn.ids, strict=True)))
            rendered = time.perf_counter()
            # each picture and each depth map is work of its own; the encoders let other threads run meanwhile
            images = [self._work(encode_jpeg, rgb) for rgb in drawn.rgb]
            depths = [self._work(encode_depth_units, units) for units in drawn.depth_units] if depth else []
            jpegs = await asyncio.gather(*images)
            maps = await asyncio.gather(*depths) if depth else [None] * len(jpegs)
            seat.episode.observations += 1
            return Observation(
                episode=episode_id,
                number=seat.episode.observations,
                pose=seat.episode.odometry.believed(pose),
                camera=Camera(width=size, height=size, focal_px=size / 2),
                views=tuple(
                    SensedView(heading_deg=h, image=image, depth=depth_map)
                    for h, image, depth_map in zip(headings, jpegs, maps, strict=True)
                ),
                renderer=self._renderer.name,
                render_s=rendered - started,
                encode_s=time.perf_counter() - rendered,
            )

    async def move(self, episode_id: str, number: int, move: Move) -> MoveResult:
        """Raises NotFound or Conflict."""
        async with self._turn(episode_id) as seat:
            return await self._work(seat.episode.move, number, move, self.limits.idle_s)

    async def claim(self, episode_id: str, claim: Claim) -> Verdict:
        """Raises NotFound."""
        async with self._turn(episode_id) as seat:
            return await self._work(seat.episode.claim, claim, self.limits.idle_s)

    async def truth(self, episode_id: str, question: TruthQuestion) -> Truth:
        """Raises NotFound or Unavailable."""
        async with self._turn(episode_id) as seat:
            pose, uploaded, ready = seat.episode.pose, seat.shelved.uploaded, seat.shelved.ready
            moves = seat.episode.moves
            known = seat.labels
            if known is None or (known.pose, known.size) != (pose, question.size):
                known = _Labels(pose, question.size, {})
            missing = tuple(h for h in dict.fromkeys(question.views) if h not in known.views)
            if missing:
                ids = await draw(
                    self._renderer,
                    lambda renderer: renderer.render_ids(uploaded, pose, _cameras(missing, question.size)),
                )
                known.views.update(zip(missing, ids, strict=True))
                seat.labels = known

            def found() -> Truth:
                cameras = _cameras(question.views, question.size)
                views = tuple(
                    truth_view(ready.scene, ready.mesh, ready.things, pose, camera, known.views[heading])
                    for camera, heading in zip(cameras, question.views, strict=True)
                )
                candidates = [seat.episode.odometry.true(place) for place in question.candidates]
                remaining_m = ready.way_home.remaining_m(candidates)
                return Truth(scene=ready.scene.name, moves=moves, pose=pose, views=views, remaining_m=remaining_m)

            return await self._work(found)

    async def end(self, episode_id: str) -> None:
        """Frees everything of it, after the call that may be running on it. Raises NotFound."""
        seat = self._seat(episode_id)
        async with seat.turn:
            await self._drop(episode_id)

    async def expire(self) -> int:
        """Gives up every episode that was idle too long; says how many."""
        late = self._clock() - self.limits.idle_s
        idle = [i for i, seat in self._seats.items() if self._touched[i] <= late and not seat.turn.locked()]
        for episode_id in idle:
            await self._drop(episode_id)
        return len(idle)

    async def close(self) -> None:
        """Ends all episodes and the worker threads."""
        for episode_id in list(self._seats):
            await self._drop(episode_id)
        self._workers.shutdown(wait=True)

    def _seat(self, episode_id: str) -> _Seat:
        seat = self._seats.get(episode_id)
        expired = seat is not None and self._clock() - self._touched[episode_id] >= self.limits.idle_s
        if seat is None or (expired and not seat.turn.locked()):
            raise NotFound(
                f"there is no episode {episode_id[:40]!r}; it was never started, was ended, or expired after "
                f"{self.limits.idle_s:g} s without a call; POST /v1/episodes starts one",
                code="no_such_episode",
            )
        return seat

    @asynccontextmanager
    async def _turn(self, episode_id: str) -> AsyncIterator[_Seat]:
        seat = self._seat(episode_id)
        async with seat.turn:
            self._seat(episode_id)  # it may have been ended while this call waited
            try:
                yield seat
            finally:
                if episode_id in self._touched:
                    self._touched[episode_id] = self._clock()

    async def _drop(self, episode_id: str) -> None:
        seat = self._seats.pop(episode_id, None)
        if seat is None:
            return
        self._touched.pop(episode_id, None)
        await self._work(seat.episode.close)
        await self._shelf.give_back(seat.shelved)

    async def _work(self, job: Callable[..., T], *arguments: object) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, job, *arguments)


def _cameras(headings: Sequence[Heading], size: int) -> list[RigCamera]:
    by_heading = {camera.heading_deg: camera for camera in shipped_rig(DEFAULT_RIG).scaled_to(size).cameras}
    return [by_heading[heading] for heading in headings]
