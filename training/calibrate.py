"""Thresholds and confidence from validation pictures: every thing of a street is asked for in every picture of it.

A raw score becomes a confidence by the share of such sightings that were right (a rising step function, smoothed to a
line). `claim` is the lowest confidence at which missions made up of these pictures, flown in random order until
something is claimed, come out as well as at any: a wrong claim outweighs `WRONG_WEIGHS` right ones. `row` is what
counts most floors rightly.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.vlm_gateway.embedded.exported import Calibration
from services.vlm_gateway.embedded.floors import rows_in
from training.crop_store import overlap_matrix
from training.judge import RIGHT, SeenPicture, fair

WRONG_WEIGHS = 3.0
"""A parcel at a wrong window is worse than one brought back, and a thing that is not claimed is mostly seen again."""
AS_WELL = 0.002
LEAST = 0.02
"""A lower score is not worth looking at."""
ORDERS = 4
ROWS = tuple(round(0.1 + 0.02 * k, 2) for k in range(21))
"""Thresholds for a row of windows that are tried."""
_POINTS = 24
PLAIN = Calibration(score=(0.0, 1.0), probability=(0.0, 1.0))
"""Before anything is known: the score itself."""


class Sighting(NamedTuple):
    """The best sighting of one question in one picture; `fair` says that the thing asked for should be found there."""

    question: tuple[int, int, int]
    score: float
    right: bool
    fair: bool


def sightings(all_looks: Iterable[SeenPicture]) -> list[Sighting]:
    """For each street every (class, colour) that stands there anywhere, in each of its pictures."""
    streets: dict[int, list[SeenPicture]] = defaultdict(list)
    for look in all_looks:
        streets[look.seed].append(look)
    found = []
    for seed, views in streets.items():
        asked = {(int(t["kind"]), int(t["colour"])) for v in views for t in v.things[fair(v.things)]}
        for kind, colour in sorted(asked):
            for view in views:
                found.append(_ask(view, (seed, kind, colour)))
    return found


def _ask(view: SeenPicture, question: tuple[int, int, int]) -> Sighting:
    _, kind, colour = question
    mine = (view.things["kind"] == kind) & (view.things["colour"] == colour)
    good = bool((mine & fair(view.things)).any())
    if not len(view.kind):
        return Sighting(question, 0.0, False, good)
    score = view.kind[:, kind] * view.colour[:, colour]
    best = int(score.argmax())
    right = False
    if mine.any():
        true = view.things["box"].reshape(-1, 4)[mine].astype(np.float32)
        right = bool(overlap_matrix(view.tight[best : best + 1], true).max() >= RIGHT)
    return Sighting(question, float(score[best]), right, good)


def calibrated(found: Sequence[Sighting]) -> Calibration:
    """A rising line through the share of right sightings; with next to no sightings the score stands for itself."""
    score = np.array([s.score for s in found if s.score >= LEAST])
    right = np.array([s.right for s in found if s.score >= LEAST], np.float64)
    if len(score) < 2:
        return PLAIN
    order = np.argsort(score, kind="stable")
    score, share = score[order], rising(right[order])
    at = np.unique(np.linspace(0, len(score) - 1, _POINTS).astype(int))
    # a window about each point, so that one sighting more or less does not move it
    half = max(1, len(score) // (2 * _POINTS))
    points = [float(score[i]) for i in at]
    values = [float(share[max(0, i - half) : i + half + 1].mean()) for i in at]
    pairs = {0.0: 0.0}
    for p, v in zip(points, np.maximum.accumulate(values), strict=True):
        pairs[round(p, 5)] = round(float(min(v, 1.0)), 5)
    if 1.0 not in pairs:
        pairs[1.0] = max(pairs.values())
    return Calibration(score=tuple(pairs), probability=tuple(pairs.values()))


def rising(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nearest sequence that never falls (pool adjacent violators)."""
    heights: list[float] = []
    widths: list[int] = []
    for value in values:
        heights.append(float(value))
        widths.append(1)
        while len(heights) > 1 and heights[-2] >= heights[-1]:
            width = widths[-2] + widths[-1]
            heights[-2] = (heights[-2] * widths[-2] + heights[-1] * widths[-1]) / width
            widths[-2] = width
            heights.pop()
            widths.pop()
    return np.repeat(heights, widths)


class Outcome(NamedTuple):
    """Of missions made up of validation pictures: wrong claims among claims, and right ones among all that could."""

    wrong: float
    found: float


def outcome(found: Sequence[Sighting], score: float, seed: int = 0) -> Outcome:
    """What comes of claiming at the first sighting of at least `score`."""
    questions: dict[tuple[int, int, int], list[Sighting]] = defaultdict(list)
    for s in found:
        questions[s.question].append(s)
    rng = np.random.default_rng(seed)
    wrong = right = missions = 0
    for views in questions.values():
        for _ in range(ORDERS):
            missions += 1
            first = next((views[i] for i in rng.permutation(len(views)) if views[i].score >= score), None)
            if first is not None:
                right += first.right
                wrong += not first.right
    return Outcome(wrong / max(1, wrong + right), right / max(1, missions))


def claim_score(found: Sequence[Sighting]) -> float:
    """The lowest score at which right claims less the weight of wrong ones, as shares, are within `AS_WELL` of the
    best."""
    scores = [float(s) for s in np.linspace(0.05, 0.99, 48)]
    worth = [o.found - WRONG_WEIGHS * o.wrong for o in (outcome(found, score) for score in scores)]
    enough = max(worth) - AS_WELL
    return next(score for score, w in zip(scores, worth, strict=True) if w >= enough)


def row_threshold(all_looks: Iterable[SeenPicture]) -> float:
    """The one of ROWS that counts most square pictures exactly, its neighbours taken into account; the middle one of
    equals. Raises ValueError without square pictures."""
    square = [look for look in all_looks if look.frontal]
    if not square:
        raise ValueError("there are no square pictures to count floors in")
    exact = [sum(len(rows_in(look.row_profile, row)) == look.rows_true for look in square) for row in ROWS]
    steady = np.convolve(np.pad(np.array(exact), 1, mode="edge"), (1, 2, 1), mode="valid")
    best = np.flatnonzero(steady == steady.max())
    return ROWS[int(best[len(best) // 2])]
