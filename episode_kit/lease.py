"""For how long an episode is held, and for whom."""

from collections.abc import Callable

Clock = Callable[[], float]
"""Seconds, from any beginning on."""


class Lease:
    """Of one episode: renewed by its calls, run out `lease_s` seconds after the last one."""

    def __init__(self, owner: str | None, lease_s: float, clock: Clock) -> None:
        self.owner = owner
        self.lease_s = lease_s
        self._clock = clock
        self._renewed = clock()

    def renew(self) -> None:
        self._renewed = self._clock()

    @property
    def left_s(self) -> float:
        return max(0.0, self.lease_s - (self._clock() - self._renewed))

    @property
    def over(self) -> bool:
        return self.left_s == 0.0
