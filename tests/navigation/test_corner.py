"""Inner corners in a ray-cast world: whose wall a thing stands at, and a stop that is nearest to that wall."""

import math
from itertools import pairwise

import numpy as np
import pytest

from navigation.approach import Approach, plan_approach, stop_place
from navigation.camera import Place, Pose, pinhole
from navigation.corner import CornerParameters, Walls, at_nearest_wall, stop_beside_corner, walls_round
from navigation.point_cloud import Points
from navigation.target import Box, Target
from tests.navigation import usual
from tests.navigation.raycast_world import HEADINGS, Prism, World, rectangle

NORTH = math.pi / 2
CAMERA = pinhole(240, 240, 90.0)
CORNER = CornerParameters()
WALL = Prism(rectangle(0.0, 5.0, 60.0, 10.0), 0.0, 20.0)  # its south face is y = 0
THING = Place(0.0, -0.9, 8.0)  # on a balcony
POT = Prism(rectangle(THING.x, THING.y, 0.6, 0.1), 7.6, 8.4)
BALCONY = (
    Prism(rectangle(0.0, -1.15, 3.0, 0.1), 6.5, 7.7),
    Prism(rectangle(-1.45, -0.6, 0.1, 1.2), 6.5, 7.7),
    Prism(rectangle(1.45, -0.6, 0.1, 1.2), 6.5, 7.7),
)
TARGET = Target(THING, 5.0, 5.0, (0.0, -1.0), NORTH, 0.8)


def _across(x: float) -> Prism:
    """A wing whose wall towards the thing lies at x and runs 14 m out of the facade."""
    return Prism(rectangle(x + math.copysign(5.0, x), -7.0, 10.0, 14.0), 0.0, 20.0)


def _box(pose: Pose) -> Box:
    """The image box of the pot, seen by the front camera."""
    xs, ys = [], []
    for x in (-0.3, 0.3):
        for y in (-0.95, -0.85):
            east, north = THING.x + x - pose.x, y - pose.y
            forward = east * math.cos(pose.yaw) + north * math.sin(pose.yaw)
            right = east * math.sin(pose.yaw) - north * math.cos(pose.yaw)
            xs.append(0.5 + right / forward / 2)
            ys += [0.5 - (z - pose.z) / forward / 2 for z in (7.6, 8.4)]
    return Box(min(xs), min(ys), max(xs), max(ys))


def _plan(world: World, pose: Pose) -> Approach:
    views = world.views(pose, CAMERA)
    others = [views[h] for h in HEADINGS if h != 0]
    return plan_approach(views[0], others, _box(pose), pose, usual.APPROACH, 40.0)


def _cloud(*prisms: Prism) -> Points:
    """Points every 10 cm on the upright faces of prisms, from 6 to 12 m above ground. (N, 3)."""
    points = []
    for prism in prisms:
        for a, b in zip(prism.outline, (*prism.outline[1:], prism.outline[0]), strict=True):
            steps = np.linspace(0.0, 1.0, max(2, round(math.dist(a, b) / 0.1)))[:, None]
            plan = np.array(a) + steps * (np.array(b) - np.array(a))
            heights = np.arange(max(6.0, prism.bottom_m), min(12.0, prism.top_m), 0.1)
            points.append(np.column_stack((np.repeat(plan, len(heights), 0), np.tile(heights, len(plan)))))
    return np.concatenate(points).astype(np.float32)


@pytest.mark.parametrize("across_x", [-1.75, 1.75, -2.25, 2.25])
@pytest.mark.parametrize("aside_m", [0.5, 3.0])
def test_in_an_inner_corner_the_stop_is_nearer_to_the_things_own_wall_than_to_the_one_across(
    across_x: float, aside_m: float
) -> None:
    world = World([WALL, POT, *BALCONY, _across(across_x)], ground=True)
    away = -math.copysign(1.0, across_x)
    here = (away * aside_m, -8.0)
    pose = Pose(*here, 8.4, math.atan2(THING.y - here[1], THING.x - here[0]))
    found = _plan(world, pose)
    assert (found.status, found.reached) == ("clear", True)
    assert found.stop is not None
    own_m = math.hypot(found.stop.x, found.stop.y)
    assert own_m + 0.15 < abs(found.stop.x - across_x)
    assert own_m < 2.85
    assert abs(found.stop.x) < -found.stop.y  # well in front of it
    for a, b in pairwise([Place(*pose[:3]), *found.path]):
        assert world.gap_m(np.linspace(np.array(a), np.array(b), 100)).min() >= 0.9


@pytest.mark.parametrize("others", [[], [_across(-4.5)]])
def test_where_no_wall_across_is_near_the_stop_is_straight_in_front(others: list[Prism]) -> None:
    found = _plan(World([WALL, POT, *BALCONY, *others], ground=True), Pose(0.5, -8.0, 8.4, NORTH))
    assert found.stop is not None
    assert found.stop.x == pytest.approx(THING.x, abs=0.1)
    assert found.stop.y == pytest.approx(-0.95 - 1.5, abs=0.1)


