"""Which ground plans are a building's."""

import math

import pytest

from contracts.footprint import footprint_problem

SQUARE = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]


@pytest.mark.parametrize(
    "corners",
    [
        SQUARE,
        [(x + 9_989.0, y - 10_000.0) for x, y in SQUARE],
        [(0.0, 0.0), (5.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)],  # a corner that is none
        [(0.0, 0.0), (9.0, 0.0), (9.0, 4.0), (5.0, 4.0), (5.0, 9.0), (0.0, 9.0)],
        [(math.cos(k * math.pi / 16) * 8, math.sin(k * math.pi / 16) * 8) for k in range(32)],
    ],
)
def test_walls_that_meet_at_their_corners_only_make_a_plan(corners: list[tuple[float, float]]) -> None:
    assert footprint_problem(corners) is None


@pytest.mark.parametrize(
    ("corners", "said"),
    [
        ([(0, 0), (10, 10), (10, 0), (0, 12)], "cross"),
        ([(0, 0), (20, 0), (20, 10), (5, 10), (15, -5), (0, 10)], "cross"),
        ([(0, 0), (10, 0), (10, 10), (0, 10), (0, 0), (3, 3), (3, 6), (6, 6), (6, 3), (3, 3)], "touch"),
        ([(0, 0), (10, 0), (10, 10), (5, 0.05), (0, 10)], "apart"),
        ([(0, 0), (10, 0), (10, 10), (5.5, 10), (5.25, 100), (5, 10), (0, 10)], "sharper than 10 degrees"),
        ([(0, 0), (10, 0), (10, 10), (5.0001, 10), (5, 100), (5, 10), (0, 10)], "sharper"),
        ([(0, 0), (10, 0), (10, 0), (10, 10)], "long"),
        ([(0, 0), (5e-324, 0), (0, 5e-324)], "long"),
        ([(0, 0), (1, 0), (0.5, 0.9)], "1 m2"),
        (SQUARE[::-1], "counter-clockwise"),
        ([(0, 0), (10, 0), (5, 0)], "sharper"),
    ],
)
def test_a_plan_that_is_none_is_told_what_is_wrong(corners: list[tuple[float, float]], said: str) -> None:
    assert said in str(footprint_problem([(float(x), float(y)) for x, y in corners]))
