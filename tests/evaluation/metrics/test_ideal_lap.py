"""The ideal lap round a square house, by hand."""

import math

import pytest

from evaluation.metrics.ideal_lap import Laps, Window, ideal_lap_spl, ideal_worth, laps, laps_of, worth_of
from tests.evaluation.evaluation_kit import a_task

HOUSE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
START = (5.0, -9.0)
C = 2.0
IN_VIEW = math.tan(math.radians(65.0))


def _half_round(in_view_x: float) -> float:
    """From the start, straight to the tangent of the circle of 2 m about the south-east corner, up the east side, round
    the north-east corner, and west along the wall to where the window comes into view."""
    corner = math.hypot(10.0 - START[0], 0.0 - START[1])
    straight = math.sqrt(corner**2 - C**2)
    # the angle from east at which the tangent touches the circle: the way then turns to due north
    towards = math.atan2(0.0 - START[1], 10.0 - START[0])
    flown = towards - math.asin(C / corner)
    first_arc = C * (math.pi / 2 - flown)
    return straight + first_arc + 10.0 + C * math.pi / 2 + (10.0 - in_view_x)


def test_a_window_on_the_far_side_is_half_a_lap_away_on_either_side() -> None:
    window = Window((5.0, 10.0), (0.0, 1.0))
    found = laps(HOUSE, (), START, window, C)
    # 2 m before the wall the window is in view from 2 x tan 65 degrees aside of it; the stop lies on the same line
    x = 5.0 + (C - 0.05) * IN_VIEW
    by_hand = _half_round(x) + (x - 5.0)
    assert found.counterclockwise_m == pytest.approx(by_hand, rel=0.02)
    assert found.clockwise_m == pytest.approx(by_hand, rel=0.02)
    assert found.counterclockwise_m >= by_hand - 0.1


def test_a_window_round_the_first_corner_is_near_on_one_side_and_far_on_the_other() -> None:
    """On the east wall: set out with the building on the left, that is towards the east, and it is the first corner."""
    found = laps(HOUSE, (), START, Window((10.0, 5.0), (1.0, 0.0)), C)
    # 7 m east and 14 m north, past the circle about the south-east corner
    corner = math.hypot(5.0, 9.0)
    straight = math.sqrt(corner**2 - C**2)
    arc = C * (math.pi / 2 - math.atan2(9.0, 5.0) + math.asin(C / corner))
    assert found.counterclockwise_m == pytest.approx(straight + arc + 5.0, rel=0.02)
    assert found.clockwise_m == pytest.approx(straight + arc + 10.0 + C * math.pi + 10.0 + 5.0, rel=0.02)


def test_a_window_in_view_from_the_start_needs_no_lap() -> None:
    assert laps(HOUSE, (), START, Window((5.0, 0.0), (0.0, -1.0)), C) == Laps(7.0, 7.0)


def test_a_neighbour_that_touches_closes_one_side() -> None:
    beside = ((10.0, 0.0), (60.0, 0.0), (60.0, 10.0), (10.0, 10.0))
    far = ((10.5, -90.0), (11.0, -90.0), (11.0, 90.0), (10.5, 90.0))
    found = laps(HOUSE, (beside, far), START, Window((0.0, 5.0), (-1.0, 0.0)), C)
    assert math.isinf(found.counterclockwise_m)
    assert found.clockwise_m == pytest.approx(laps(HOUSE, (), START, Window((0.0, 5.0), (-1.0, 0.0)), C).clockwise_m)


def test_the_worth_is_the_mean_of_both_sides_and_of_one_where_the_other_is_closed() -> None:
    assert worth_of(Laps(40.0, 20.0), 20.0) == pytest.approx((0.5 + 1.0) / 2)
    assert worth_of(Laps(math.inf, 25.0), 20.0) == pytest.approx(0.8)
    assert worth_of(Laps(10.0, 10.0), 20.0) == 1.0
    assert worth_of(Laps(math.inf, math.inf), 20.0) == 0.0


def test_a_set_of_tasks_has_their_mean_and_none_has_none() -> None:
    near, far = a_task("near", facade=0), a_task("far", facade=2)
    assert laps_of(near.scene).clockwise_m == pytest.approx(7.0, abs=0.2)
    assert laps_of(far.scene).clockwise_m > 30.0
    assert ideal_lap_spl([near, far]) == pytest.approx((ideal_worth(near) + ideal_worth(far)) / 2)
    assert ideal_lap_spl([]) is None
