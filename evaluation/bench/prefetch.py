"""The next task's trial, begun while the current one is flown: building a scene takes as long as several looks, and the
simulator would idle meanwhile."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from mission.placement import InTrial
from mission.vehicle import Vehicle


@dataclass(frozen=True)
class Prefetched(InTrial):
    """A trial that may have been begun before its turn (`opening`); once its drone is placed, `begin_next` begins the
    next one."""

    opening: asyncio.Task[Vehicle] | None
    begin_next: Callable[[], None]

    async def begin(self, key: str) -> Vehicle:
        if self.opening is not None:
            await asyncio.wait({self.opening})  # whatever came of it: the same key is the same trial
        vehicle = await super().begin(key)
        self.begin_next()
        return vehicle
