"""The pinhole and the frames, by hand and against an analytic plane."""

import math

import numpy as np
import pytest

from navigation.camera import (
    Camera,
    DepthView,
    Pose,
    bearing_deg,
    column_slopes,
    direction,
    fewest,
    move_pose,
    pinhole,
    pixel_place,
    pixels_of,
    planar_to_distance_m,
    row_slopes,
    seen_aside_deg,
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


ODD = Camera(120, 80, 70.0, 65.0, 55.0, 47.0, heading_deg=35.0, pitch_deg=-20.0, forward_m=0.3, right_m=-0.2, up_m=0.1)


@pytest.mark.parametrize("camera", [ODD, ODD._replace(pitch_deg=90.0, heading_deg=0.0), ODD._replace(pitch_deg=0.0)])
def test_a_place_is_seen_in_the_pixel_whose_place_it_is_whatever_the_lens_and_the_mounting(camera: Camera) -> None:
    pose = Pose(3.0, -2.0, 7.0, 2.2)
    place = pixel_place(camera, 100.5, 12.5, 9.0, pose)
    seen = pixels_of(camera, pose, np.array([place]))
    assert (seen.x_px[0], seen.y_px[0], seen.depth_m[0]) == pytest.approx((100.5, 12.5, 9.0))
    depth = np.full((80, 120), np.inf, np.float32)
    depth[12, 100] = 9.0
    np.testing.assert_allclose(to_enu(cloud(DepthView(camera, depth)), pose), [place], atol=1e-4)


def test_what_hangs_over_the_drone_is_near_for_a_camera_that_looks_up() -> None:
    up = pinhole(40, 40, 90.0)._replace(pitch_deg=90.0)
    slab = DepthView(up, np.full((40, 40), 1.2, np.float32))
    points = nearby_cloud((slab,), 10.0, 1.85)
    assert len(points) == 1600
    np.testing.assert_allclose(points[:, 2], 1.2, atol=1e-5)
    assert not len(nearby_cloud((slab,), 10.0, 1.0))


def test_of_five_cameras_three_see_all_that_the_five_see() -> None:
    five = [pinhole(80, 80, 90.0, heading) for heading in (-90.0, -45.0, 0.0, 45.0, 90.0)]
    up = pinhole(80, 80, 90.0)._replace(pitch_deg=90.0)
    assert [camera.heading_deg for camera in fewest([*five, up])] == [-90.0, 0.0, 90.0]
    assert seen_aside_deg([*five, up]) == pytest.approx(135.0)
    assert seen_aside_deg([five[0], five[-1]]) == pytest.approx(0.0, abs=1e-9)
    assert seen_aside_deg([five[0], five[2]]) == pytest.approx(45.0)


def test_a_place_all_but_exactly_aside_lies_in_no_picture() -> None:
    camera = pinhole(48, 48, 90.0)
    seen = pixels_of(camera, Pose(0.0, 0.0, 1.0, 2.2250738585072014e-308), np.array([[0.0, 1.35, 2.75]]))
    assert seen.depth_m[0] > 0.0
    assert not 0.0 <= seen.x_px[0] < camera.width
