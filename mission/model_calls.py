"""Every question to a model goes through `ask`, so that its four possible ends are told apart and counted.

Answered, Unreadable and Refused are what `ask` returns; the fourth, ModelUnreachable, is raised: there is no answer.
"""

import time
from collections.abc import Awaitable, Callable
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


async def ask(call: Awaitable[A], before: ModelCalls, count: Callable[[ModelCalls], None]) -> Reply[A]:
    """Awaits the answer; `count` hears `before` with this call added, whatever its end. Raises PortError."""
    started = time.perf_counter()
    try:
        answer = await call
    except ModelUnreachable:
        count(_with_call(before, time.perf_counter() - started, cached=False, unreachable=1))
        raise
    seconds = time.perf_counter() - started
    tokens = answer.tokens if isinstance(answer, Answer) else None
    cached = isinstance(answer, Answer) and answer.cache == "hit"
    count(
        _with_call(
            before,
            seconds,
            cached=cached,
            model=answer.model,
            cache_hits=int(cached),
            unreadable=int(answer.outcome == "unreadable"),
            refused=int(answer.outcome == "refused"),
            prompt_tokens=tokens.prompt if tokens else 0,
            completion_tokens=tokens.completion if tokens else 0,
        )
    )
    if answer.outcome == "unreadable":
        return Unreadable(answer, seconds)
    if answer.outcome == "refused":
        return Refused(answer, seconds)
    return Answered(answer, seconds)


@dataclass
class CallBook:
    """Counts of model calls by role, for whoever asks without a mission."""

    calls: dict[str, ModelCalls] = field(default_factory=dict)

    async def ask(self, role: Role, call: Awaitable[A]) -> Reply[A]:
        """Asks and counts. Raises PortError; ModelUnreachable is counted too."""

        def count(calls: ModelCalls) -> None:
            self.calls[role] = calls

        return await ask(call, self.calls.get(role, ModelCalls()), count)


def _with_call(
    before: ModelCalls, seconds: float, *, cached: bool, model: str | None = None, **more: int
) -> ModelCalls:
    grown = {name: getattr(before, name) + by for name, by in more.items()}
    latencies = before.latencies_s if cached else (*before.latencies_s, round(seconds, 4))[:MAX_LATENCIES]
    models = before.models if model is None or model in before.models else (*before.models, model)
    changes = {
        "calls": before.calls + 1,
        "seconds": before.seconds + seconds,
        "latencies_s": latencies,
        "models": models,
        **grown,
    }
    return before.model_copy(update=changes)
