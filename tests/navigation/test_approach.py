"""Target, facade and approach in a ray-cast world: wall, thing at a window, balconies, trees in the way."""

import math
from itertools import pairwise

import numpy as np
import pytest

from navigation.approach import Approach, plan_approach
from navigation.camera import DepthView, Place, Pose, pinhole
from navigation.keep_out import Volume, entered
from navigation.railings import RAILING_M
from navigation.target import Box, TargetParameters, box_place, facade_normal, locate
from tests.navigation import usual
from tests.navigation.raycast_world import HEADINGS, Prism, World, rectangle

NORTH = math.pi / 2
CAMERA = pinhole(160, 160, 90.0)
WALL = Prism(rectangle(0.0, 5.0, 60.0, 10.0), 0.0, 20.0)  # its south face is y = 0
POT = Prism(rectangle(1.0, -0.15, 0.6, 0.3), 8.0, 8.6)  # on a sill; its front is y = -0.3

STOPS_AT_2_M = usual.APPROACH._replace(stop_distance_m=2.0)


def _box(pose: Pose, heading: int, low: Place, high: Place) -> Box:
    """The image box of an upright box's front face, seen from `pose`."""
    angle = pose.yaw - math.radians(heading)
    xs, ys = [], []
    for place in (low, high, Place(low.x, low.y, high.z), Place(high.x, high.y, low.z)):
        east, north = place.x - pose.x, place.y - pose.y
        forward = east * math.cos(angle) + north * math.sin(angle)
        right = east * math.sin(angle) - north * math.cos(angle)
        xs.append(0.5 + right / forward / 2)
        ys.append(0.5 - (place.z - pose.z) / forward / 2)
    return Box(min(xs), min(ys), max(xs), max(ys))


def _plan(world: World, pose: Pose, heading: int = 0, max_leg_m: float = 40.0) -> Approach:
    views = world.views(pose, CAMERA)
    box = _box(pose, heading, Place(0.7, -0.3, 8.0), Place(1.3, -0.3, 8.6))
    others = [views[h] for h in HEADINGS if h != heading]
    return plan_approach(views[heading], others, box, pose, STOPS_AT_2_M, max_leg_m)


def _assert_flies_clear(world: World, pose: Pose, approach: Approach, room_m: float = 0.9) -> None:
    places = [Place(*pose[:3]), *approach.path]
    for a, b in pairwise(places):
        assert world.gap_m(np.linspace(np.array(a), np.array(b), 100)).min() >= room_m


def test_a_way_leads_round_a_volume_to_keep_out_of_and_none_into_it() -> None:
    pose, view = Pose(1.0, -12.0, 8.3, NORTH), World([WALL, POT]).views(Pose(1.0, -12.0, 8.3, NORTH), CAMERA)
    box = _box(pose, 0, Place(0.7, -0.3, 8.0), Place(1.3, -0.3, 8.6))
    others = [view[h] for h in HEADINGS if h != 0]

    def way(west: float, east: float) -> Approach:
        wire = Volume("wire", ((west, -7.5), (east, -7.5), (east, -6.5), (west, -6.5)), 7.0, 9.5)
        found = plan_approach(view[0], others, box, pose, STOPS_AT_2_M, 40.0, [wire])
        corners = [Place(*pose[:3]), *found.path]
        assert all(entered(a, b, [wire], 0.5) is None for a, b in pairwise(corners))
        return found

    aside = way(-0.5, 2.0)
    assert aside.reached
    assert len(aside.path) == 2
    assert way(-40.0, 40.0).status == "blocked"


def test_the_boxs_middle_has_a_height_above_ground() -> None:
    pose = Pose(-2.0, -9.0, 7.0, NORTH)
    view = World([WALL, POT]).views(pose, CAMERA)[0]
    place = box_place(view, _box(pose, 0, Place(0.7, -0.3, 8.0), Place(1.3, -0.3, 8.6)), pose, TargetParameters())
    assert place is not None
    np.testing.assert_allclose(place, (1.0, -0.3, 8.3), atol=0.02)


