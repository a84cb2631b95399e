"""What the models were asked: calls, tokens, what the cache answered, and how long one waits, by role."""

from collections.abc import Sequence

import numpy as np

from contracts.base import Wire
from contracts.orchestrator import ModelCalls
from evaluation.metrics.episode import EpisodeRecord


class Latency(Wire):
    """Seconds from question to answer, of the calls that no cache answered; null where there was none."""

    n: int
    p50: float | None
    p95: float | None
    p99: float | None


class RoleCalls(Wire):
    """All calls of one role in a run. `seconds` is the time waited for, cache hits included."""

    calls: int = 0
    cache_hits: int = 0
    unreadable: int = 0
    refused: int = 0
    unreachable: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    seconds: float = 0.0
    latency_s: Latency = Latency(n=0, p50=None, p95=None, p99=None)


def latency(seconds: Sequence[float]) -> Latency:
    """Percentiles by linear interpolation; null without a call."""
    if not seconds:
        return Latency(n=0, p50=None, p95=None, p99=None)
    p50, p95, p99 = (round(float(value), 4) for value in np.percentile(seconds, [50, 95, 99]))
    return Latency(n=len(seconds), p50=p50, p95=p95, p99=p99)


def model_calls(records: Sequence[EpisodeRecord]) -> dict[str, RoleCalls]:
    """By role, in alphabetical order; empty without a call."""
    by_role: dict[str, list[ModelCalls]] = {}
    for record in records:
        for role, calls in (record.result.model_calls if record.result is not None else {}).items():
            by_role.setdefault(role, []).append(calls)
    return {role: together(by_role[role]) for role in sorted(by_role)}


def together(parts: Sequence[ModelCalls]) -> RoleCalls:
    """Several counts of one role as one."""
    return RoleCalls(
        calls=sum(part.calls for part in parts),
        cache_hits=sum(part.cache_hits for part in parts),
        unreadable=sum(part.unreadable for part in parts),
        refused=sum(part.refused for part in parts),
        unreachable=sum(part.unreachable for part in parts),
        prompt_tokens=sum(part.prompt_tokens for part in parts),
        completion_tokens=sum(part.completion_tokens for part in parts),
        seconds=round(sum(part.seconds for part in parts), 3),
        latency_s=latency([seconds for part in parts for seconds in part.latencies_s]),
    )
