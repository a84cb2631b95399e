"""Floors and the building's outline, read off the proposer's maps of a picture taken squarely."""

from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box

Floats = NDArray[np.float32]
REACH = 0.25
"""Of the picture's width, to both sides of its middle: where rows of windows are looked for."""
APART = 2.5
"""Cells: no two floors are as near as this, even in a picture of a whole high-rise."""
MERGE = 0.55
"""Rows nearer to each other than this share of the usual distance are one: a balcony's door beside a window."""
MIN_CELLS = 3
MIN_SHARE = 0.002
"""Of the picture: a smaller patch is no building."""


class Row(NamedTuple):
    """The middle of a row of windows, in cells from the top, and how sure the map is of it."""

    at: float
    strength: float


def rows_of(row: Floats, building: Floats, *, likely: float, inside: float) -> list[Row]:
    """The rows of windows about the middle of the picture, topmost first.

    row, building: (h, w) 0..1. Counted up the column nearest to the middle in which the building is seen, and its
    neighbourhood, because a lamp post or a tree may stand right before it.
    """
    return rows_in(profile_of(row, building, inside=inside), likely)


def profile_of(row: Floats, building: Floats, *, inside: float) -> Floats:
    """(h,): the mean of the map of rows about that column, 0 where the building is not seen."""
    seen = building >= inside
    columns = np.flatnonzero(seen.sum(axis=0) >= MIN_CELLS)
    if not len(columns):
        return np.zeros(len(row), np.float32)
    width = row.shape[1]
    column = int(columns[np.abs(columns + 0.5 - width / 2).argmin()])
    reach = max(1, round(REACH * width))
    near = slice(max(0, column - reach), min(width, column + reach + 1))
    shares = seen[:, near].sum(axis=1)
    profile = np.where(seen[:, near], row[:, near], 0.0).sum(axis=1) / np.maximum(shares, MIN_CELLS)
    return np.asarray(profile, np.float32)


def rows_in(profile: Floats, likely: float) -> list[Row]:
    """Its peaks of at least `likely`, as many as can be floors."""
    return merged(apart(peaks(profile, likely)))


def peaks(profile: Floats, likely: float) -> list[Row]:
    """Local maxima of at least `likely`, to a fraction of a cell."""
    found = []
    last = len(profile) - 1
    for i in range(len(profile)):
        here = float(profile[i])
        before, after = float(profile[max(0, i - 1)]), float(profile[min(last, i + 1)])
        if here < likely or here < before or (here <= after and i != last):
            continue
        bend = before - 2 * here + after
        shift = 0.0 if bend >= 0 or i in (0, last) else 0.5 * (before - after) / bend
        found.append(Row(i + 0.5 + min(0.5, max(-0.5, shift)), here))
    return found


def apart(rows: list[Row]) -> list[Row]:
    """Without rows that stand too near to a stronger one to be another floor."""
    kept: list[Row] = []
    for row in sorted(rows, key=lambda r: -r.strength):
        if all(abs(row.at - other.at) >= APART for other in kept):
            kept.append(row)
    return kept


def merged(rows: list[Row]) -> list[Row]:
    """Without rows that stand too near to a stronger one for the distance that the others keep."""
    kept = sorted(rows, key=lambda r: r.at)
    while len(kept) >= 3:
        gaps = [b.at - a.at for a, b in pairwise(kept)]
        usual = float(np.median(gaps))
        at = int(np.argmin(gaps))
        if gaps[at] >= MERGE * usual:
            break
        kept.remove(min(kept[at], kept[at + 1], key=lambda r: r.strength))
    return kept


def box_of(building: Floats, *, inside: float) -> tuple[Box, float] | None:
    """The outline of the largest patch of building, and how sure the map is inside it; null where there is none.

    building: (h, w) 0..1.
    """
    mask = (building >= inside).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8, ltype=cv2.CV_32S)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    x, y, wide, tall, area = (int(v) for v in stats[largest])
    if area < MIN_SHARE * mask.size:
        return None
    height, width = mask.shape
    box = Box(x_min=x / width, y_min=y / height, x_max=(x + wide) / width, y_max=(y + tall) / height)
    return box, float(building[labels == largest].mean())