def test_the_thing_is_measured_and_not_the_wall_that_shows_beside_it() -> None:
    pose = Pose(1.0, -9.0, 8.3, NORTH)
    view = World([WALL, POT]).views(pose, CAMERA)[0]
    wide = _box(pose, 0, Place(0.5, -0.3, 7.8), Place(1.5, -0.3, 8.8))
    place = box_place(view, wide, pose, TargetParameters(inner_share=1.0, depth_percentile=25.0))
    assert place is not None
    assert place.y == pytest.approx(-0.3, abs=0.01)


@pytest.mark.parametrize(
    ("x", "yaw_deg", "heading"), [(1.0, 90, 0), (-5.0, 60, 0), (7.0, 0, -90), (-6.0, 90, 45), (9.0, 170, 45)]
)
def test_the_facade_is_faced_squarely_whatever_the_view(x: float, yaw_deg: float, heading: int) -> None:
    pose = Pose(x, -9.0, 8.0, math.radians(yaw_deg))
    found = _plan(World([WALL, POT]), pose, heading)
    assert found.status == "clear"
    assert found.target is not None
    assert found.target.facing_yaw == pytest.approx(NORTH, abs=0.03)
    assert found.target.plane_share > 0.8
    assert found.target.distance_m == pytest.approx(math.hypot(1.0 - x, 8.7), abs=0.1)
    assert found.stop is not None
    np.testing.assert_allclose(found.stop, (1.0, -2.3, 8.0), atol=0.15)


def test_the_stop_is_in_front_of_the_thing_and_the_way_is_straight() -> None:
    pose = Pose(-3.0, -9.0, 8.0, NORTH)
    world = World([WALL, POT], ground=True)
    found = _plan(world, pose)
    assert found.stop is not None
    assert found.path == (found.stop,)
    assert found.reached
    assert found.free_distance_m == pytest.approx(math.dist(pose[:3], found.stop))
    _assert_flies_clear(world, pose, found)


def test_in_front_of_a_balcony_the_stop_keeps_clear_of_its_railing() -> None:
    """The railing is 1.6 m in front of the wall, 1.3 m beyond the pot: 1.3 + 0.35 + 0.6 = 2.25 m from the pot."""
    railing = Prism(rectangle(1.0, -1.55, 4.0, 0.1), 7.0, 8.0)
    world = World([WALL, POT, railing])
    pose = Pose(1.0, -9.0, 8.5, NORTH)
    found = _plan(world, pose)
    assert found.status == "clear"
    assert found.stop is not None
    assert found.stop.y == pytest.approx(-0.3 - 1.3 - 0.95 - 0.05, abs=0.06)
    _assert_flies_clear(world, pose, found)


def test_of_a_sensor_with_holes_the_way_keeps_clear_of_a_railing_that_it_may_have_missed() -> None:
    """Between the drone and the stop a balcony's slab juts out 1.2 m below the way; a hand rail would be in it."""
    slab = Prism(rectangle(-4.0, -1.5, 3.0, 3.0), 6.9, 7.1)
    post = Prism(rectangle(-4.5, -0.8, 0.2, 0.2), 7.1, 7.8)  # all that depth shows of it
    pose = Pose(-9.0, -2.2, 8.3, 0.0)
    views = World([WALL, POT, slab, post]).views(pose, CAMERA)
    box = _box(pose, 0, Place(0.7, -0.3, 8.0), Place(1.3, -0.3, 8.6))

    def planned(holes: bool) -> Approach:
        seen = {heading: view._replace(depth_m=view.depth_m.copy()) for heading, view in views.items()}
        if holes:
            seen[-90].depth_m[0, 0] = np.nan
        return plan_approach(seen[0], [seen[h] for h in HEADINGS if h != 0], box, pose, STOPS_AT_2_M, 40.0)

    railing = World([slab._replace(top_m=7.1 + RAILING_M)])
    over, round_it = planned(holes=False), planned(holes=True)
    assert _gap_m(railing, pose, over) < 0.4
    assert round_it.status == "clear"
    assert _gap_m(railing, pose, round_it) >= 0.85


