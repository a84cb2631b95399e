"""The next task's scene, built while the drone flies the one before it."""

import asyncio
import contextlib
from collections.abc import Sequence
from typing import NamedTuple

from contracts.sim import Claim, Episode, EpisodeQuestion, Verdict
from contracts.vehicle import Move, MoveResult, Observation
from mission.ports import PortError, World


class Prefetched(NamedTuple):
    """An episode that is being opened before its turn."""

    question: EpisodeQuestion
    opening: asyncio.Task[Episode]


class PrefetchingWorld:
    """The world, with the time that its renderer took added up. Once the drone is placed, it opens the upcoming episode
    as well: building a scene takes as long as several looks, and the simulator would idle meanwhile."""

    def __init__(self, world: World, ready: Prefetched | None, upcoming: EpisodeQuestion | None) -> None:
        self._world = world
        self._ready = ready
        self._upcoming = upcoming
        self.prefetched: Prefetched | None = None
        self.render_s = 0.0

    async def start(self, question: EpisodeQuestion) -> Episode:
        episode: Episode | None = None
        if self._ready is not None and self._ready.question == question:
            with contextlib.suppress(PortError):  # then it is tried again in its turn
                episode = await self._ready.opening
        if episode is None:
            episode = await self._world.start(question)
        if self._upcoming is not None:
            self.prefetched = Prefetched(self._upcoming, asyncio.create_task(self._world.start(self._upcoming)))
        return episode

    async def observe(self, episode: str, cameras: Sequence[str]) -> Observation:
        seen = await self._world.observe(episode, cameras)
        self.render_s += seen.timings_s.get("render", 0.0)
        return seen

    async def move(self, episode: str, number: int, move: Move) -> MoveResult:
        return await self._world.move(episode, number, move)

    async def claim(self, episode: str, claim: Claim) -> Verdict:
        return await self._world.claim(episode, claim)

    async def end(self, episode: str) -> None:
        await self._world.end(episode)
