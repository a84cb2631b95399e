"""Eq. 3 by hand: bands, decisions, both readings."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navigation.floor_localization import (
    Band,
    Climb,
    FinalHeight,
    FloorNotFound,
    Recount,
    VerticalView,
    WindowRows,
    across_edge,
    band,
    band_span_m,
    corrected,
    decide,
    direct_count,
    down_to_ground,
    row_height_m,
)
from tests.navigation import usual

UPPER = usual.FLOOR_LOCALIZATION
SQUARE = VerticalView(1.0, 1.0)
CAMERA = UPPER._replace(reading="camera_height")


def test_a_band_is_what_the_camera_sees_at_its_stand_off() -> None:
    assert band_span_m(10.0, SQUARE) == pytest.approx(20.0)
    assert band_span_m(9.0, VerticalView(1 / math.sqrt(3), 1 / math.sqrt(3))) == pytest.approx(18.0 / math.sqrt(3))


def test_bands_touch_and_the_camera_stands_in_their_middle() -> None:
    assert band(1, 18.0) == Band(1, 0.0, 18.0, 9.0)
    assert band(3, 18.0) == Band(3, 36.0, 54.0, 45.0)


def test_a_camera_that_sees_farther_up_than_down_stands_low_in_its_band() -> None:
    view = VerticalView(1.5, 0.5)
    here = band(1, band_span_m(10.0, view), view.camera_at)
    assert here == Band(1, 0.0, 20.0, 5.0)
    climb = decide(here, 0, 4, 9, None, UPPER)
    assert isinstance(climb, Climb)
    assert climb.band == Band(2, 20.0, 40.0, 25.0)
    assert [row_height_m(row, 5.0, 10.0, view) for row in (0.0, 0.75, 1.0)] == [20.0, 5.0, 0.0]


@pytest.mark.parametrize("bad", [(0.0, 1.0), (-3.0, 1.0), (math.nan, 1.0), (5.0, 0.0), (5.0, -0.2)])
def test_an_impossible_band_is_refused(bad: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="no band"):
        band_span_m(bad[0], VerticalView(bad[1], bad[1]))


def test_eq3_by_hand_in_the_first_band() -> None:
    """18 m, 6 floors of 3 m; the fourth ends at 18 - 3 x (6 - 4) = 12 m and its window is at 10.5 m."""
    assert decide(band(1, 18.0), 0, 6, 4, None, UPPER) == FinalHeight(10.5, 3.0, 6)


def test_eq3_by_hand_in_the_second_band() -> None:
    """Band 18..36 m with 6 more floors; the eighth ends at 36 - 3 x (12 - 8) = 24 m."""
    assert decide(band(2, 18.0), 6, 6, 8, None, UPPER) == FinalHeight(22.5, 3.0, 12)


def test_the_topmost_counted_floor_is_found_without_another_band() -> None:
    assert decide(band(1, 18.0), 0, 6, 6, None, UPPER) == FinalHeight(16.5, 3.0, 6)


def test_too_few_floors_climb_to_the_next_band() -> None:
    assert decide(band(1, 18.0), 0, 6, 7, None, UPPER) == Climb(band(2, 18.0), 6)


def test_a_roof_in_the_band_takes_the_place_of_its_upper_edge() -> None:
    """Four floors up to a roof at 12 m inside a band of 20 m: 3 m a floor, not 5."""
    assert decide(band(1, 20.0), 0, 4, 2, 12.0, UPPER) == FinalHeight(4.5, 3.0, 4)
    stretched = decide(band(1, 20.0), 0, 4, 2, None, UPPER)
    assert isinstance(stretched, FinalHeight)
    assert stretched.floor_height_m == 5.0


def test_a_roof_above_the_band_changes_nothing() -> None:
    assert decide(band(1, 18.0), 0, 6, 4, 40.0, UPPER) == FinalHeight(10.5, 3.0, 6)


def test_no_new_floors_climb_and_never_divide() -> None:
    assert decide(band(1, 18.0), 0, 0, 1, None, UPPER) == Climb(band(2, 18.0), 0)
    assert decide(band(2, 18.0), 6, 0, 6, 50.0, UPPER) == Climb(band(3, 18.0), 6)


def test_the_building_ending_below_the_wanted_floor_is_an_outcome_with_a_best_guess() -> None:
    assert decide(band(1, 18.0), 0, 4, 7, 12.0, UPPER) == FloorNotFound(4, 12.0, 10.5)
    assert decide(band(2, 18.0), 6, 0, 7, 18.0, UPPER) == FloorNotFound(6, 18.0, 16.5)
    assert decide(band(1, 18.0), 0, 0, 1, 0.0, UPPER) == FloorNotFound(0, 0.0, None)


def test_floors_counted_where_depth_shows_no_wall_are_believed() -> None:
    assert decide(band(2, 18.0), 6, 6, 8, 18.0, UPPER) == FinalHeight(22.5, 3.0, 12)


def test_no_readable_count_is_not_a_count_of_zero() -> None:
    assert decide(band(2, 18.0), 6, None, 8, None, UPPER) == Recount(band(2, 18.0), 6)


def test_nothing_is_flown_to_below_the_lowest_height() -> None:
    decision = decide(band(1, 1.2), 0, 1, 1, None, UPPER)
    assert isinstance(decision, FinalHeight)
    assert decision.height_m == 1.0


@pytest.mark.parametrize(("before", "new", "target"), [(0, 3, 0), (0, -1, 2), (-1, 2, 1)])
def test_impossible_counts_are_refused(before: float, new: float, target: int) -> None:
    with pytest.raises(ValueError, match="floors"):
        decide(band(1, 18.0), before, new, target, None, UPPER)


def test_the_camera_height_reading_lands_eight_and_a_half_metres_low_at_ten_metres() -> None:
    """Stand-off 10 m, 20 m band, camera at 10 m, floors of 20 / 7 m, the seventh wanted: 10 m against 18.57 m."""
    literal = decide(band(1, 20.0), 0, 7, 7, None, CAMERA)
    right = decide(band(1, 20.0), 0, 7, 7, None, UPPER)
    assert isinstance(literal, FinalHeight)
    assert isinstance(right, FinalHeight)
    assert literal.height_m == 10.0
    assert right.height_m - literal.height_m == pytest.approx(8.57, abs=0.01)


def test_the_camera_height_reading_by_hand_in_the_second_band() -> None:
    """Cameras at 10 and 30 m: floors of (30 - 10) / 5 = 4 m; the eighth of ten is at 30 - 4 x 2 = 22 m."""
    assert decide(band(2, 20.0), 5, 5, 8, None, CAMERA) == FinalHeight(22.0, 4.0, 10)


@given(st.floats(2.4, 5.0), st.integers(1, 40), st.data(), st.floats(5.0, 12.0), st.booleans())
def test_with_exact_counts_the_height_error_is_zero(
    floor_m: float, floors: int, data: st.DataObject, stand_off: float, roof_in_sight: bool
) -> None:
    """Exact: the share of a floor that a band's edge cuts off counts as that share."""
    target = data.draw(st.integers(1, floors))
    roof = floor_m * floors
    here, counted = band(1, band_span_m(stand_off, SQUARE)), 0.0
    for _ in range(60):
        top_in_sight = roof if roof_in_sight or here.upper_m >= roof else None
        exact = (min(here.upper_m, roof) - here.lower_m) / floor_m
        decision = decide(here, counted, exact, target, top_in_sight, UPPER)
        if isinstance(decision, FinalHeight):
            assert decision.height_m == pytest.approx(max(1.0, (target - 0.5) * floor_m), abs=1e-6)
            return
        assert isinstance(decision, Climb)
        here, counted = decision.band, decision.floors_counted
    raise AssertionError("the floor was never found")


