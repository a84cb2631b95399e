"""The figures of a parser over labelled requests, by file and by tag, and what it missed."""

from collections.abc import Sequence
from typing import NamedTuple

from contracts.base import Wire
from contracts.llm_parser import ParseAnswer
from contracts.orchestrator import ModelCalls
from evaluation.labelled_requests.judge import Judged, Outcome, Reading, judge
from evaluation.labelled_requests.read import FiledRequest
from evaluation.metrics.model_calls import RoleCalls, together
from evaluation.metrics.summary import Rate
from evaluation.subtasks.figures import rate


class AskedRequest(NamedTuple):
    """One request, the parser's answer, and the call. `answer` is null where the model was out of reach: such a request
    is in no figure."""

    filed: FiledRequest
    answer: ParseAnswer | None
    calls: ModelCalls

    @property
    def reading(self) -> Reading:
        answer = self.answer
        if answer is None or answer.outcome != "answered":
            return Reading(None, None, readable=False)
        return Reading(answer.floor, answer.object)


class Group(Wire):
    """Some requests: how they ended, and floor and object apart; each with its 95 % interval."""

    requests: int
    right: Rate
    asks: Rate
    silently_wrong: Rate
    floor: Rate
    object: Rate
    object_exact: Rate


class RequestScores(Wire):
    """A parser's figures. A tag's group holds the requests that carry it. `ms_mean`: what a request took, asked one
    after the other or `at_a_time`, as its caller sees it; the percentiles are in `calls`."""

    model: str | None
    all: Group
    files: dict[str, Group]
    tags: dict[str, Group]
    ms_mean: float | None
    at_a_time: int
    calls: RoleCalls
    wall_s: float


class Miss(Wire):
    """A request that was not read right: what its label says, and what the parser said."""

    file: str
    line: int
    outcome: Outcome
    text: str
    floor: int | None
    floor_read: int | None
    object: str | None
    object_read: str | None
    question: str | None
    tags: tuple[str, ...]


def score(asked: Sequence[AskedRequest], *, at_a_time: int, wall_s: float) -> RequestScores:
    """The figures over all requests at which the model could be reached."""
    judged = [(one.filed, judge(one.filed.request, one.reading)) for one in asked if one.answer is not None]
    files = dict.fromkeys(one.filed.file for one in asked)
    tags = sorted({tag for filed, _ in judged for tag in filed.request.tags})
    calls = together([one.calls for one in asked])
    latencies = [s for one in asked if one.answer is not None for s in one.calls.latencies_s]
    return RequestScores(
        model=next((one.answer.model for one in reversed(asked) if one.answer is not None), None),
        all=_group([j for _, j in judged]),
        files={file: _group([j for filed, j in judged if filed.file == file]) for file in files},
        tags={tag: _group([j for filed, j in judged if tag in filed.request.tags]) for tag in tags},
        ms_mean=round(1000 * sum(latencies) / len(latencies), 2) if latencies else None,
        at_a_time=at_a_time,
        calls=calls,
        wall_s=round(wall_s, 3),
    )


def misses(asked: Sequence[AskedRequest]) -> list[Miss]:
    """What was read wrong or left open, in the files' order."""
    return [
        _miss(one, judged)
        for one in asked
        if one.answer is not None and (judged := judge(one.filed.request, one.reading)).outcome != "right"
    ]


def _group(judged: Sequence[Judged]) -> Group:
    return Group(
        requests=len(judged),
        right=rate(j.outcome == "right" for j in judged),
        asks=rate(j.outcome == "asks" for j in judged),
        silently_wrong=rate(j.outcome == "silently_wrong" for j in judged),
        floor=rate(j.floor for j in judged),
        object=rate(j.object for j in judged),
        object_exact=rate(j.object_exact for j in judged),
    )


def _miss(one: AskedRequest, judged: Judged) -> Miss:
    filed, reading = one.filed, one.reading
    return Miss(
        file=filed.file,
        line=filed.line,
        outcome=judged.outcome,
        text=filed.request.text,
        floor=filed.request.floor,
        floor_read=reading.floor,
        object=filed.request.object,
        object_read=reading.object,
        question=one.answer.question if one.answer is not None else None,
        tags=filed.request.tags,
    )
