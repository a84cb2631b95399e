"""Viewpoint selection (eq. 4-6): which camera looks along the building's edge.

Everything is written for clockwise flight, the building on the drone's right: in a useful view the left part is open
and the right part is facade. Counter-clockwise flight is the mirror image: slices reversed, headings negated.
"""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.sensing import INVALID, NO_RETURN

_ROWS_AT_ONCE = 128
"""Rows summed in one go: 128 x 65535 is a whole number that a 32-bit float holds exactly, and a block of 800 columns
stays in the processor's second cache."""

Policy = Literal["paper", "random", "default"]
Direction = Literal["clockwise", "counterclockwise"]


class ViewpointParameters(NamedTuple):
    """Free constants of eq. 4-6.

    `slices`: x, the number of vertical slices. `delta_m`: eq. 4's threshold. `d_max_m`: where the search of d_max
    starts; each step without a valid split raises it by `d_max_step_m`, at most to `d_max_limit_m`, and a valid split
    resets it. `max_over`: how many facade slices may lie beyond d_max. `sensor_range_m`: what no-return counts as.
    """

    policy: Policy
    direction: Direction
    slices: int
    delta_m: float
    d_max_m: float
    d_max_step_m: float
    d_max_limit_m: float
    max_over: int
    sensor_range_m: float


class Split(NamedTuple):
    """A candidate split after slice `j` (1..slices - 1). j counts from the left flying clockwise, from the right
    counter-clockwise: always from the open side."""

    j: int
    difference_m: float
    variance_m2: float
    over: int
    valid: bool


class ViewScore(NamedTuple):
    """`best` is eq. 5's split, None where no split is valid."""

    splits: tuple[Split, ...]
    best: Split | None


class Sliced(NamedTuple):
    """A level view as eq. 4 takes it: its heading, and its slices' means from the picture's left to its right."""

    heading_deg: float
    means_m: Sequence[float] | NDArray[np.float64]


class Choice(NamedTuple):
    """The chosen view, by its camera's name. `reason`: `split` (eq. 6), `no_split` (default view, d_max raised for the
    next step), or the ablation."""

    name: str
    heading_deg: float
    reason: Literal["split", "no_split", "random", "default"]
    d_max_m: float
    d_max_next_m: float
    scores: Mapping[str, ViewScore]


def row_range(y_min: float, y_max: float, height: int) -> tuple[int, int]:
    """Rows (first, past the last) of an image that a box's y-range (0..1 from the top) touches; at least one."""
    first = min(int(y_min * height), height - 1)
    return first, min(height, max(first + 1, int(np.ceil(y_max * height))))


def slice_means(
    units: NDArray[np.uint16],
    metres_per_unit: float,
    slices: int,
    sensor_range_m: float,
    rows: tuple[int, int] | None = None,
) -> NDArray[np.float64]:
    """(slices,) mean planar depth in metres of equal-width slices from left to right, nan where no pixel is valid.

    units: (H, W) uint16, planar depth / `metres_per_unit`; 0 is invalid and ignored, 65535 is no return. No-return, and
    any depth beyond it, counts as `sensor_range_m` before the mean is taken. `rows` crops (first, past the last).
    Where the width does not divide, slice borders are rounded to whole columns.
    Raises ValueError for fewer columns than slices.
    """
    cropped = units if rows is None else units[rows[0] : rows[1]]
    height, width = cropped.shape
    if width < slices:
        raise ValueError(f"{width} columns can't be cut into {slices} slices")
    limit = min(round(sensor_range_m / metres_per_unit), NO_RETURN)
    sums = np.zeros(width, np.float64)
    valid = np.full(width, height, np.int64)
    # OpenCV sums 16-bit columns more than twice as fast as numpy; blocks keep its 32-bit floats exact
    for start in range(0, height, _ROWS_AT_ONCE):
        low = cv2.threshold(cropped[start : start + _ROWS_AT_ONCE], limit, limit, cv2.THRESH_TRUNC)[1]
        sums += cv2.reduce(low, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32F)[0]
        if low.min() == INVALID:
            valid -= np.count_nonzero(low == INVALID, axis=0)
    borders = np.rint(np.arange(slices) * (width / slices)).astype(np.intp)
    totals = np.add.reduceat(sums, borders)
    counts = np.add.reduceat(valid, borders)
    means = np.full(slices, np.nan)
    np.divide(totals * metres_per_unit, counts, out=means, where=counts > 0)
    # the limit is a whole number of units: a slice of nothing but no-returns shall lie exactly at the range
    np.minimum(means, sensor_range_m, out=means)
    return means


