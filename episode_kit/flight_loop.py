"""Advances the flight that is under way in one episode, in slices of its own time.

Between two slices every other call has its turn: it finds the drone on its way, and can stop it there. At pace 0 the
slices follow each other as fast as the event loop comes round, at pace 1 as fast as a real drone would fly them.
"""

import asyncio
import time
from contextlib import suppress

from episode_kit.episode import FlyingEpisode

SLICE_S = 0.25
"""Seconds of flight."""


class FlightLoop:
    """Lives on the event loop of its episode's calls."""

    def __init__(self, episode: FlyingEpisode) -> None:
        self._episode = episode
        self._task: asyncio.Task[None] | None = None
        self._stopped = asyncio.Event()

    @property
    def running(self) -> bool:
        return self._task is not None and not self._task.done()

    def start(self) -> None:
        """Follows the flight that was begun; one that is followed already goes on."""
        if not self.running:
            self._stopped.clear()
            self._task = asyncio.create_task(self._follow())

    async def over(self) -> None:
        """Waits until nothing is under way. Whoever stops waiting does not stop the flight."""
        if self._task is not None:
            await asyncio.shield(self._task)

    async def stop(self) -> None:
        """The drone brakes and holds; nothing is followed any more."""
        self._episode.stop()
        self._stopped.set()
        await self.over()

    async def _follow(self) -> None:
        episode, pace = self._episode, self._episode.flight.pace
        begun, flown_s = time.monotonic(), 0.0
        while not episode.advance(flown_s):
            if pace:
                await self._pause(pace * min(SLICE_S, episode.drone.left_s))
                flown_s = (time.monotonic() - begun) / pace
            else:
                await asyncio.sleep(0)
                flown_s += SLICE_S

    async def _pause(self, seconds: float) -> None:
        with suppress(TimeoutError):
            await asyncio.wait_for(self._stopped.wait(), seconds)