def test_a_thing_seen_along_its_wall_is_faced_from_before_that_wall() -> None:
    """Most of what shows round it is the wall across the corner, two metres behind."""
    pose = Pose(8.0, -1.6, 8.4, math.atan2(THING.y + 1.6, -8.0))
    found = _plan(World([WALL, POT, *BALCONY, _across(-1.75)], ground=True), pose)
    assert found.target is not None
    assert found.target.facing_yaw == pytest.approx(NORTH, abs=math.radians(8.0))


def test_the_walls_round_a_thing_are_measured_from_it() -> None:
    walls = walls_round(_cloud(WALL, *BALCONY, _across(-1.75), _across(2.6)), TARGET, CORNER)
    assert walls.behind_m == pytest.approx(0.9, abs=0.05)
    assert walls.left_m == pytest.approx(1.75, abs=0.06)
    assert walls.right_m == pytest.approx(2.6, abs=0.06)


def test_railings_and_reveals_and_posts_are_no_walls_across() -> None:
    reveal = Prism(rectangle(0.75, -0.9 - 0.2, 0.1, 0.9), 6.5, 12.0)
    post = Prism(rectangle(-2.0, -2.5, 0.2, 0.2), 0.0, 20.0)
    assert walls_round(_cloud(WALL, *BALCONY, reveal, post), TARGET, CORNER)[1:] == (None, None)
    assert walls_round(np.empty((0, 3), np.float32), TARGET, CORNER) == Walls(None, None, None)


EAVES = Prism(rectangle(-1.5, -1.3, 2.0, 2.6), 9.3, 9.5)
BALCONY_ABOVE = Prism(rectangle(-1.3, -0.7, 1.6, 1.4), 9.0, 9.2)
PORCH = (
    Prism(rectangle(-1.5, -0.75, 1.8, 1.5), 8.9, 9.3),
    Prism(rectangle(-0.7, -1.4, 0.2, 0.2), 6.0, 8.9),
    Prism(rectangle(-2.3, -1.4, 0.2, 0.2), 6.0, 8.9),
)


@pytest.mark.parametrize("over", [(EAVES,), (BALCONY_ABOVE,), PORCH], ids=["eaves", "balcony above", "porch"])
def test_what_runs_out_of_a_facade_overhead_is_no_wall_across(over: tuple[Prism, ...]) -> None:
    assert walls_round(_cloud(WALL, *over), TARGET, CORNER)[1:] == (None, None)
    poster = Prism(rectangle(0.0, -0.04, 0.6, 0.08), 7.6, 8.4)
    pose = Pose(0.5, -6.0, 8.2, NORTH)
    views = World([WALL, poster, *over], ground=True).views(pose, CAMERA)
    box = Box(0.5 + (-0.3 - pose.x) / 6.0 / 2, 0.48, 0.5 + (0.3 - pose.x) / 6.0 / 2, 0.55)
    found = plan_approach(views[0], [views[h] for h in HEADINGS if h != 0], box, pose, usual.APPROACH, 40.0)
    assert found.stop is not None
    assert found.stop.x == pytest.approx(0.0, abs=0.1)


def test_a_railing_that_depth_may_have_missed_is_kept_clear_of_and_is_no_wall_across() -> None:
    shown, missed = _cloud(WALL, *BALCONY), _cloud(_across(-1.75))
    both = np.concatenate([shown, missed])
    pose = Pose(0.0, -4.0, 8.0, NORTH)
    assert stop_place(TARGET, shown, both, pose, usual.APPROACH).x == pytest.approx(0.0)
    assert stop_place(TARGET, both, both, pose, usual.APPROACH).x > 0.5
    before = _cloud(Prism(rectangle(0.0, -2.1, 2.0, 0.1), 7.5, 8.5))
    kept_off = stop_place(TARGET, shown, np.concatenate([shown, before]), pose, usual.APPROACH)
    assert kept_off.y < stop_place(TARGET, shown, shown, pose, usual.APPROACH).y - 0.5


@pytest.mark.parametrize(("normal", "facing"), [((1.0, 0.0), math.pi), ((-1.0, 0.0), 0.0)])
def test_of_two_walls_the_thing_stands_at_the_nearer_one(normal: tuple[float, float], facing: float) -> None:
    wing = _across(-1.75 if normal[0] > 0 else 1.75)
    mistaken = TARGET._replace(normal=normal, facing_yaw=facing)
    mended = at_nearest_wall(mistaken, _cloud(WALL, *BALCONY, wing), CORNER)
    assert mended.normal == pytest.approx((0.0, -1.0))
    assert mended.facing_yaw == pytest.approx(NORTH)
    assert at_nearest_wall(TARGET, _cloud(WALL, *BALCONY, wing), CORNER) == TARGET


def test_between_two_wings_as_near_to_each_other_there_is_no_stop_aside() -> None:
    points = _cloud(WALL, *BALCONY, _across(-1.75), _across(1.75))
    assert stop_beside_corner(TARGET, points, 8.4, 1.5, lambda _: 1.3, CORNER) is None


def test_where_what_juts_out_keeps_the_drone_too_far_off_there_is_no_stop_aside() -> None:
    points = _cloud(WALL, _across(-1.75))
    assert stop_beside_corner(TARGET, points, 8.4, 1.5, lambda _: 1.3, CORNER) is not None
    assert stop_beside_corner(TARGET, points, 8.4, 1.5, lambda _: 2.4, CORNER) is None