def score_view(
    means_m: Sequence[float] | NDArray[np.float64], settings: ViewpointParameters, d_max_m: float
) -> ViewScore:
    """Eq. 4 and 5 for one view's slice means, given from the picture's left to its right; nan means are ignored.

    Eq. 4: mean(left) - mean(right) >= delta, and at most `max_over` right means beyond d_max. Eq. 5: among these, the
    least sum of squared deviations within the two parts; of equals the larger j. A split with an empty part is invalid.
    """
    means = np.asarray(means_m, np.float64)
    if settings.direction == "counterclockwise":
        means = means[::-1]
    known = ~np.isnan(means)
    means = np.where(known, means, 0.0)
    n = len(means)
    left = np.tri(n - 1, n, dtype=bool) & known  # row j - 1: the slices before the split
    right = ~np.tri(n - 1, n, dtype=bool) & known
    filled = left.any(axis=1) & right.any(axis=1)
    left_mean, left_spread = _mean_and_spread(means, left)
    right_mean, right_spread = _mean_and_spread(means, right)
    difference = np.where(filled, left_mean - right_mean, 0.0)
    variance = np.where(filled, left_spread + right_spread, 0.0)
    over = (right & (means > d_max_m)).sum(axis=1)
    valid = filled & (difference >= settings.delta_m) & (over <= settings.max_over)
    columns = (difference.tolist(), variance.tolist(), over.tolist(), valid.tolist())
    splits = tuple(Split(j, *facts) for j, facts in enumerate(zip(*columns, strict=True), start=1))
    best = min((s for s in splits if s.valid), key=lambda s: (s.variance_m2, -s.j), default=None)
    return ViewScore(splits, best)


def choose_view(
    views: Mapping[str, Sliced],
    settings: ViewpointParameters,
    d_max_m: float | None,
    generator: np.random.Generator,
) -> Choice:
    """Eq. 6 over the level views, keyed by their cameras' names; `d_max_m` is what the last choice handed on.

    The largest j* wins; of equals the smaller within-part variance, then the view farther towards the building's side.
    Without a valid split: the view farthest towards the building's side (+90 clockwise), and d_max rises. The
    ablations: `random` draws a heading from `generator`, `default` takes that same side view; both leave d_max alone.
    Raises ValueError for no views.
    """
    if not views:
        raise ValueError("a viewpoint is chosen from at least one view")
    d_max = settings.d_max_m if d_max_m is None else d_max_m
    side = 1 if settings.direction == "clockwise" else -1
    names = sorted(views, key=lambda name: views[name].heading_deg)
    scores = {name: score_view(views[name].means_m, settings, d_max) for name in names}
    default = max(names, key=lambda name: side * views[name].heading_deg)
    if settings.policy == "random":
        drawn = names[int(generator.choice(len(names)))]
        return Choice(drawn, views[drawn].heading_deg, "random", d_max, d_max, scores)
    if settings.policy == "default":
        return Choice(default, views[default].heading_deg, "default", d_max, d_max, scores)
    found = [
        (score.best.j, -score.best.variance_m2, side * views[name].heading_deg, name)
        for name, score in scores.items()
        if score.best
    ]
    if not found:
        raised = max(d_max, min(d_max + settings.d_max_step_m, settings.d_max_limit_m))
        return Choice(default, views[default].heading_deg, "no_split", d_max, raised, scores)
    best = max(found)[3]
    return Choice(best, views[best].heading_deg, "split", d_max, settings.d_max_m, scores)


def _mean_and_spread(
    means: NDArray[np.float64], parts: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of each row of `parts`: the mean, and the sum of squared deviations from it."""
    mean = (means * parts).sum(axis=1) / np.maximum(parts.sum(axis=1), 1)
    return mean, (((means - mean[:, None]) ** 2) * parts).sum(axis=1)
