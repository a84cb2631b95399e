"""Bounded concurrency with a bounded queue in front of one model."""

import asyncio
import contextlib
from collections import deque
from types import TracebackType
from typing import Self

from services.vlm_gateway.errors import ModelOverloaded


class Admission:
    """`async with admission:` holds one of `concurrency` places; at most `queue` callers wait, first come first served.

    Raises ModelOverloaded at once where the queue is full.
    """

    def __init__(self, model: str, concurrency: int, queue: int) -> None:
        self._model = model
        self._concurrency = concurrency
        self._queue = queue
        self._running = 0
        self._waiting: deque[asyncio.Future[None]] = deque()

    @property
    def running(self) -> int:
        return self._running

    @property
    def waiting(self) -> int:
        return len(self._waiting)

    async def __aenter__(self) -> Self:
        await self.enter()
        return self

    async def enter(self, deadline: float | None = None) -> None:
        """Take a place; `leave` gives it back. Raises TimeoutError where none was free until `deadline` (of the event
        loop's clock)."""
        if self._running < self._concurrency and not self._waiting:
            self._running += 1
        elif deadline is None:
            await self._queue_up()
        else:
            async with asyncio.timeout_at(deadline):
                await self._queue_up()

    async def _queue_up(self) -> None:
        if len(self._waiting) >= self._queue:
            raise ModelOverloaded(
                f"model {self._model!r} answers {self._running} questions and {len(self._waiting)} more wait; "
                "ask again later, or raise its concurrency or queue",
                details={"model": self._model, "running": self._running, "waiting": len(self._waiting)},
            )
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append(turn)
        try:
            await turn
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled():
                self.leave()  # the place was already handed over: pass it on
            else:
                with contextlib.suppress(ValueError):  # whoever left meanwhile has already passed it over
                    self._waiting.remove(turn)
            raise

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.leave()

    def leave(self) -> None:
        """Hand the place to whoever waits longest."""
        while self._waiting:
            turn = self._waiting.popleft()
            if not turn.done():
                turn.set_result(None)  # the place changes hands without ever being free
                return
        self._running -= 1
