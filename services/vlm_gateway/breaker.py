"""A circuit breaker: after failures in a row, stop asking for a while; then let one call try."""

import time
from collections.abc import Callable
from typing import Literal

State = Literal["closed", "open", "half_open"]


class Breaker:
    """Opens after `failures` in a row and stays open for `pause_s`; then one caller at a time may probe."""

    def __init__(self, failures: int, pause_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._failures = failures
        self._pause_s = pause_s
        self._clock = clock
        self._in_a_row = 0
        self._opened_at: float | None = None
        self._probe_since: float | None = None

    @property
    def state(self) -> State:
        if self._opened_at is None:
            return "closed"
        return "open" if self._clock() - self._opened_at < self._pause_s else "half_open"

    @property
    def wait_s(self) -> float:
        """How long until a probe may be sent; 0 when it may now."""
        if self._opened_at is None:
            return 0.0
        return max(0.0, self._pause_s - (self._clock() - self._opened_at))

    def allow(self) -> bool:
        """Whether to make a call now. Half open, the first to ask gets through and the others don't until it is told
        how that went (or, where it never is, after another pause)."""
        if self._opened_at is None:
            return True
        if self.state == "open":
            return False
        now = self._clock()
        if self._probe_since is not None and now - self._probe_since < self._pause_s:
            return False
        self._probe_since = now
        return True

    def success(self) -> None:
        self._in_a_row = 0
        self._opened_at = None
        self._probe_since = None

    def alive(self) -> None:
        """A call under way has brought something: no reason to keep others waiting until it ends. One more failure
        opens the breaker again."""
        if self._opened_at is not None:
            self._in_a_row = self._failures - 1
            self._opened_at = None
            self._probe_since = None

    def undecided(self) -> None:
        """A call ended without telling anything; another may probe at once."""
        self._probe_since = None

    def failure(self) -> None:
        self._in_a_row += 1
        self._probe_since = None
        if self._opened_at is not None or self._in_a_row >= self._failures:
            self._opened_at = self._clock()

    def trip(self) -> None:
        """Open now, however few failures there were."""
        self._in_a_row = self._failures
        self._opened_at = self._clock()
        self._probe_since = None
