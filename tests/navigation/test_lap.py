"""The paper's exploration rule with corridor distances and the centre point goes all the way round a building."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from navigation import safe_distance, viewpoint
from navigation.camera import Camera, Pose, move_pose, pinhole
from tests.navigation import usual
from tests.navigation.raycast_world import HEADINGS, Prism, World, rectangle, units, winding_deg

MIN_MOVE_M = 1.0
FALLBACK_TURN = math.radians(30.0)
CAMERA = pinhole(120, 24, 90.0)


class Lap(NamedTuple):
    steps: int
    turned_deg: float
    nearest_m: float


def fly(world: World, start: Pose, settings: viewpoint.ViewpointParameters, camera: Camera, max_steps: int) -> Lap:
    """Steps of eq. 4-7 about the origin until a full turn in the wanted direction, or too many steps."""
    side = 1 if settings.direction == "clockwise" else -1
    pose, d_max, nearest = start, None, math.inf
    track = [(pose.x, pose.y)]
    for step in range(1, max_steps + 1):
        views = world.views(pose, camera)
        means = {
            str(heading): viewpoint.Sliced(
                heading, viewpoint.slice_means(units(view.depth_m), 0.002, settings.slices, settings.sensor_range_m)
            )
            for heading, view in views.items()
        }
        choice = viewpoint.choose_view(means, settings, d_max, np.random.default_rng(step))
        d_max = choice.d_max_next_m
        others = [views[heading] for heading in HEADINGS if heading != choice.heading_deg]
        centre = safe_distance.safe_distances(views[int(choice.heading_deg)], others, usual.SAFE_DISTANCE)[2]
        distance = centre.corridor.distance_m
        if distance < MIN_MOVE_M:
            pose = pose._replace(yaw=pose.yaw + side * FALLBACK_TURN)
            continue
        reached = move_pose(pose, centre.bearing_deg, distance)
        way = np.linspace(np.array(pose[:3]), np.array(reached[:3]), 60)
        nearest = min(nearest, float(world.gap_m(way).min()))
        pose = reached
        track.append((pose.x, pose.y))
        if side * winding_deg(track, (0.0, 0.0)) >= 360.0:
            break
    return Lap(step, side * winding_deg(track, (0.0, 0.0)), nearest)


def _corner(size: float) -> tuple[tuple[float, float], ...]:
    """An L about the origin: two wings, each a third of `size` wide."""
    a, b = -size / 6, size / 6
    high = size * 5 / 6
    return ((a, a), (high, a), (high, b), (b, b), (b, high), (a, high))


SHAPES = {
    "square of 10 m": rectangle(0.0, 0.0, 10.0, 10.0),
    "square of 25 m": rectangle(0.0, 0.0, 25.0, 25.0),
    "36 x 12 m along the street": rectangle(0.0, 0.0, 36.0, 12.0),
    "12 x 36 m across the street": rectangle(0.0, 0.0, 12.0, 36.0),
    "L of 24 m": _corner(24.0),
}


@pytest.mark.parametrize("stand_off_m", [8.0, 10.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_papers_rule_laps_an_isolated_building_clockwise(shape: str, stand_off_m: float) -> None:
    outline = SHAPES[shape]
    front = min(y for _, y in outline)
    lap = fly(
        World([Prism(outline)]),
        Pose(0.0, front - stand_off_m, 8.0, math.pi / 2),
        usual.VIEWPOINT,
        CAMERA,
        40,
    )
    assert lap.turned_deg >= 360.0
    assert lap.nearest_m > 0.85


def test_counter_clockwise_is_the_mirror_image_of_the_lap() -> None:
    start = Pose(0.0, -14.5, 8.0, math.pi / 2)
    world = World([Prism(rectangle(0.0, 0.0, 20.0, 12.0))])
    clockwise = fly(world, start, usual.VIEWPOINT, CAMERA, 40)
    counter = fly(world, start, usual.VIEWPOINT._replace(direction="counterclockwise"), CAMERA, 40)
    assert counter.turned_deg == pytest.approx(clockwise.turned_deg, abs=0.1)
    assert counter.steps == clockwise.steps


def test_street_and_roof_in_the_picture_do_not_stop_the_lap() -> None:
    world = World([Prism(rectangle(0.0, 0.0, 15.0, 10.0), -1.0, 9.0)], ground=True)
    lap = fly(world, Pose(0.0, -14.0, 5.0, math.pi / 2), usual.VIEWPOINT, pinhole(100, 100, 90.0), 40)
    assert lap.turned_deg >= 360.0
    assert lap.nearest_m > 0.85


@pytest.mark.parametrize("policy", ["random", "default"])
def test_the_ablations_do_not_lap_in_as_many_steps(policy: viewpoint.Policy) -> None:
    world, start = World([Prism(SHAPES["square of 25 m"])]), Pose(0.0, -21.5, 8.0, math.pi / 2)
    paper = fly(world, start, usual.VIEWPOINT, CAMERA, 40)
    ablated = fly(world, start, usual.VIEWPOINT._replace(policy=policy), CAMERA, paper.steps)
    assert ablated.turned_deg < 360.0 <= paper.turned_deg
