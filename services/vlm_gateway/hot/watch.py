"""Ends the work for a request whose caller has left, or is not going to wait any longer."""

import asyncio
from collections.abc import Callable

from starlette.types import Receive

from service_kit.errors import ServiceError
from services.vlm_gateway.errors import ModelTimeout

PATIENCE_S = 0.05
"""Callers are watched from here on: most answers are there before, and watching costs a task."""


class Watch:
    """Made in the task that serves the request. Where it ends the work, that task is cancelled and `why` says why."""

    def __init__(self, receive: Receive) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._task = task
        self._receive = receive
        self._loop = asyncio.get_running_loop()
        self._due: float | None = None
        self._reason: Callable[[], ServiceError] = slow_body
        self._body_read = False
        self._watcher: asyncio.Task[None] | None = None
        self.why: ServiceError | None = None
        # one timer for all that is watched: most requests are over before it rings, and timers are dear
        self._timer = self._loop.call_later(PATIENCE_S, self._look)

    def limit(self, after_s: float, why: Callable[[], ServiceError]) -> None:
        """End the work after so long; this replaces an earlier limit."""
        self._due, self._reason = self._loop.time() + after_s, why
        if not self._loop.time() <= self._timer.when() <= self._due:
            self._ring(self._due)

    def unlimited(self) -> None:
        """Take the limit away."""
        self._due = None

    def caller(self) -> None:
        """From now on (or rather, a moment later) end the work when the caller leaves. The request's body must have
        been read."""
        self._body_read = True
        now = self._loop.time()
        if not now <= self._timer.when() <= now + PATIENCE_S:
            self._ring(now + PATIENCE_S)

    def close(self) -> None:
        self._timer.cancel()
        if self._watcher is not None:
            self._watcher.cancel()

    def _ring(self, at: float) -> None:
        self._timer.cancel()
        self._timer = self._loop.call_at(at, self._look)

    def _look(self) -> None:
        now = self._loop.time()
        if self._due is not None and now >= self._due:
            self._end(self._reason)
            return
        if self._body_read and self._watcher is None:
            self._watcher = self._loop.create_task(self._gone())
        if self._due is not None:
            self._ring(self._due)
        elif not self._body_read:
            self._ring(now + PATIENCE_S)

    async def _gone(self) -> None:
        while (await self._receive())["type"] != "http.disconnect":
            pass
        self._end(caller_left)

    def _end(self, why: Callable[[], ServiceError]) -> None:
        self.why = self.why or why()
        self._task.cancel()


def caller_left() -> ServiceError:
    """Nobody reads this, but it is counted."""
    return ServiceError("the caller has left", code="caller_left", status=499)


def slow_body() -> ServiceError:
    """The request's body did not come in time."""
    return ServiceError("the body did not come in time", code="slow_body", status=408)


def too_late(limit_s: float) -> ModelTimeout:
    """The caller's own deadline passed."""
    return ModelTimeout(f"no answer within the caller's {limit_s:g} s")
