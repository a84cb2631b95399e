"""Every question to a model goes through here, so that its four possible ends are told apart and counted.

Answered, Unreadable and Refused are what `ask` returns; the fourth, ModelUnreachable, is raised: there is no answer.
"""

import time
from collections.abc import Awaitable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from contracts.llm_parser import ParseAnswer
from contracts.orchestrator import MAX_LATENCIES, ModelCalls
from contracts.vlm_gateway import Answer, Role
from mission.ports import ModelUnreachable

A = TypeVar("A", bound=Answer | ParseAnswer)


@dataclass(frozen=True)
class Answered(Generic[A]):
    """The model answered the question."""

    answer: A
    seconds: float


@dataclass(frozen=True)
class Unreadable(Generic[A]):
    """The model said something that could not be read as an answer."""

    answer: A
    seconds: float


@dataclass(frozen=True)
class Refused(Generic[A]):
    """The model declined to answer."""

    answer: A
    seconds: float


Reply = Answered[A] | Unreadable[A] | Refused[A]


@dataclass
class CallBook:
    """Counts of model calls by role, and wall time by part."""

    calls: dict[str, ModelCalls] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    async def ask(self, role: Role, call: Awaitable[A]) -> Reply[A]:
        """Asks and counts. Raises PortError; ModelUnreachable is counted too."""
        started = time.perf_counter()
        try:
            answer = await call
        except ModelUnreachable:
            self._count(role, time.perf_counter() - started, cached=False, unreachable=1)
            raise
        seconds = time.perf_counter() - started
        tokens = answer.tokens if isinstance(answer, Answer) else None
        cached = isinstance(answer, Answer) and answer.cache == "hit"
        self._count(
            role,
            seconds,
            cached=cached,
            cache_hits=int(cached),
            unreadable=int(answer.outcome == "unreadable"),
            refused=int(answer.outcome == "refused"),
            prompt_tokens=tokens.prompt if tokens else 0,
            completion_tokens=tokens.completion if tokens else 0,
        )
        self.spend(role, seconds)
        if answer.outcome == "unreadable":
            return Unreadable(answer, seconds)
        if answer.outcome == "refused":
            return Refused(answer, seconds)
        return Answered(answer, seconds)

    def spend(self, part: str, seconds: float) -> None:
        """Adds wall time to a part."""
        self.seconds[part] = self.seconds.get(part, 0.0) + seconds

    def _count(self, role: Role, seconds: float, *, cached: bool, **more: int) -> None:
        before = self.calls.get(role, ModelCalls())
        grown = {name: getattr(before, name) + by for name, by in more.items()}
        latencies = before.latencies_s if cached else (*before.latencies_s, round(seconds, 4))[:MAX_LATENCIES]
        self.calls[role] = before.model_copy(
            update={
                "calls": before.calls + 1,
                "seconds": before.seconds + seconds,
                "latencies_s": latencies,
                **grown,
            }
        )
