"""What depth says of the space before a camera: returns, no return, and what nobody knows."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navigation.camera import DepthView, Pose, pinhole
from navigation.sensing import (
    FREE,
    HIDDEN,
    UNKNOWN,
    UNSEEN,
    known_share,
    looked_at,
    open_upwards,
    read_units,
    read_views,
    shown_reach_m,
)

SIZE = 80
HERE = Pose(0.0, 0.0, 5.0, 0.0)


def _street(heading_deg: float = 0.0) -> DepthView:
    """A stereo camera's picture: invalid above the horizon in its left half, a wall 8 m away in its right half."""
    depth = np.full((SIZE, SIZE), np.nan, np.float32)
    depth[:, SIZE // 2 :] = 8.0
    depth[SIZE // 2 + 10 :, : SIZE // 2] = 12.0
    return DepthView(pinhole(SIZE, SIZE, 90.0, heading_deg), depth)


def test_an_invalid_sky_is_free_as_far_as_the_farthest_returns() -> None:
    (view,) = read_views([_street()])
    assert np.isinf(view.depth_m[: SIZE // 2, : SIZE // 2]).all()
    assert view.reach_m == pytest.approx(12.0)
    near, far = looked_at(np.array([[11.0, 4.0, 5.0], [13.0, 4.0, 5.0]]), [view], HERE)
    assert (near, far) == (FREE, UNKNOWN)


def test_the_reach_that_was_shown_before_counts_over_what_ends_unevenly() -> None:
    uneven = _street()
    uneven.depth_m[SIZE // 2 :, : SIZE // 4] = 8.0
    assert [view.reach_m for view in read_views([uneven], shown_m=30.0)] == [30.0]
    assert [view.reach_m for view in read_views([_street()], shown_m=30.0)] == [12.0]


def test_a_sensor_that_tells_no_return_from_invalid_is_taken_at_its_word() -> None:
    said = _street()
    said.depth_m[: SIZE // 2 - 10, : SIZE // 2] = np.inf
    (view,) = read_views([said])
    assert np.isnan(view.depth_m[SIZE // 2 - 10 : SIZE // 2, : SIZE // 2]).all()


def test_a_few_returns_too_far_for_its_unit_do_not_make_a_stereo_camera_one_that_tells_no_return() -> None:
    street = _street()
    street.depth_m[SIZE // 2 + 9, : SIZE // 2] = np.inf
    (view,) = read_views([street])
    assert np.isinf(view.depth_m[: SIZE // 2, : SIZE // 2]).all()


def test_a_picture_without_returns_stays_unknown_beside_one_that_has_some() -> None:
    dead = DepthView(pinhole(SIZE, SIZE, 90.0, -90.0), np.full((SIZE, SIZE), np.nan, np.float32))
    unknown, street = read_views([dead, _street()])
    assert np.isnan(unknown.depth_m).all()
    assert known_share([unknown, street]) == 0.5
    aside = np.array([[0.0, 5.0, 5.0], [-5.0, 0.0, 5.0]])
    assert looked_at(aside, [unknown], HERE).tolist() == [UNKNOWN, UNSEEN]


@pytest.mark.parametrize("hole", [np.s_[20:30, 50:70], np.s_[60:80, 0:40], np.s_[:, 60:64]], ids=str)
def test_holes_amid_returns_and_stripes_are_unknown(hole: tuple[slice, slice]) -> None:
    """A window pane, the lower part of a picture that was not sent, a stripe."""
    street = _street()
    street.depth_m[hole] = np.nan
    (view,) = read_views([street])
    assert np.isnan(view.depth_m[hole]).all()


def test_one_invalid_pixel_is_as_its_neighbours_are() -> None:
    street = _street()
    street.depth_m[40, 60] = np.nan
    (view,) = read_views([street])
    x, y = 60.5 - SIZE / 2, SIZE / 2 - 40.5
    through = np.array([[d, -x / (SIZE / 2) * d, 5.0 + y / (SIZE / 2) * d] for d in (7.5, 8.5)])
    assert looked_at(through, [view], HERE).tolist() == [FREE, HIDDEN]


def test_ghosts_in_an_invalid_sky_are_no_returns_and_a_pole_is_one() -> None:
    street = _street()
    street.depth_m[8:12, 8:12] = 2.0  # a mismatch of a few pixels
    street.depth_m[0:60, 20:22] = 5.0  # a pole
    street.depth_m[0, 70] = 0.01  # nearer than anything that is measured
    (view,) = read_views([street])
    assert not (view.depth_m == 2.0).any()
    assert (view.depth_m[0:50, 20:22] == 5.0).all()
    assert np.isnan(view.depth_m[0, 70])


def test_an_echo_of_a_drop_is_no_return_and_a_wire_is_one() -> None:
    street = _street()
    street.depth_m[:, SIZE // 2 :] = 2.4
    street.depth_m[60, 50] = 1.8  # a drop that is less before the wall than a mismatch in the air would be
    street.depth_m[70, 40:80] = 1.9  # a wire of one pixel's width
    (view,) = read_views([street])
    assert np.isnan(view.depth_m[60, 50])
    assert (view.depth_m[70, 40:80] == 1.9).all()


def test_a_lone_pixel_that_is_as_wide_as_a_thing_is_one() -> None:
    street = _street()
    street.depth_m[60, 50] = 7.0
    (view,) = read_views([street])
    assert view.depth_m[60, 50] == 7.0


def test_depth_on_the_wire_is_read_by_the_same_rule() -> None:
    street = _street()
    units = np.nan_to_num(street.depth_m / 0.002, nan=0.0).astype(np.uint16)
    (read,) = read_units([units])
    assert np.array_equal(read == 65535, open_upwards(np.isnan(street.depth_m)))
    assert read_units([read, read])[0] is read


def test_beyond_the_range_that_is_asked_for_nothing_returns() -> None:
    view = DepthView(pinhole(4, 4, 90.0), np.full((4, 4), 30.0, np.float32))
    (read,) = read_views([view], 20.0)
    assert np.isinf(read.depth_m).all()
    assert read.reach_m == 20.0
    assert shown_reach_m([view]) == 30.0
    assert shown_reach_m([read]) == 0.0


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.sampled_from([0.0, 0.05, 3.0, 9.0, 40.0, math.inf, math.nan]), min_size=36, max_size=36),
    st.floats(0.1, 80.0),
)
def test_returns_are_never_read_as_free(values: list[float], sensor_range_m: float) -> None:
    depth = np.repeat(np.repeat(np.array(values, np.float32).reshape(6, 6), 6, 0), 6, 1)
    view = DepthView(pinhole(36, 36, 90.0), depth)
    (read,) = read_views([view], sensor_range_m)
    near = np.isfinite(depth) & (depth <= sensor_range_m) & (depth >= 0.2)
    assert np.array_equal(read.depth_m[near], depth[near])
    assert not (np.isfinite(read.depth_m) & ~np.isfinite(depth)).any()


def _cut_frame(wall_m: float) -> DepthView:
    """A low drone's picture without its upper part: ground below the cut, a wall's foot in the middle."""
    depth = np.full((SIZE, SIZE), np.nan, np.float32)
    rows = np.arange(SIZE // 2 + 7, SIZE)
    ground = 1.0 * (SIZE / 2) / (rows + 0.5 - SIZE / 2)
    depth[rows] = ground[:, None]
    depth[rows, 10:70] = np.minimum(ground, wall_m)[:, None]
    return DepthView(pinhole(SIZE, SIZE, 90.0), depth)


def test_above_a_cut_through_things_at_different_distances_nothing_is_free() -> None:
    (view,) = read_views([_cut_frame(4.0)])
    assert np.isnan(view.depth_m[: SIZE // 2]).all()


def test_one_wall_in_a_moment_shows_that_all_its_frames_are_cut_alike() -> None:
    wall, ground = read_views([_cut_frame(4.0), _cut_frame(np.inf)])
    assert np.isnan(wall.depth_m[: SIZE // 2]).all()
    assert np.isnan(ground.depth_m[: SIZE // 2]).all()


def test_over_the_few_columns_of_a_level_line_that_are_nearer_nothing_is_free() -> None:
    level = _cut_frame(np.inf)
    edge = SIZE // 2 + 7
    level.depth_m[edge:, 20:22] = np.minimum(level.depth_m[edge:, 20:22], 3.0)
    (view,) = read_views([level])
    assert np.isnan(view.depth_m[: SIZE // 2, 19:23]).all()
    assert np.isinf(view.depth_m[: SIZE // 2, 25:]).all()
    assert view.reach_m == pytest.approx(level.depth_m[edge, 0])


def test_the_sky_over_level_ground_stays_free() -> None:
    (view,) = read_views([_cut_frame(np.inf)])
    assert np.isinf(view.depth_m[: SIZE // 2]).all()


def test_a_cut_is_seen_in_units_of_the_wire_as_well() -> None:
    depth = _cut_frame(4.0).depth_m
    units = np.nan_to_num(depth / 0.005, nan=0.0).astype(np.uint16)
    (read,) = read_units([units])
    assert (read[: SIZE // 2] == 0).all()
