"""Floor localization replayed on the counts of one model: the pictures are the bands' own, eq. 3 and what is made of
window rows are the mission's."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from contracts.orchestrator import MissionSettings
from evaluation.metrics.floor_localization import TOLERANCE_M
from evaluation.metrics.summary import Rate
from evaluation.model_evaluation.asking import Answers, Counted
from evaluation.model_evaluation.cases import Case, Front
from evaluation.model_evaluation.pictures import FRONT_VIEW
from evaluation.subtasks.figures import by_group, mean, rate
from navigation.floor_localization import (
    FinalHeight,
    FloorLocalizationParameters,
    WindowRows,
    band,
    band_span_m,
    corrected,
    decide,
    direct_count,
    rows_of_band,
)

_EQ3 = FloorLocalizationParameters(reading=MissionSettings().band_reading)


class Heights(NamedTuple):
    """Rates of the streets that look like those trained on, and of the strange ones."""

    usual: dict[str, Rate]
    strange: dict[str, Rate]
    by_building: dict[str, Rate]
    box_overlap: float | None


def heights(cases: Mapping[int, Case], answers: Answers) -> Heights:
    """A failure is a final height more than the paper's 7 m off, or none at all."""
    counts: dict[int, dict[int, Counted]] = {}
    for counted in answers.counted:
        counts.setdefault(counted.seed, {})[counted.front] = counted
    usual = [case for case in cases.values() if not case.strange and case.seed in counts]
    strange = [case for case in cases.values() if case.strange and case.seed in counts]
    bands = [(case, f, c) for case in usual for f, c in _pairs(case, counts) if f.number]
    overlaps = [_overlap(f, c) for _, f, c in bands if f.truth.building_box is not None]
    return Heights(
        _rates(usual, counts),
        _rates(strange, counts),
        by_group((case.building, c.floors == f.truth.floors_visible) for case, f, c in bands),
        mean(overlaps),
    )


class Told(NamedTuple):
    """One answer about a band: its floors, and their window rows where there is one for each."""

    floors: int | None
    rows: tuple[float, ...] = ()


def stepwise_m(case: Case, counts: Mapping[int, Told]) -> float | None:
    """The final height, band after band; null where it isn't found. counts: by number of the band."""
    bands = {front.number: front for front in case.fronts if front.number}
    counted = 0.0
    below: WindowRows | None = None
    for number in sorted(bands):
        front = bands[number]
        floors, rows = counts.get(number, Told(None))
        here = band(number, band_span_m(front.stand_off_m, FRONT_VIEW))
        seen = WindowRows(rows, front.camera_m, front.stand_off_m, FRONT_VIEW) if rows else None
        if seen is not None:
            rows = rows_of_band(seen, below, here)
            seen, floors = seen._replace(rows=rows), len(rows)
        decision = decide(here, counted, floors, case.floor, front.facade_top_m, _EQ3)
        if isinstance(decision, FinalHeight):
            return (decision if seen is None else corrected(decision, case.floor, seen, _EQ3)).height_m
        below = seen
        counted += floors or 0
    return None


def direct_m(case: Case, count: int | None) -> float | None:
    """The final height by one count of the whole building; null where it isn't found, or nobody could step back."""
    whole = next((front for front in case.fronts if not front.number), None)
    if whole is None:
        return None
    top = whole.facade_top_m if whole.facade_top_m is not None else whole.camera_m + whole.stand_off_m
    decision = direct_count(count, max(top, 1.0), case.floor, _EQ3)
    return decision.height_m if isinstance(decision, FinalHeight) else None


def _rates(cases: Sequence[Case], counts: Mapping[int, Mapping[int, Counted]]) -> dict[str, Rate]:
    bands = [(f, c) for case in cases for f, c in _pairs(case, counts) if f.number]
    whole = [(f, c) for case in cases for f, c in _pairs(case, counts) if not f.number]
    stepwise, direct = [], []
    for case in cases:
        told = {f.number: _told(c) for f, c in _pairs(case, counts)}
        goal_m = (case.floor - 0.5) * case.floor_height_m
        stepwise.append((stepwise_m(case, told), goal_m, case.floor_height_m))
        if 0 in told:
            direct.append((direct_m(case, told[0].floors), goal_m, case.floor_height_m))
    return {
        "exact": rate(c.floors == f.truth.floors_visible for f, c in bands),
        "within one": rate(_within_one(f, c) for f, c in bands),
        "whole building exact": rate(c.floors == f.truth.floors_visible for f, c in whole),
        "stepwise failures": rate(h is None or abs(h - goal) > TOLERANCE_M for h, goal, _ in stepwise),
        "stepwise within half a floor": rate(h is not None and abs(h - goal) <= f / 2 for h, goal, f in stepwise),
        "direct-count failures": rate(h is None or abs(h - goal) > TOLERANCE_M for h, goal, _ in direct),
        "direct-count within half a floor": rate(h is not None and abs(h - goal) <= f / 2 for h, goal, f in direct),
    }


def _pairs(case: Case, counts: Mapping[int, Mapping[int, Counted]]) -> list[tuple[Front, Counted]]:
    mine = counts[case.seed]
    return [(front, mine[k]) for k, front in enumerate(case.fronts) if k in mine]


def _told(counted: Counted) -> Told:
    rows = counted.rows or ()
    return Told(counted.floors, rows if len(rows) == counted.floors else ())


def _within_one(front: Front, counted: Counted) -> bool:
    return counted.floors is not None and abs(counted.floors - front.truth.floors_visible) <= 1


def _overlap(front: Front, counted: Counted) -> float:
    truth, mine = front.truth.building_box, counted.box
    if truth is None or mine is None:
        return 0.0
    both = min(truth.y_max, mine.y_max) - max(truth.y_min, mine.y_min)
    return max(0.0, both) / (max(truth.y_max, mine.y_max) - min(truth.y_min, mine.y_min))
