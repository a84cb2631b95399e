"""The pinhole and the frames, by hand and against an analytic plane."""

import math

import numpy as np
import pytest

from navigation.camera import (
    DepthView,
    Pose,
    bearing_deg,
    column_slopes,
    direction,
    move_pose,
    pinhole,
    pixel_place,
    planar_to_distance_m,
    row_slopes,
    wrap_radians,
)
from navigation.point_cloud import cloud, nearby_cloud, nearest_of_blocks, to_enu
from tests.navigation.raycast_world import Prism, World, rectangle


def test_the_focal_length_at_90_degrees_is_half_the_width() -> None:
    assert pinhole(800, 800, 90.0).fx_px == 400.0
    assert pinhole(800, 600, 60.0).fx_px == pytest.approx(400.0 / math.tan(math.radians(30.0)))
    wide = pinhole(1280, 720, 120.0, 30.0)
    assert (wide.left_deg, wide.right_deg) == (pytest.approx(-30.0), pytest.approx(90.0))
    assert wide.up_slope == wide.down_slope == pytest.approx(720 / 1280 * math.tan(math.radians(60.0)))


@pytest.mark.parametrize("bad", [(0, 10, 90.0), (10, 0, 90.0), (10, 10, 0.0), (10, 10, 180.0), (10, 10, math.nan)])
def test_an_impossible_camera_is_refused(bad: tuple[int, int, float]) -> None:
    with pytest.raises(ValueError, match=r"pixel|field of view"):
        pinhole(*bad)


def test_pixel_centres_lie_at_half_pixels_about_the_axis() -> None:
    slopes = column_slopes(pinhole(4, 4, 90.0))
    np.testing.assert_allclose(slopes, [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(row_slopes(pinhole(4, 4, 90.0)), [0.75, 0.25, -0.25, -0.75])


def test_bearings_of_the_five_points_are_those_of_the_pinhole() -> None:
    camera = pinhole(600, 600, 90.0)
    bearings = [bearing_deg(camera, 100.0 * k) for k in range(1, 6)]
    expected = [math.degrees(math.atan(x)) for x in (-2 / 3, -1 / 3, 0.0, 1 / 3, 2 / 3)]
    np.testing.assert_allclose(bearings, expected, atol=1e-12)


def test_planar_depth_becomes_distance_by_one_over_the_cosine() -> None:
    assert planar_to_distance_m(10.0, 45.0) == pytest.approx(10.0 * math.sqrt(2))
    assert planar_to_distance_m(10.0, 0.0) == 10.0


def test_headings_turn_to_the_right_and_yaw_to_the_left() -> None:
    np.testing.assert_allclose(direction(0.0, 90.0), (0.0, -1.0), atol=1e-12)  # facing east, right is south
    np.testing.assert_allclose(direction(math.pi / 2, 90.0), (1.0, 0.0), atol=1e-12)  # facing north, right is east


@pytest.mark.parametrize("heading", [-90, -45, 0, 45, 90])
@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_every_pixel_of_an_analytic_plane_lands_on_the_plane(heading: int, yaw: float) -> None:
    """Depth of the plane n.p = 12 computed pixel by pixel from its equation, then turned back into points."""
    camera, pose = pinhole(40, 30, 90.0, heading), Pose(3.0, -2.0, 7.0, yaw)
    forward = np.array((*direction(yaw, heading), 0.0))
    right = np.array((forward[1], -forward[0], 0.0))
    normal = np.array((*direction(yaw, heading + 20.0), 0.3))
    eye = np.array(pose[:3])
    depth = np.empty((camera.height, camera.width), np.float32)
    for row in range(camera.height):
        for column in range(camera.width):
            ray = forward + (column + 0.5 - 20) / 20 * right + np.array((0, 0, (15 - row - 0.5) / 20))
            depth[row, column] = 12.0 / (normal @ ray)
    points = to_enu(cloud(DepthView(camera, depth)), pose)
    assert len(points) == camera.width * camera.height
    np.testing.assert_allclose((points - eye) @ normal, 12.0, rtol=1e-4)
    place = pixel_place(camera, 10.5, 4.5, float(depth[4, 10]), pose)
    np.testing.assert_allclose((np.array(place) - eye) @ normal, 12.0, rtol=1e-5)


def test_a_pixel_lands_on_the_wall_it_looks_at() -> None:
    world = World([Prism(rectangle(0.0, 10.0, 6.0, 4.0), 0.0, 9.0)])  # its near wall is y = 8
    pose, camera = Pose(1.0, 0.0, 5.0, math.pi / 2), pinhole(80, 80, 90.0)
    depth = world.depth(pose, camera)
    assert depth[40, 40] == pytest.approx(8.0)
    place = pixel_place(camera, 30.5, 20.5, float(depth[20, 30]), pose)
    assert place.y == pytest.approx(8.0)
    assert place.x == pytest.approx(1.0 - 9.5 / 40 * 8.0)
    assert place.z == pytest.approx(5.0 + 19.5 / 40 * 8.0)


def test_no_return_and_invalid_pixels_are_no_points() -> None:
    depth = np.full((4, 4), np.inf, np.float32)
    depth[0, 0], depth[1, 1], depth[2, 2] = np.nan, 5.0, 30.0
    view = DepthView(pinhole(4, 4, 90.0), depth)
    assert len(cloud(view)) == 2
    assert len(nearby_cloud((view,), 10.0, 100.0)) == 1
    assert nearby_cloud((), 10.0, 1.0).shape == (0, 3)


def test_nearby_points_are_cut_by_height() -> None:
    view = DepthView(pinhole(8, 8, 90.0), np.full((8, 8), 4.0, np.float32))
    heights = nearby_cloud((view,), 10.0, 1.0)[:, 2]
    assert len(heights) == 16  # slopes of +-0.125 only; +-0.375 would be 1.5 m
    assert np.abs(heights).max() == pytest.approx(0.5)


def test_thinning_keeps_the_nearest_pixel_of_each_block() -> None:
    depth = np.full((6, 5), 9.0, np.float32)
    depth[2, 3], depth[5, 4], depth[0, 0] = 2.0, 1.0, np.nan
    kept = nearest_of_blocks(DepthView(pinhole(5, 6, 90.0), depth), 4)
    assert kept[2, 3]
    assert kept[5, 4]
    assert not kept[0, 0]
    assert kept.sum() == 4


def test_a_move_faces_where_it_went() -> None:
    moved = move_pose(Pose(1.0, 2.0, 3.0, math.pi / 2), -90.0, 4.0)  # facing north, to the left: west
    np.testing.assert_allclose(moved, (-3.0, 2.0, 3.0, math.pi), atol=1e-12)


def test_angles_wrap_into_one_turn() -> None:
    assert wrap_radians(3 * math.pi) == pytest.approx(math.pi)
    assert wrap_radians(-math.pi) == pytest.approx(math.pi)
    assert wrap_radians(math.tau + 0.25) == pytest.approx(0.25)