@given(st.floats(2.4, 5.0), st.integers(1, 40), st.data(), st.floats(6.0, 12.0))
def test_with_whole_counts_by_the_middle_rule_the_error_stays_within_half_a_floor(
    floor_m: float, floors: int, data: st.DataObject, stand_off: float
) -> None:
    """A floor counts in the band that its middle lies in, so each is counted once and bands are off by half at most."""
    target = data.draw(st.integers(1, floors))
    here, counted = band(1, band_span_m(stand_off, SQUARE)), 0.0
    for _ in range(60):
        middles = [(k + 0.5) * floor_m for k in range(floors)]
        new = sum(here.lower_m <= m < here.upper_m for m in middles)
        roof = floor_m * floors
        decision = decide(here, counted, new, target, roof if here.upper_m >= roof else None, UPPER)
        if isinstance(decision, FinalHeight):
            assert abs(decision.height_m - (target - 0.5) * floor_m) <= 0.5 * floor_m + 1e-6
            return
        if isinstance(decision, FloorNotFound):
            raise AssertionError(decision)
        assert isinstance(decision, Climb)
        here, counted = decision.band, decision.floors_counted
    raise AssertionError("the floor was never found")


def test_direct_count_divides_the_buildings_height() -> None:
    assert direct_count(6, 18.0, 4, UPPER) == FinalHeight(10.5, 3.0, 6)
    assert direct_count(4, 18.0, 4, UPPER) == FinalHeight(15.75, 4.5, 4)


