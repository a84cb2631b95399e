import math
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet
import pytest

from contracts.geometry import Point3, Pose
from contracts.sim import Flight
from contracts.vehicle import Move
from episode_kit.judge import Hit
from episode_kit.trajectory import Flown, plan
from services.sim.geometry.scene_mesh import Solid
from services.sim.world import EDGE, GROUND, Blueprint, World

BOX_FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ],
    np.int32,
)


def box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    return Solid(1, name, np.array(corners, np.float64), BOX_FACES)


def blueprint() -> Blueprint:
    return Blueprint(
        [
            box("house", (5.0, -5.0, 0.0), (10.0, 5.0, 12.0)),
            box("railing", (-3.0, 8.0, 5.0), (3.0, 8.02, 5.02)),  # a bar 2 cm thick
        ],
        half_size_m=40.0,
        roof_m=12.0,
    )


@pytest.fixture
def world() -> Iterator[World]:
    built = World(blueprint(), radius_m=0.35)
    yield built
    built.close()


def pose(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    return Pose(x=x, y=y, z=z, yaw=yaw)


def to(*points: tuple[float, float, float], yaw: float | None = None) -> Move:
    return Move(path=tuple(Point3(x=x, y=y, z=z) for x, y, z in points), yaw=yaw)


def fly(world: World, flight: Flight, start: Pose, move: Move) -> Flown:
    return plan(world, flight, start, [(p.x, p.y, p.z) for p in move.path], move.yaw).end


def test_clearance_is_measured_from_the_spheres_surface(world: World) -> None:
    assert world.clearance_m((4.0, 0.0, 6.0)) == pytest.approx(0.65, abs=1e-4)
    assert world.clearance_m((0.0, 0.0, 0.5)) == pytest.approx(0.15, abs=1e-4)
    assert world.clearance_m((0.0, 0.0, 6.0)) == 1.5  # nothing within the query's reach


def test_the_drone_stops_where_it_touches_the_wall(world: World) -> None:
    flown = fly(world, Flight(), pose(0, 0, 6, 1.0), to((20.0, 0.0, 6.0)))
    assert flown.hit == "house"
    assert flown.pose.x == pytest.approx(4.65, abs=0.005)
    assert flown.pose.x <= 4.65
    assert flown.path_m == pytest.approx(4.65, abs=0.005)
    assert flown.pose.yaw == 1.0  # it never came to turn


def test_flight_time_to_a_contact_is_that_of_the_interrupted_trapezoid(world: World) -> None:
    # 4 m/s at 2 m/s2 towards 20 m: 2 s for the first 4 m, then 0.65 m at 4 m/s
    flight = Flight(max_speed_m_s=4.0, max_acceleration_m_s2=2.0)
    flown = fly(world, flight, pose(0, 0, 6), to((20.0, 0.0, 6.0)))
    assert flown.flight_s == pytest.approx(2.0 + 0.65 / 4.0, abs=0.002)


@pytest.mark.parametrize("speed_m_s", [0.5, 20.0])
def test_no_speed_tunnels_through_a_thin_bar(world: World, speed_m_s: float) -> None:
    flight = Flight(max_speed_m_s=speed_m_s, max_acceleration_m_s2=20.0)
    flown = fly(world, flight, pose(0, 0, 5), to((0.0, 30.0, 5.0)))
    assert flown.hit == "railing"
    assert flown.pose.y == pytest.approx(7.65, abs=0.005)


def test_a_sphere_that_only_grazes_a_bar_still_touches_it(world: World) -> None:
    # the bar's top edge is 0.345 m below the centre's line: 5 mm inside the sphere
    assert fly(world, Flight(), pose(0, 0, 5.365), to((0.0, 30.0, 5.365))).hit == "railing"
    assert fly(world, Flight(), pose(0, 0, 5.375), to((0.0, 30.0, 5.375))).hit is None


def test_a_bar_is_not_passed_by_a_sphere_smaller_than_its_thickness() -> None:
    small = World(blueprint(), radius_m=0.06)
    try:
        assert fly(small, Flight(radius_m=0.06), pose(0, 0, 5.01), to((0.0, 30.0, 5.01))).hit == "railing"
    finally:
        small.close()


def test_a_drone_at_a_wall_can_fly_off_but_not_on(world: World) -> None:
    stopped = fly(world, Flight(), pose(0, 0, 6), to((20.0, 0.0, 6.0))).pose
    onward = fly(world, Flight(), stopped, to((20.0, 0.0, 6.0)))
    assert onward.hit == "house"
    assert onward.path_m < 0.005
    off = fly(world, Flight(), stopped, to((0.0, 0.0, 6.0)))
    assert off.hit is None
    assert off.pose.x == pytest.approx(0.0)


def test_sweeps_agree_with_a_dense_walk_past_random_boxes() -> None:
    rng = np.random.default_rng(5)
    lows = np.array([0, 0, 10]) + rng.uniform(-6, 6, (12, 3))
    highs = lows + rng.uniform(0.02, 3.0, (12, 3))
    solids = [box(f"b{i}", tuple(lows[i]), tuple(highs[i])) for i in range(12)]
    world = World(Blueprint(solids, half_size_m=60.0, roof_m=20.0), radius_m=0.35)
    stopped = 0
    try:
        for start, end in np.array([0, 0, 10]) + rng.uniform(-8, 8, (60, 2, 3)):
            length = float(np.linalg.norm(end - start))
            walk = start + (end - start) * np.linspace(0, 1, int(length / 0.002))[:, None]
            gap = np.maximum(np.maximum(lows - walk[:, None], walk[:, None] - highs), 0.0)
            clearance = np.linalg.norm(gap, axis=2).min(axis=1) - 0.35
            if clearance[0] < 0.01:
                continue
            touched = np.flatnonzero(clearance < 0.001)
            expected = length * touched[0] / (len(walk) - 1) if len(touched) else length
            free_m, hit = world.sweep(tuple(start), tuple(end))
            grazing = clearance.min() < 0.004
            if not grazing or len(touched):
                assert (hit is not None) == bool(len(touched))
            assert free_m <= expected + 0.01
            assert clearance[: int(free_m / 0.002)].min(initial=1.0) > -0.002
            if hit is None:
                assert free_m == pytest.approx(length)
            else:
                stopped += 1
                assert clearance[min(int(free_m / 0.002), len(clearance) - 1)] < 0.006
    finally:
        world.close()
    assert stopped > 15


def test_flying_along_a_wall_within_the_clearance_is_free(world: World) -> None:
    flown = fly(world, Flight(), pose(4.6, -4.0, 6), to((4.6, 4.0, 6.0)))
    assert flown.hit is None
    assert flown.path_m == pytest.approx(8.0)


def test_going_underground_hits_the_ground(world: World) -> None:
    flown = fly(world, Flight(), pose(0, 0, 3), to((0.0, 0.0, -5.0)))
    assert flown.hit == GROUND
    assert flown.pose.z == pytest.approx(0.35, abs=0.005)


@pytest.mark.parametrize("point", [(-90.0, 0.0, 3.0), (0.0, -90.0, 3.0), (0.0, 90.0, 3.0), (0.0, 0.0, 900.0)])
def test_leaving_the_world_stops_at_its_edge(world: World, point: tuple[float, float, float]) -> None:
    flown = fly(world, Flight(), pose(0, 0, 3), to(point))
    assert flown.hit == EDGE
    assert max(abs(flown.pose.x), abs(flown.pose.y)) <= 39.65
    assert flown.pose.z <= 12.0 + 60.0 - 0.35


def test_lengths_are_measured_in_space_and_on_the_plan(world: World) -> None:
    flown = fly(world, Flight(), pose(0, 0, 2), to((0.0, -3.0, 6.0), (0.0, -3.0, 8.0)))
    assert flown.path_m == pytest.approx(7.0)
    assert flown.path_horizontal_m == pytest.approx(3.0)


def test_each_corner_is_a_stop_and_the_turn_comes_last(world: World) -> None:
    # two legs of 2 m: each 2 s at 2 m/s2 up to 2 m/s; then a quarter turn at 0.5 rad/s
    flight = Flight(max_speed_m_s=4.0, max_acceleration_m_s2=2.0, max_yaw_rate_rad_s=0.5)
    flown = fly(world, flight, pose(0, 0, 6), to((2.0, 0.0, 6.0), (2.0, 2.0, 6.0)))
    assert flown.pose.yaw == pytest.approx(math.pi / 2)
    assert flown.flight_s == pytest.approx(2.0 + 2.0 + math.pi)


def test_an_empty_path_only_turns(world: World) -> None:
    flown = fly(world, Flight(max_yaw_rate_rad_s=1.0), pose(0, 0, 6, 3.0), to(yaw=-3.0))
    assert (flown.pose.x, flown.pose.y, flown.pose.z) == (0, 0, 6)
    assert flown.pose.yaw == pytest.approx(-3.0)
    assert flown.flight_s == pytest.approx(2 * math.pi - 6.0)
    assert fly(world, Flight(), pose(0, 0, 6, 3.0), Move()).pose.yaw == pytest.approx(3.0)


def test_a_climb_keeps_the_nose_where_it_points(world: World) -> None:
    assert fly(world, Flight(), pose(0, 0, 2, 0.7), to((0.0, 0.0, 9.0))).pose.yaw == pytest.approx(0.7)


def test_rays_name_the_first_thing_and_never_the_drone(world: World) -> None:
    world.clearance_m((2.0, 0.0, 6.0))  # leaves the sphere right on the ray
    ends = [(20.0, 0.0, 6.0), (4.9, 0.0, 6.0), (0.0, 0.0, -1.0)]
    assert world.first_hits((0.0, 0.0, 6.0), ends) == [Hit(1, "house"), None, Hit(0, GROUND)]


def test_worlds_are_isolated_from_each_other(world: World) -> None:
    other = World(Blueprint([], half_size_m=40.0, roof_m=0.0), radius_m=0.35)
    try:
        assert fly(other, Flight(), pose(0, 0, 6), to((20.0, 0.0, 6.0))).hit is None
        assert fly(world, Flight(), pose(0, 0, 6), to((20.0, 0.0, 6.0))).hit == "house"
    finally:
        other.close()


def test_a_closed_world_answers_nothing_and_may_be_closed_twice(world: World) -> None:
    world.close()
    world.close()
    with pytest.raises(pybullet.error):
        world.clearance_m((0.0, 0.0, 6.0))


def test_a_hundred_worlds_leave_no_memory_behind() -> None:
    corners = np.random.default_rng(7).uniform(0.0, 9.0, (2_000, 3))
    rough = Solid(1, "rough", corners, np.arange(1_998).reshape(-1, 3).astype(np.int32))

    def build(worlds: int) -> None:
        for _ in range(worlds):
            World(Blueprint([rough], half_size_m=40.0, roof_m=9.0), radius_m=0.35).close()

    build(10)
    before = resident_mb()
    build(100)
    assert resident_mb() - before < 5.0  # where lists stay behind it is over 40


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20
