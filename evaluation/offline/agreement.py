"""How far those who were asked agree, and what each took: figures of answers to the same questions."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from contracts.base import Wire
from contracts.geometry import Box
from contracts.vlm_gateway import Match
from evaluation.metrics.proportion import share
from evaluation.metrics.summary import Rate
from evaluation.offline.questions import KINDS, Given, Kind, RecordedQuestion

SAME_BOX = 0.5
"""Two boxes are of one thing from this intersection over union on."""


class Price(NamedTuple):
    """US dollars for a million tokens."""

    prompt: float
    completion: float


class RaterFigures(Wire):
    """Of one kind of question. `latency_s` of answers that no cache gave; `usd` is null where no price is known."""

    asked: int
    answered: int
    refused: int
    unreadable: int
    unreachable: int
    cached: int
    latency_p50_s: float | None
    latency_p95_s: float | None
    prompt_tokens: int
    completion_tokens: int
    usd: float | None


class OfflineSummary(Wire):
    """`figures` by kind and by who was asked; `agreement` by kind and both who are compared, over the questions that
    both answered."""

    questions: dict[Kind, int]
    figures: dict[Kind, dict[str, RaterFigures]]
    agreement: dict[Kind, dict[str, dict[str, Rate]]]


def summarize_offline(
    questions: Sequence[RecordedQuestion],
    answers: Mapping[str, Mapping[str, Given]],
    prices: Mapping[str, Price],
) -> OfflineSummary:
    """`answers` by who gave them and by question; `prices` by model."""
    all_kinds: dict[Kind, list[str]] = {kind: [q.id for q in questions if q.kind == kind] for kind in KINDS}
    kinds: dict[Kind, list[str]] = {kind: ids for kind, ids in all_kinds.items() if ids}
    return OfflineSummary(
        questions={kind: len(ids) for kind, ids in kinds.items()},
        figures={
            kind: {who: _figures([a[i] for i in ids if i in a], prices.get(who)) for who, a in answers.items()}
            for kind, ids in kinds.items()
        },
        agreement={kind: _matrix(kind, ids, answers) for kind, ids in kinds.items()},
    )


def _matrix(kind: Kind, ids: Sequence[str], answers: Mapping[str, Mapping[str, Given]]) -> dict[str, dict[str, Rate]]:
    return {
        one: {other: _agreement(kind, ids, mine, theirs) for other, theirs in answers.items()}
        for one, mine in answers.items()
    }


def agree(kind: Kind, one: Given, other: Given) -> bool:
    """Of two answers: the same count or label; the object seen by neither, or by both in the same place."""
    if kind == "floor-count":
        return one.floors == other.floors
    if kind == "choose-direction":
        return one.label == other.label
    if not one.found or not other.found:
        return bool(one.found) == bool(other.found)
    return any(_same_place(a, b) for a in one.matches for b in other.matches)


def _same_place(one: Match, other: Match) -> bool:
    return one.camera == other.camera and overlap(one.box, other.box) >= SAME_BOX


def overlap(one: Box, other: Box) -> float:
    """Intersection over union."""
    width = min(one.x_max, other.x_max) - max(one.x_min, other.x_min)
    height = min(one.y_max, other.y_max) - max(one.y_min, other.y_min)
    shared = max(0.0, width) * max(0.0, height)
    return shared / (_area(one) + _area(other) - shared)


def _area(box: Box) -> float:
    return (box.x_max - box.x_min) * (box.y_max - box.y_min)


def _agreement(kind: Kind, ids: Sequence[str], one: Mapping[str, Given], other: Mapping[str, Given]) -> Rate:
    both = [(one[i], other[i]) for i in ids if i in one and i in other]
    found = share(agree(kind, a, b) for a, b in both if a.outcome == b.outcome == "answered")
    return Rate(**found._asdict())


def _figures(given: Sequence[Given], price: Price | None) -> RaterFigures:
    waits = [one.latency_s for one in given if not one.cached and one.outcome != "unreachable" and one.latency_s > 0]
    prompt, completion = sum(one.prompt_tokens for one in given), sum(one.completion_tokens for one in given)
    usd = None if price is None else (prompt * price.prompt + completion * price.completion) / 1e6
    outcomes = [one.outcome for one in given]
    return RaterFigures(
        asked=len(given),
        answered=outcomes.count("answered"),
        refused=outcomes.count("refused"),
        unreadable=outcomes.count("unreadable"),
        unreachable=outcomes.count("unreachable"),
        cached=sum(one.cached for one in given),
        latency_p50_s=round(float(np.quantile(waits, 0.5)), 4) if waits else None,
        latency_p95_s=round(float(np.quantile(waits, 0.95)), 4) if waits else None,
        prompt_tokens=prompt,
        completion_tokens=completion,
        usd=None if usd is None else round(usd, 6),
    )