def test_direct_count_has_the_same_outcomes() -> None:
    assert direct_count(None, 18.0, 4, UPPER) is None
    assert direct_count(0, 18.0, 4, UPPER) == FloorNotFound(0.0, 18.0, None)
    assert direct_count(3, 18.0, 4, UPPER) == FloorNotFound(3, 18.0, 15.0)
    with pytest.raises(ValueError, match="no floor 1"):
        direct_count(3, 0.0, 1, UPPER)


def test_rows_become_heights_on_an_upright_facade() -> None:
    assert row_height_m(0.5, 9.0, 9.0, SQUARE) == 9.0
    assert row_height_m(0.0, 9.0, 9.0, SQUARE) == pytest.approx(18.0)
    assert row_height_m(0.75, 9.0, 8.0, SQUARE) == pytest.approx(5.0)


def test_a_gable_over_the_topmost_floor_does_not_lift_the_height_above_its_windows() -> None:
    """Three floors of 3 m under a gable that ends at 12.5 m: eq. 3 says 10.4 m, the windows are seen at 7.5 m."""
    final = decide(band(1, 18.0), 0, 3, 3, 12.5, UPPER)
    assert isinstance(final, FinalHeight)
    assert final.height_m == pytest.approx(10.417, abs=0.001)
    rows = tuple(0.5 + (9.0 - z) / 18.0 for z in (7.5, 4.5, 1.5))
    held = corrected(final, 3, WindowRows(rows, 9.0, 9.0, SQUARE), UPPER)
    assert held == FinalHeight(pytest.approx(7.5), pytest.approx(3.0), 3)


def test_a_low_house_under_a_sky_that_the_sensor_does_not_tell_from_wall_is_as_high_as_its_rows_say() -> None:
    """Three floors of 3 m in a band of 19.6 m whose top is not known: eq. 3 says 16.3 m."""
    final = decide(band(1, 19.6), 0, 3, 3, None, UPPER)
    assert isinstance(final, FinalHeight)
    assert final.height_m == pytest.approx(16.33, abs=0.01)
    rows = tuple(0.5 + (9.8 - z) / 19.6 for z in (7.5, 4.5, 1.5))
    assert corrected(final, 3, WindowRows(rows, 9.8, 9.8, SQUARE), UPPER).height_m == pytest.approx(7.5)
    crowded = WindowRows((0.44, 0.47, 0.5), 0.0, 9.8, SQUARE)
    assert corrected(final, 3, crowded, UPPER) == final
    lifted = WindowRows(tuple(row - 0.2 for row in rows), 9.8, 9.8, SQUARE)
    lower = FinalHeight(2.0, 6.5, 3)
    assert corrected(lower, 3, lifted, UPPER) == lower


@pytest.mark.parametrize(
    ("rows", "target"),
    [((0.3, 0.45, 0.6), 5), ((0.4,), 3), ((), 3), ((0.60, 0.76, 0.91), 3), ((0.10, 0.26, 0.41), 3)],
    ids=["floor not in the picture", "one row", "no rows", "rows that agree", "rows floors away"],
)
def test_rows_that_tell_nothing_new_leave_eq3_alone(rows: tuple[float, ...], target: int) -> None:
    final = FinalHeight(7.4, 3.0, 3)
    assert corrected(final, target, WindowRows(rows, 9.0, 9.0, SQUARE), UPPER) == final


def test_the_literal_reading_is_never_corrected() -> None:
    final = FinalHeight(12.0, 3.0, 3)
    assert corrected(final, 3, WindowRows((0.3, 0.5, 0.7), 9.0, 9.0, SQUARE), CAMERA) == final


WINDOWS_OF_3_M = [1.6 + 3.0 * k for k in range(12)]
"""The middles of twelve floors' windows; the sixth lies at 16.6 m."""