def _gap_m(world: World, pose: Pose, approach: Approach) -> float:
    places = [Place(*pose[:3]), *approach.path]
    return min(float(world.gap_m(np.linspace(np.array(a), np.array(b), 100)).min()) for a, b in pairwise(places))


@pytest.mark.parametrize(("z", "expected"), [(8.0, 8.0), (8.9, 8.9), (12.0, 9.05), (5.0, 7.55)])
def test_the_drone_keeps_its_height_near_the_things(z: float, expected: float) -> None:
    found = _plan(World([WALL, POT]), Pose(1.0, -9.0, z, NORTH))
    assert found.stop is not None
    assert found.stop.z == pytest.approx(expected, abs=0.05)


def test_a_tree_on_the_straight_way_is_flown_round() -> None:
    tree = Prism(rectangle(-0.5, -6.8, 0.5, 0.5), 0.0, 12.0)
    world = World([WALL, POT, tree], ground=True)
    pose = Pose(-3.0, -9.0, 8.0, NORTH)
    found = _plan(world, pose)
    assert found.status == "clear"
    assert len(found.path) == 2
    assert found.reached
    assert found.free_distance_m is not None
    assert found.free_distance_m < math.dist(pose[:3], found.path[-1]) - 1.0
    _assert_flies_clear(world, pose, found)


def test_a_window_behind_a_screen_is_blocked_and_says_how_far_is_free() -> None:
    """A row of posts with gaps that show the pot but are narrower than the drone."""
    posts = [Prism(rectangle(-10.0 + 0.8 * k, -4.0, 0.2, 0.2), 0.0, 20.0) for k in range(28)]
    found = _plan(World([WALL, POT, *posts]), Pose(1.0, -9.0, 8.3, NORTH))
    assert found.status == "blocked"
    assert found.path == ()
    assert not found.reached
    assert found.free_distance_m == pytest.approx(9.0 - 4.1 - 0.95, abs=0.15)


def test_where_no_way_leads_to_the_stop_there_is_one_to_another_side_of_the_thing() -> None:
    """A fence about the window, with gaps that show the pot but are narrower than the drone."""
    front = [(-2.0 + 0.8 * k, -4.0) for k in range(9)]
    sides = [(x, -3.2 + 0.8 * k) for x in (-2.0, 4.4) for k in range(4)]
    world = World([WALL, POT, *(Prism(rectangle(x, y, 0.2, 0.2), 0.0, 20.0) for x, y in front + sides)])
    pose = Pose(1.0, -9.0, 8.3, NORTH)
    found = _plan(world, pose)
    assert (found.status, found.path, found.reached) == ("blocked", (), False)
    _assert_flies_clear(world, pose, Approach("clear", path=found.aside))
    before, after = (math.atan2(p.y + 0.3, p.x - 1.0) for p in (pose, found.aside[-1]))
    assert abs(math.remainder(after - before, math.tau)) > math.radians(20.0)


def test_a_far_target_is_approached_in_legs() -> None:
    pose = Pose(1.0, -30.0, 8.0, NORTH)
    found = _plan(World([WALL, POT]), pose, max_leg_m=10.0)
    assert found.status == "clear"
    assert not found.reached
    assert math.dist(pose[:3], found.path[-1]) == pytest.approx(10.0)
    assert found.stop is not None
    assert found.path[-1] != found.stop


def test_where_no_camera_looks_along_the_way_the_drone_turns_first() -> None:
    """The pot is just inside the only picture's left edge, the stop just outside of it."""
    pose = Pose(8.0, -9.0, 8.0, NORTH)
    view = World([WALL, POT]).views(pose, CAMERA)[0]
    box = _box(pose, 0, Place(0.7, -0.3, 8.0), Place(1.3, -0.3, 8.6))
    near = STOPS_AT_2_M._replace(slide_offsets_m=(0.0,), retreats_m=(2.0,))
    found = plan_approach(view, (), box, pose, near, 40.0)
    assert (found.status, found.path, found.reached) == ("clear", (), False)


