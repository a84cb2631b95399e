"""The panorama: the nearest return in the band of heights, by bearing."""

import math

import numpy as np
import pytest

from navigation.camera import DepthView, Pose, pinhole
from navigation.explorer.scan import BINS, bin_bearings_deg, level_ranges_m, panorama
from tests.navigation.raycast_world import Prism, World, rectangle

HERE = Pose(0.0, 0.0, 8.0, math.pi / 2)
CAMERA = pinhole(180, 120, 90.0)


def _scan(prisms: list[Prism], pose: Pose = HERE, ground: bool = False):
    return panorama(list(World(prisms, ground=ground).views(pose, CAMERA).values()), pose, 0.5, 1.2)


def _towards(scan, bearing_deg: float) -> float:
    return float(scan.range_m[np.abs(bin_bearings_deg() - bearing_deg).argmin()])


def test_planar_depth_becomes_distance_over_the_whole_panorama() -> None:
    room = [Prism(rectangle(0, 10.5, 60, 1)), Prism(rectangle(10.5, 0, 1, 60)), Prism(rectangle(-10.5, 0, 1, 60))]
    scan = _scan(room)
    assert _towards(scan, 0.25) == pytest.approx(10.0, abs=0.05)
    assert _towards(scan, 90.25) == pytest.approx(10.0, abs=0.05)
    assert _towards(scan, -90.25) == pytest.approx(10.0, abs=0.05)
    assert _towards(scan, 44.25) == pytest.approx(10.0 / math.cos(math.radians(44.25)), abs=0.1)
    points = scan.points(scan.range_m)
    hit = np.isfinite(points).all(axis=1)
    assert np.all(np.abs(np.abs(points[hit]).max(axis=1) - 10.0) < 0.15)


def test_a_railing_in_the_band_hides_the_wall_and_a_slab_above_it_does_not() -> None:
    wall = Prism(rectangle(0, 10.5, 60, 1))
    railing = Prism(rectangle(0, 8.0, 4, 0.1), 7.0, 8.2)
    slab = Prism(rectangle(0, 8.0, 4, 0.5), 8.9, 9.1)
    assert _towards(_scan([wall, railing]), 0.25) == pytest.approx(7.95, abs=0.05)
    scan = _scan([wall, slab])
    assert _towards(scan, 0.25) == pytest.approx(10.0, abs=0.05)
    assert scan.body_m[BINS // 2] == pytest.approx(7.75, abs=0.05)


def test_the_ground_is_neither_wall_nor_obstacle_for_a_drone_that_flies_low() -> None:
    low = HERE._replace(z=1.2)
    scan = _scan([Prism(rectangle(0, 30.5, 60, 1))], low, ground=True)
    assert _towards(scan, 0.25) == pytest.approx(30.0, abs=0.1)
    assert np.nanmin(scan.body_m) > 20.0


def test_no_return_is_infinite_and_what_no_camera_saw_is_unknown() -> None:
    views = World([]).views(HERE, CAMERA)
    scan = panorama([views[0]], HERE, 0.5, 1.2)
    assert np.isinf(scan.range_m[BINS // 2])
    assert np.isnan(scan.range_m[0])
    blind = DepthView(pinhole(20, 20, 90.0), np.full((20, 20), np.nan, np.float32))
    assert np.isnan(panorama([blind], HERE, 0.5, 1.2).range_m).all()


def test_more_than_three_views_change_nothing_where_the_three_suffice() -> None:
    views = World([Prism(rectangle(3, 12, 9, 5))]).views(HERE, CAMERA)
    five = panorama(list(views.values()), HERE, 0.5, 1.2)
    three = panorama([views[h] for h in (-90, 0, 90)], HERE, 0.5, 1.2)
    assert np.array_equal(five.range_m, three.range_m)


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (7, 5)])
def test_tiny_pictures_are_read_as_well(shape: tuple[int, int]) -> None:
    depth = np.full(shape, 5.0, np.float32)
    views = [DepthView(pinhole(shape[1], shape[0], 90.0, heading), depth) for heading in (-90, 0, 90)]
    assert len(level_ranges_m(views[1], 0.5, 0.5)) == shape[1]
    assert len(panorama(views, HERE, 0.5, 1.2).range_m) == BINS


def test_three_wide_views_make_the_panorama_that_five_square_ones_make() -> None:
    world = World([Prism(rectangle(3, 12, 9, 5)), Prism(rectangle(-14, 2, 6, 6))])
    five = panorama(list(world.views(HERE, CAMERA).values()), HERE, 0.5, 1.2)
    wide = [world.view(HERE, pinhole(640, 360, 120.0, heading)) for heading in (-90.0, 0.0, 90.0)]
    three = panorama(wide, HERE, 0.5, 1.2)
    both = np.isfinite(five.range_m) & np.isfinite(three.range_m)
    assert (np.isfinite(five.range_m) == np.isfinite(three.range_m)).mean() > 0.98
    assert (np.abs(five.range_m[both] - three.range_m[both]) < 0.1).mean() > 0.97
    assert np.isinf(three.range_m).any()


def test_a_camera_before_the_drones_centre_gives_ranges_from_that_centre() -> None:
    """A wall 8 m ahead of the centre is 7.5 m ahead of a camera half a metre before it, and higher up the band ends
    sooner: a slab 1.1 m over the centre is 0.3 m over a camera that sits 0.8 m up."""
    world = World([Prism(rectangle(0, 9, 40, 2))])
    camera = pinhole(320, 240, 90.0)._replace(forward_m=0.5, right_m=0.2)
    scan = panorama([world.view(HERE, camera)], HERE, 0.5, 1.2)
    ahead = np.abs(scan.bearing_deg) < 30.0
    np.testing.assert_allclose(scan.range_m[ahead], 8.0 / np.cos(np.deg2rad(scan.bearing_deg[ahead])), rtol=0.01)
    slab = World([Prism(rectangle(0, 9, 40, 2), HERE.z + 1.1, HERE.z + 1.3)])
    raised = panorama([slab.view(HERE, camera._replace(up_m=0.8))], HERE, 0.5, 1.2)
    assert np.isinf(raised.range_m[BINS // 2])
    assert raised.body_m[BINS // 2] == pytest.approx(8.0, rel=0.02)