def rows_seen(stand_off_m: float, number: int, middles: list[float] = WINDOWS_OF_3_M, slack: float = 0.0) -> WindowRows:
    """What a camera in the middle of band `number` sees of them; `slack` widens the picture by that share."""
    camera_m = band(number, 2 * stand_off_m).camera_m
    rows = sorted(0.5 - (z - camera_m) / stand_off_m / 2 for z in middles)
    inside = tuple(min(1.0, max(0.0, row)) for row in rows if -slack <= row <= 1.0 + slack)
    return WindowRows(inside, camera_m, stand_off_m, SQUARE)


@pytest.mark.parametrize(("slack", "new_rows"), [(1e-6, 6), (-1e-6, 5)], ids=["in both pictures", "in neither"])
def test_a_window_row_on_the_edge_between_two_bands_is_one_floor(slack: float, new_rows: int) -> None:
    """Bands of 16.6 m: the sixth floor's windows lie on the edge; up to the second band's end it is eleven floors."""
    first, second = rows_seen(8.3, 1, slack=slack), rows_seen(8.3, 2, slack=slack)
    assert len(first.rows) == (6 if slack > 0 else 5)
    assert len(second.rows) == new_rows
    told_apart = across_edge(second, first, 16.6)
    assert len(first.rows) + len(told_apart) == 11
    heights = [second._replace(rows=told_apart).height_m(at) for at in range(len(told_apart))]
    assert heights == pytest.approx(WINDOWS_OF_3_M[10 : 10 - len(told_apart) : -1], abs=0.01)


@given(stand_off_m=st.floats(6.0, 12.0), floor_m=st.floats(2.6, 4.5), hidden=st.integers(0, 2))
def test_floors_that_an_eave_hides_are_counted_down_to_the_ground(
    stand_off_m: float, floor_m: float, hidden: int
) -> None:
    middles = [0.5 * floor_m + floor_m * k for k in range(30)]
    whole = rows_seen(stand_off_m, 1, middles, 0.0)
    left = whole.rows[: len(whole.rows) - hidden]
    counted = down_to_ground(whole._replace(rows=left))
    assert counted[: len(left)] == left
    assert len(counted) == (len(whole.rows) if len(left) >= 2 else len(left))


def test_a_tall_ground_floor_hides_none_beneath() -> None:
    shop = rows_seen(9.0, 1, [2.6, 6.4, 9.4, 12.4, 15.4], 0.0)
    assert down_to_ground(shop) == shop.rows


@given(stand_off_m=st.floats(5.0, 12.0), floor_m=st.floats(2.6, 4.5))
def test_every_floor_is_counted_once_wherever_the_bands_touch(stand_off_m: float, floor_m: float) -> None:
    middles = [0.5 * floor_m + floor_m * k for k in range(30)]
    for slack in (-1e-6, 1e-6):
        first, second = (rows_seen(stand_off_m, number, middles, slack) for number in (1, 2))
        both = len(first.rows) + len(across_edge(second, first, 2 * stand_off_m))
        assert both == sum(z < 4 * stand_off_m * (1 + slack) for z in middles)


@pytest.mark.parametrize(
    ("rows", "below"),
    [((0.1, 0.3, 0.5, 0.7, 0.9), (0.1, 0.3, 0.5)), ((), (0.0,)), ((1.0,), (0.0,)), ((0.5, 0.7, 0.8), ())],
    ids=["a floor apart", "nothing new", "too few to tell a floor's height", "nothing below"],
)
def test_rows_that_are_floors_of_their_own_stay_as_they_are(rows: tuple[float, ...], below: tuple[float, ...]) -> None:
    here, before = WindowRows(rows, 24.9, 8.3, SQUARE), WindowRows(below, 8.3, 8.3, SQUARE)
    assert across_edge(here, before, 16.6) == rows


@pytest.mark.parametrize(
    ("rows", "one_wall"),
    [((), True), ((0.4,), True), ((0.3, 0.47, 0.63), True), ((0.54, 0.59, 0.74), False), ((0.73, 0.76), False)],
)
def test_rows_nearer_to_each_other_than_floors_can_be_are_not_of_one_wall(
    rows: tuple[float, ...], one_wall: bool
) -> None:
    assert WindowRows(rows, 9.0, 9.0, SQUARE).is_of_one_wall is one_wall
