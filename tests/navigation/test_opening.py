"""Things on the wall between two windows in a ray-cast world: which window is nearer, and a stop towards that one."""

import math

import numpy as np
import pytest

from navigation.approach import plan_approach
from navigation.camera import DepthView, Place, Pose, pinhole
from navigation.opening import Opening, OpeningParameters, Openings, openings_beside, stop_towards_opening
from navigation.point_cloud import Points, cloud, to_enu
from navigation.target import Box, Target
from tests.navigation import usual
from tests.navigation.raycast_world import HEADINGS, Prism, World, rectangle

NORTH = math.pi / 2
OPENING = OpeningParameters()
CAMERA = pinhole(240, 160, 90.0)
WINDOW_M, PITCH_M = 1.3, 3.0
THING = Place(0.0, -0.08, 8.0)
TARGET = Target(THING, 2.0, 2.0, (0.0, -1.0), NORTH, 0.8)
POSTER = Prism(rectangle(0.0, -0.04, 0.8, 0.08), 7.6, 8.4)
PANES = Prism(rectangle(0.0, 3.18, 40.0, 6.0), 0.0, 20.0)


def facade(first_m: float) -> list[Prism]:
    """Walls whose south face is y = 0, and panes 0.18 m behind it; the middle of a window lies at x = `first_m`."""
    middles = [first_m + k * PITCH_M for k in range(-6, 7)]
    between = [rectangle(x + PITCH_M / 2, 3.0, PITCH_M - WINDOW_M, 6.0) for x in middles]
    return [PANES, *(Prism(outline, 0.0, 20.0) for outline in between)]


def seen(pose: Pose, *things: Prism, first_m: float = 1.4) -> Points:
    views = World([*facade(first_m), *things], ground=True).views(pose, CAMERA)
    return np.concatenate([to_enu(cloud(view), pose) for view in views.values()])


@pytest.mark.parametrize(("first_m", "towards"), [(1.4, 1.0), (1.6, -1.0)])
@pytest.mark.parametrize("here", [(0.0, -1.6), (0.3, -2.0), (-0.3, -2.0), (1.0, -4.0)])
def test_the_stop_lies_towards_the_nearer_of_two_windows(
    first_m: float, towards: float, here: tuple[float, float]
) -> None:
    pose = Pose(*here, 8.2, NORTH)
    place = stop_towards_opening(TARGET, seen(pose, POSTER, first_m=first_m), pose, OPENING)
    assert place == pytest.approx((0.4 * towards, THING.y, THING.z), abs=0.01)


def test_openings_are_measured_from_wall_to_wall() -> None:
    left, right = openings_beside(TARGET, seen(Pose(0.0, -2.0, 8.0, NORTH), POSTER), OPENING)
    assert left == pytest.approx(Opening(0.95, 1.6), abs=0.06)
    assert right == pytest.approx(Opening(0.75, 1.4), abs=0.06)


@pytest.mark.parametrize("askew_deg", [-6.0, 6.0])
def test_a_normal_that_is_some_degrees_askew_does_no_harm(askew_deg: float) -> None:
    angle = -NORTH + math.radians(askew_deg)
    askew = TARGET._replace(
        normal=(math.cos(angle), math.sin(angle)), facing_yaw=math.remainder(angle + math.pi, math.tau)
    )
    pose = Pose(0.1, -1.6, 8.0, NORTH)
    assert stop_towards_opening(askew, seen(pose, POSTER), pose, OPENING).x == pytest.approx(0.4, abs=0.05)


def test_half_way_between_two_windows_neither_is_preferred() -> None:
    pose = Pose(0.0, -2.0, 8.0, NORTH)
    assert stop_towards_opening(TARGET, seen(pose, POSTER, first_m=1.5), pose, OPENING) == THING


def test_a_window_that_something_stands_in_is_not_measured_by_what_is_left_of_it() -> None:
    pose = Pose(0.0, -2.0, 8.0, NORTH)
    pot = Prism(rectangle(-1.9, -0.1, 0.3, 0.3), 7.5, 8.5)
    assert stop_towards_opening(TARGET, seen(pose, POSTER, pot), pose, OPENING) == THING


@pytest.mark.parametrize("first_m", [0.0, 0.3])
def test_a_thing_in_a_window_is_stopped_before_as_it_stands(first_m: float) -> None:
    pose = Pose(0.0, -2.0, 8.0, NORTH)
    pot = Prism(rectangle(0.0, 0.0, 0.3, 0.16), 7.7, 8.3)
    assert stop_towards_opening(TARGET, seen(pose, pot, first_m=first_m), pose, OPENING).x == pytest.approx(
        0.0, abs=0.41
    )


def test_from_far_aside_nothing_is_said_of_windows() -> None:
    pose = Pose(4.0, -2.0, 8.0, NORTH)
    assert stop_towards_opening(TARGET, seen(pose, POSTER), pose, OPENING) == THING


def test_on_a_blind_wall_and_without_returns_there_is_no_opening() -> None:
    wall = Prism(rectangle(0.0, 5.0, 40.0, 10.0), 0.0, 20.0)
    pose = Pose(0.0, -2.0, 8.0, NORTH)
    views = World([wall, POSTER], ground=True).views(pose, CAMERA)
    points = np.concatenate([to_enu(cloud(view), pose) for view in views.values()])
    assert openings_beside(TARGET, points, OPENING) == Openings(None, None)
    assert openings_beside(TARGET, np.zeros((0, 3), np.float32), OPENING) == Openings(None, None)


def test_a_noisy_stereo_camera_finds_the_nearer_window_too() -> None:
    """31 mm at 5 m, as the profile d455 has it."""
    pose = Pose(0.0, -2.0, 8.0, NORTH)
    chance = np.random.default_rng(5)
    noisy = []
    for view in World([*facade(1.4), POSTER], ground=True).views(pose, CAMERA).values():
        depth_m = np.where(np.isfinite(view.depth_m), view.depth_m, 0.0)
        error = 0.031 * (depth_m / 5.0) ** 2 * chance.normal(size=depth_m.shape)
        noisy.append(DepthView(view.camera, (view.depth_m + error).astype(np.float32)))
    points = np.concatenate([to_enu(cloud(view), pose) for view in noisy])
    assert stop_towards_opening(TARGET, points, pose, OPENING).x == pytest.approx(0.4, abs=0.02)


def test_an_approach_ends_nearer_to_the_window_that_the_thing_is_nearer_to() -> None:
    pose = Pose(0.5, -6.0, 8.2, NORTH)
    views = World([*facade(1.4), POSTER], ground=True).views(pose, pinhole(480, 480, 90.0))
    box = Box(*(0.5 + (x - pose.x) / 6.0 / 2 for x in (-0.4,)), 0.48, 0.5 + (0.4 - pose.x) / 6.0 / 2, 0.56)
    found = plan_approach(views[0], [views[h] for h in HEADINGS if h != 0], box, pose, usual.APPROACH, 40.0)
    assert found.reached
    assert found.stop is not None
    own_m, other_m = (math.hypot(found.stop.x - x, found.stop.y) for x in (1.4, -1.6))
    assert own_m + 0.3 < other_m