def test_where_the_stop_is_hidden_the_drone_flies_to_a_corner_and_looks_again() -> None:
    """The tree lets the pot be seen past its left side, but hides the place in front of the window."""
    tree = Prism(rectangle(-0.3, -5.5, 1.0, 1.0), 0.0, 12.0)
    world = World([WALL, POT, tree], ground=True)
    pose = Pose(-3.0, -9.0, 8.0, NORTH)
    first = _plan(world, pose)
    assert (first.status, len(first.path), first.reached) == ("clear", 1, False)
    _assert_flies_clear(world, pose, first)
    there = Pose(*first.path[0], NORTH)
    second = _plan(world, there, 45)
    assert second.reached
    _assert_flies_clear(world, there, second)


def test_a_look_from_where_the_drone_hovers_already_is_not_flown_to() -> None:
    """Of the two corners by which the stop may be reached one lies 0.3 m beside the drone, and from there the way in is
    as much out of sight."""
    pose = Pose(8.0, -9.0, 8.0, NORTH)
    view = World([WALL, POT]).views(pose, CAMERA)[0]
    box = _box(pose, 0, Place(0.7, -0.3, 8.0), Place(1.3, -0.3, 8.6))
    near = STOPS_AT_2_M._replace(slide_offsets_m=(6.7,), retreats_m=(6.7,))
    found = plan_approach(view, (), box, pose, near, 40.0)
    corners = [math.dist((pose.x, pose.y, pose.z), place) for place in found.path]
    assert all(away >= 1.0 for away in corners), corners


def test_without_depth_in_the_box_there_is_no_target() -> None:
    views = World([]).views(Pose(0.0, 0.0, 8.0, NORTH), CAMERA)
    sky = plan_approach(views[0], (), Box(0.4, 0.4, 0.6, 0.6), Pose(0.0, 0.0, 8.0, NORTH), usual.APPROACH, 40.0)
    assert sky == Approach("no_depth")
    invalid = DepthView(pinhole(20, 20, 90.0), np.full((20, 20), np.nan, np.float32))
    assert locate(invalid, Box(0.4, 0.4, 0.6, 0.6), Pose(0.0, 0.0, 8.0, NORTH), TargetParameters()) is None


def test_a_box_of_a_single_pixel_has_depth() -> None:
    pose = Pose(1.0, -9.0, 8.3, NORTH)
    view = World([WALL, POT]).views(pose, CAMERA)[0]
    place = box_place(view, Box(0.5, 0.5, 0.501, 0.501), pose, TargetParameters())
    assert place is not None
    assert place.y == pytest.approx(-0.3, abs=0.01)


def test_where_no_plane_is_found_the_facade_is_taken_to_face_the_drone() -> None:
    points = np.random.default_rng(0).uniform(-5, 5, (400, 2)).astype(np.float32)
    assert facade_normal(points, (0.0, -1.0), TargetParameters(min_inlier_share=0.5)) == ((0.0, -1.0), 0.0)
    assert facade_normal(points[:5], (0.0, -1.0), TargetParameters()) == ((0.0, -1.0), 0.0)


def test_a_noisy_wall_with_windows_and_railings_still_gives_its_normal() -> None:
    chance = np.random.default_rng(1)
    along = chance.uniform(-4, 4, 3000)
    out = np.where(chance.random(3000) < 0.3, 1.3, np.where(chance.random(3000) < 0.3, -0.2, 0.0))
    out = out + chance.normal(0, 0.02, 3000)
    tilt = math.radians(25.0)
    normal = np.array((math.sin(tilt), -math.cos(tilt)))
    points = along[:, None] * np.array((normal[1], -normal[0])) + out[:, None] * normal
    found, share = facade_normal(points.astype(np.float32), (0.0, -1.0), TargetParameters())
    assert math.degrees(math.acos(min(1.0, float(np.dot(found, normal))))) < 1.5
    assert share > 0.4
