"""Whether a model's server is asked: a breaker for everybody, and one for each caller.

A server that can't be reached fails whoever asks. A request that makes it answer 500, crash or stall may be one
caller's doing (a picture that its image library chokes on), so such failures stop that caller alone, until several
callers have met them.
"""

from collections import Counter, OrderedDict
from typing import Literal

from services.vlm_gateway.breaker import Breaker, State

FAILURES = 5
PAUSE_S = 2.0
MOST_OF_ONE_CALLER = FAILURES // 2 + 1
"""So many of the failures that stop everybody may be one caller's; the others must be of others."""
MAX_CALLERS = 256

Fault = Literal["server", "request"]
"""What a failure may be put down to: the server alone, or the request as well."""


class ServerHealth:
    """A caller without a name (no keys are configured) is everybody."""

    def __init__(self, failures: int = FAILURES, pause_s: float = PAUSE_S) -> None:
        self._failures = failures
        self._pause_s = pause_s
        self._everybody = Breaker(failures, pause_s)
        self._callers: OrderedDict[str, Breaker] = OrderedDict()
        self._since_success: Counter[str] = Counter()

    @property
    def state(self) -> State:
        """Of everybody's breaker."""
        return self._everybody.state

    @property
    def stopped_callers(self) -> list[str]:
        """Whose own requests are not passed on at the moment."""
        return sorted(name for name, breaker in self._callers.items() if breaker.state != "closed")

    def wait_s(self, caller: str) -> float:
        """How long until this caller may try; 0 when it may now."""
        own = self._callers.get(caller)
        return max(self._everybody.wait_s, own.wait_s if own else 0.0)

    def allow(self, caller: str) -> bool:
        """Whether to make a call for this caller now."""
        own = self._callers.get(caller) if self._callers else None
        return (own is None or own.allow()) and self._everybody.allow()

    def success(self, caller: str) -> None:
        self._everybody.success()
        if self._callers:
            self._callers.pop(caller, None)
        if self._since_success:
            self._since_success.clear()

    def alive(self, caller: str) -> None:
        """A call under way has brought content."""
        self._everybody.alive()
        if (own := self._callers.get(caller)) is not None:
            own.alive()

    def undecided(self, caller: str) -> None:
        """A call was given up by its caller, or ended in a way that says nothing about the server."""
        self._everybody.undecided()
        if (own := self._callers.get(caller)) is not None:
            own.undecided()

    def failure(self, caller: str, fault: Fault) -> None:
        if fault == "server" or not caller:
            self._everybody.failure()
            return
        if self._everybody.state != "closed":  # this was the probe; a caller whose requests fail anyway proves nothing
            if caller in self._callers:
                self._everybody.undecided()
            else:
                self._everybody.failure()
        own = self._callers.setdefault(caller, Breaker(self._failures, self._pause_s))
        self._callers.move_to_end(caller)
        if len(self._callers) > MAX_CALLERS:
            self._callers.popitem(last=False)
        own.failure()
        self._since_success[caller] += 1
        if sum(min(count, MOST_OF_ONE_CALLER) for count in self._since_success.values()) >= self._failures:
            self._everybody.trip()
            self._since_success.clear()


class Call:
    """One call under way, that was allowed; what became of it is told once, and is undecided where it is not told."""

    __slots__ = ("_caller", "_health", "_told")

    def __init__(self, health: ServerHealth, caller: str) -> None:
        self._health = health
        self._caller = caller
        self._told = False

    def brought_content(self) -> None:
        if not self._told:
            self._health.alive(self._caller)

    def succeeded(self) -> None:
        if not self._told:
            self._told = True
            self._health.success(self._caller)

    def failed(self, fault: Fault) -> None:
        if not self._told:
            self._told = True
            self._health.failure(self._caller, fault)

    def close(self) -> None:
        """Whatever was not told by now is not known."""
        if not self._told:
            self._told = True
            self._health.undecided(self._caller)
