"""How a flight ends: how near is near enough, how long it is waited for, and what ends it early."""

import math
from typing import NamedTuple

STUCK_AFTER_S, NEARER_M = 6.0, 0.15


class Tolerance(NamedTuple):
    """How near to a corner and to the end of its way it must come, and beyond what it has not arrived at all."""

    corner_m: float = 0.5
    end_m: float = 0.3
    end_rad: float = math.radians(5.0)
    lost_m: float = 1.5


class Patience:
    """Whether something comes no nearer any more: not by `NEARER_M` in `STUCK_AFTER_S`."""

    def __init__(self) -> None:
        self._best_m = math.inf
        self._since_s = math.inf
        self.ended = False

    def over(self, off_m: float, now_s: float) -> bool:
        """So far off at that moment of the clock."""
        if off_m < self._best_m - NEARER_M or math.isinf(self._since_s):
            self._best_m, self._since_s = off_m, now_s
        self.ended = now_s - self._since_s > STUCK_AFTER_S
        return self.ended


class Interrupted(Exception):
    """A flight ended early; the message says why."""


class Stopped(Interrupted):
    """Somebody told it to hold."""


class TakenOver(Interrupted):
    """Somebody else flies it."""


class Hit(Interrupted):
    """The world outside says that it hit something."""


class StuckOnTheWay(Interrupted):
    """It does not come to where it is sent."""


class Leapt(Interrupted):
    """Its estimate of where it is has leapt: what was seen beside it stands elsewhere now."""
