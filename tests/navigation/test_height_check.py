"""One more count at the final height: which row is level with the camera, and which floor's it is."""

import pytest

from navigation.floor_localization import VerticalView, WindowRows
from navigation.height_check import check_height

VIEW = VerticalView(1.0, 1.0)


def seen(middles_m: tuple[float, ...], camera_m: float, stand_off_m: float = 10.0) -> WindowRows:
    """The picture of windows at these heights, topmost first, by a camera with a field of view of 90 degrees."""
    rows = tuple(0.5 - (z - camera_m) / (2.0 * stand_off_m) for z in middles_m)
    return WindowRows(rows, camera_m, stand_off_m, VIEW)


def test_the_row_before_the_camera_is_the_floor_that_the_rows_beneath_it_make_it() -> None:
    check = check_height(seen((10.5, 7.5, 4.5, 1.5), camera_m=7.4), floor=3, floor_height_m=3.0)
    assert (check.floor, check.confirms(3)) == (3, True)
    assert check.row_m == pytest.approx(7.5)


def test_another_floors_row_is_told_with_where_the_right_one_is() -> None:
    check = check_height(seen((10.5, 7.5, 4.5, 1.5), camera_m=7.4), floor=2, floor_height_m=3.0)
    assert (check.floor, check.confirms(2)) == (3, False)
    assert check.wanted_m == pytest.approx(4.5)


def test_a_ground_floor_that_a_hedge_hides_is_counted_all_the_same() -> None:
    check = check_height(seen((10.5, 7.5, 4.5), camera_m=7.5), floor=3, floor_height_m=3.0)
    assert (check.floor, check.confirms(3)) == (3, True)


def test_between_two_rows_nothing_is_confirmed() -> None:
    check = check_height(seen((10.5, 7.5, 4.5, 1.5), camera_m=9.0), floor=3, floor_height_m=3.0)
    assert (check.row_m, check.floor, check.confirms(3)) == (None, None, False)
    assert check.wanted_m == pytest.approx(7.5)


def test_a_little_above_the_picture_that_reaches_the_ground_the_distance_of_the_rows_tells_how_many_are_beneath() -> (
    None
):
    check = check_height(
        seen((19.5, 16.5, 13.5, 10.5, 7.5), camera_m=13.5, stand_off_m=8.0), floor=5, floor_height_m=3.0
    )
    assert (check.floor, check.confirms(5)) == (5, True)


def test_over_a_ground_floor_half_as_high_again_no_number_is_guessed() -> None:
    rows = seen((21.0, 18.0, 15.0, 12.0, 9.0), camera_m=15.0, stand_off_m=8.0)
    assert check_height(rows, floor=5, floor_height_m=3.0).floor is None


def test_of_a_wall_seen_from_aside_whose_lowest_row_is_out_of_the_picture_no_number_is_guessed() -> None:
    """vld-300-052: five of six floors in a picture that reaches the ground where it is square to the wall."""
    rows = WindowRows((0.2293, 0.3571, 0.5, 0.6607, 0.8429), 12.55, 11.9, VIEW)
    check = check_height(rows, floor=4, floor_height_m=3.0)
    assert (check.floor, check.wanted_m, check.confirms(4)) == (None, None, True)


def test_high_up_the_row_alone_is_confirmed_and_no_number() -> None:
    check = check_height(seen((52.5, 49.5, 46.5, 43.5), camera_m=46.4), floor=16, floor_height_m=3.0)
    assert (check.floor, check.wanted_m, check.confirms(16)) == (None, None, True)


def test_a_house_of_one_storey_is_confirmed_by_its_only_row() -> None:
    check = check_height(seen((1.6,), camera_m=1.5), floor=1, floor_height_m=3.0)
    assert (check.floor, check.confirms(1)) == (1, True)


def test_without_rows_nothing_is_said() -> None:
    assert not check_height(seen((), camera_m=1.5), floor=1, floor_height_m=3.0).confirms(1)
