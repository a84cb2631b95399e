"""What runs as long as the service does: the stream of set-points, the watch over the modes, the leases of trials."""

import asyncio
import logging
from collections.abc import Coroutine, Mapping
from functools import partial
from typing import Any

log = logging.getLogger("mavlink_vehicle.loops")


class Loops:
    """`problem` says which one has ended though it should not have."""

    def __init__(self) -> None:
        self._tasks: dict[str, asyncio.Task[None]] = {}

    def start(self, runs: Mapping[str, Coroutine[Any, Any, None]]) -> None:
        """By the names that people are told."""
        for name, run in runs.items():
            self._tasks[name] = asyncio.create_task(run)
            self._tasks[name].add_done_callback(partial(_ended, name))

    async def close(self) -> None:
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)

    async def problem(self) -> str | None:
        ended = [name for name, task in self._tasks.items() if task.done()]
        return f"{', '.join(ended)} has ended: start the service again, its log says why" if ended else None


def _ended(name: str, task: asyncio.Task[None]) -> None:
    if not task.cancelled():
        log.error("%s has ended", name, exc_info=task.exception())
