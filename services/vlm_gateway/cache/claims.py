"""Identical chats in several workers make one call: who claims it first makes it, the others wait for the answer.

Claims lie in memory that the workers share. One is let go once the answer is written, or when there is none to keep:
then the next in line asks. What a worker had claimed that is dead, or hangs, is free again.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import TypeVar

from service_kit.workers import Worker
from services.vlm_gateway.cache.guard import GuardedCache

T = TypeVar("T")
LOOK_EVERY_S = 0.02
WRITTEN_WITHIN_S = 0.5


class Claims:
    """Of one worker, about what is kept in `answers`."""

    def __init__(self, worker: Worker, answers: GuardedCache) -> None:
        self._table = worker.board.claims
        self._me = worker.number
        self._answers = answers
        self._making = 0
        self._over: set[str] = set()
        self._task: asyncio.Task[None] | None = None

    async def once(self, key: str, make: Callable[[], Awaitable[T]], read: Callable[[bytes], T | None]) -> T:
        """What `make` brings, or what another worker has got meanwhile and `read` understands. `key` is hexadecimal;
        one call at a time for each."""
        self._table.alive(self._me)
        while self._answers.state == "ok" and not self._table.claim(_name(key), self._me):
            await asyncio.sleep(LOOK_EVERY_S)
            if (value := await self._answers.get(key)) is not None and (found := read(value)) is not None:
                return found
        self._over.discard(key)  # what this worker has not let go yet is its own still
        self._making += 1
        if self._task is None:
            self._table.alive(self._me)
            self._task = asyncio.create_task(self._look_after())
        try:
            return await make()
        finally:
            self._making -= 1
            self._over.add(key)

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _look_after(self) -> None:
        """Say that this worker is at it, and let go of what is over, many at a time; until there is nothing."""
        try:
            while self._making or self._over:
                await asyncio.sleep(LOOK_EVERY_S)
                self._table.alive(self._me)
                if not self._over:
                    continue
                over = set(self._over)
                with contextlib.suppress(TimeoutError):  # whoever waits looks for the answer first
                    await asyncio.wait_for(self._answers.settled(), WRITTEN_WITHIN_S)
                for key in over & self._over:
                    self._table.release(_name(key), self._me)
                self._over -= over
        finally:
            self._task = None


def _name(key: str) -> int:
    return int(key[:16], 16) or 1
