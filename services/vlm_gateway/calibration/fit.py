"""Which convention makes a model's numbers lie on the shapes it was shown?

Every order of the four numbers is tried with every scale that is known, and with the scale that fits best whatever it
is. A convention's score is the mean overlap (intersection over union) of the boxes it gives with the true ones; a shape
that was not told counts 0 for all of them.
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from services.vlm_gateway.calibration.picture import HEIGHT, WIDTH, Corners

Order = Literal["xyxy", "yxyx", "xywh"]
Scale = Literal["unit", "thousand", "pixels", "resized_pixels", "other"]
Certainty = Literal["sure", "likely", "unclear", "none"]

ORDERS: tuple[Order, ...] = ("xyxy", "yxyx", "xywh")
FACTORS = (28, 32)
"""Sides of a patch in the processors of Qwen2(.5)-VL and Qwen3-VL."""
SURE_OVERLAP, SURE_LEAD = 0.8, 0.03
LIKELY_OVERLAP, LIKELY_LEAD = 0.5, 0.015
OTHER_LEAD = 0.12
"""How much better a scale nobody knows must be than the best known one: it has two free numbers to fit."""


class Pair(NamedTuple):
    """A shape's true box and the numbers told for it, or None where it was not told."""

    truth: Corners
    numbers: tuple[float, float, float, float] | None


class Convention(NamedTuple):
    """`full`: what the whole width and height are in the model's numbers; `factor`: the patch's side in pixels, for
    `resized_pixels` only."""

    scale: Scale
    order: Order
    full: tuple[float, float]
    factor: int | None = None


class Scored(NamedTuple):
    convention: Convention
    overlap: float


class Fit(NamedTuple):
    """`rival` is the best convention that would be configured otherwise."""

    best: Scored
    rival: Scored
    told: int
    shown: int
    certainty: Certainty


def fit(pairs: Sequence[Pair]) -> Fit:
    """`pairs`: at least one."""
    told = [pair for pair in pairs if pair.numbers is not None]
    known = [_scored(convention, pairs) for convention in _known()]
    free = [_scored(Convention("other", order, _best_full(order, told)), pairs) for order in ORDERS]
    known.sort(key=lambda scored: -scored.overlap)
    free.sort(key=lambda scored: -scored.overlap)
    best = known[0]
    if free[0].overlap > best.overlap + OTHER_LEAD:
        best = free[0]
    others = [scored for scored in known if scored.convention != best.convention]
    return Fit(best, others[0], len(told), len(pairs), _certainty(best, others[0], len(told)))


def resized(factor: int) -> tuple[float, float]:
    """The test picture's size after a processor that rounds both sides to multiples of `factor`."""
    return float(round(WIDTH / factor) * factor), float(round(HEIGHT / factor) * factor)


def _known() -> list[Convention]:
    scales: list[tuple[Scale, tuple[float, float], int | None]] = [
        ("unit", (1.0, 1.0), None),
        ("thousand", (1000.0, 1000.0), None),
        ("pixels", (float(WIDTH), float(HEIGHT)), None),
        *(("resized_pixels", resized(factor), factor) for factor in FACTORS),
    ]
    return [Convention(scale, order, full, factor) for scale, full, factor in scales for order in ORDERS]


def _certainty(best: Scored, rival: Scored, told: int) -> Certainty:
    lead = best.overlap - rival.overlap
    if best.overlap < LIKELY_OVERLAP / 2 or told < 2:
        return "none"
    if best.overlap >= SURE_OVERLAP and lead >= SURE_LEAD and told >= 4:
        return "sure"
    return "likely" if best.overlap >= LIKELY_OVERLAP and lead >= LIKELY_LEAD else "unclear"


def _scored(convention: Convention, pairs: Sequence[Pair]) -> Scored:
    return Scored(convention, sum(_overlap(pair, convention) for pair in pairs) / len(pairs))


def _overlap(pair: Pair, convention: Convention) -> float:
    if pair.numbers is None:
        return 0.0
    told = _corners(pair.numbers, convention.order)
    full_x, full_y = convention.full
    x0, y0, x1, y1 = told.x0 / full_x, told.y0 / full_y, told.x1 / full_x, told.y1 / full_y
    if x1 <= x0 or y1 <= y0:
        return 0.0
    truth = pair.truth
    width = min(x1, truth.x1) - max(x0, truth.x0)
    height = min(y1, truth.y1) - max(y0, truth.y0)
    both = max(0.0, width) * max(0.0, height)
    area = (x1 - x0) * (y1 - y0) + (truth.x1 - truth.x0) * (truth.y1 - truth.y0) - both
    return both / area


def _corners(numbers: tuple[float, float, float, float], order: Order) -> Corners:
    first, second, third, fourth = numbers
    if order == "yxyx":
        return Corners(second, first, fourth, third)
    if order == "xywh":
        return Corners(first, second, first + third, second + fourth)
    return Corners(first, second, third, fourth)


def _best_full(order: Order, told: Sequence[Pair]) -> tuple[float, float]:
    """The scale of this order, by the middle of what each far edge says it is; two wild boxes in six do no harm."""
    boxes = [(_corners(pair.numbers, order), pair.truth) for pair in told if pair.numbers is not None]
    full_x = [box.x1 / truth.x1 for box, truth in boxes]
    full_y = [box.y1 / truth.y1 for box, truth in boxes]
    return _middle(full_x), _middle(full_y)


def _middle(values: list[float]) -> float:
    middle = float(np.median(values)) if values else 1.0
    return middle if math.isfinite(middle) and middle > 1e-6 else 1.0
