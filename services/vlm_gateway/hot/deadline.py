"""Ends the work for a request whose caller has left, or is not going to wait any longer, as `x-timeout-s` says."""

import asyncio
from collections.abc import Callable

from service_kit.errors import BadQuestion, ServiceError
from service_kit.running_loop import running_loop
from services.vlm_gateway.errors import ModelTimeout


class Deadline:
    """Over the task that serves the request. Where it ends the work, that task is cancelled and `why` says why."""

    def __init__(self, task: asyncio.Task[None]) -> None:
        self._task = task
        self._timer: asyncio.TimerHandle | None = None
        self.why: ServiceError | None = None

    def limit(self, after_s: float, why: Callable[[], ServiceError]) -> None:
        """End the work after so long; this replaces an earlier limit."""
        self.unlimited()
        self._timer = running_loop().call_later(after_s, lambda: self.end(why()))

    def unlimited(self) -> None:
        """Take the limit away."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def end(self, why: ServiceError) -> None:
        """End the work now."""
        self.why = self.why or why
        self._task.cancel()


def stated_timeout_s(said: str | bytes | None) -> float | None:
    """What `x-timeout-s` says; None where it says nothing. Raises BadQuestion."""
    if said is None:
        return None
    try:
        limit_s = float(said)
    except ValueError:
        limit_s = 0.0
    if not 0.001 <= limit_s <= 3600.0:
        shown = said if isinstance(said, str) else said.decode("latin-1")
        raise BadQuestion(f"x-timeout-s: {shown[:20]!r} is no number of seconds from 0.001 to 3600")
    return limit_s


def caller_left() -> ServiceError:
    """Nobody reads this, but it is counted."""
    return ServiceError("the caller has left", code="caller_left", status=499)


def too_late(limit_s: float) -> ModelTimeout:
    """The caller's own deadline passed."""
    return ModelTimeout(f"no answer within the caller's {limit_s:g} s")
