"""A quadrotor that follows its course by thrust and tilt, in still air and in wind."""

import math

import numpy as np
import pytest

from contracts.geometry import Point3, Pose
from contracts.scene import Air, Scene, Wind
from contracts.sim import EpisodeQuestion, Flight
from contracts.vehicle import Move
from episode_kit.kinematics import Vector
from service_kit.errors import Conflict
from services.sim.dynamic_flight import DynamicFlight, Pilot
from services.sim.episode import LiveEpisode
from services.sim.scenes import make_ready
from services.sim.wind import DT_S, GUST_TIME_S, Gusts
from services.sim.world import Sweep
from tests.services.sim.conftest import build_boxes, make_yard

START = Pose(x=0.0, y=0.0, z=5.0, yaw=0.0)
STORM = Wind(speed_m_s=8.0, towards=3.0, gusts_m_s=2.0)


class OpenAir:
    def sweep(self, start: Vector, end: Vector) -> Sweep:
        return Sweep(math.dist(start, end), None)


class WallAt:
    """Stops whatever flies past x."""

    def __init__(self, x: float) -> None:
        self._x = x

    def sweep(self, start: Vector, end: Vector) -> Sweep:
        length = math.dist(start, end)
        if end[0] < self._x:
            return Sweep(length, None)
        return Sweep(length * max(0.0, self._x - start[0]) / max(1e-9, end[0] - start[0]), "wall")


def flown(wind: Wind, *, yaw: float | None = None, seed: int = 1) -> DynamicFlight:
    return Pilot(OpenAir(), Flight(), wind, (seed,)).plan(START, [(6.0, 0.0, 5.0)], yaw)


@pytest.mark.parametrize("wind", [Wind(), Wind(speed_m_s=5.0, towards=1.0, gusts_m_s=1.0)])
def test_it_arrives_near_the_place_and_turned_as_wanted(wind: Wind) -> None:
    flight = flown(wind, yaw=1.2)
    end = flight.end
    assert math.dist((end.pose.x, end.pose.y, end.pose.z), (6.0, 0.0, 5.0)) < 0.3
    assert end.pose.yaw == pytest.approx(1.2, abs=0.05)
    assert end.hit is None
    assert end.flight_s == flight.duration_s


def test_it_overshoots_a_little_and_comes_back() -> None:
    flight = flown(Wind())
    furthest = max(flight.at(t).pose.x for t in np.arange(0.0, flight.duration_s, 0.05))
    assert 0.05 < furthest - 6.0 < 0.6
    assert flight.end.pose.x < furthest


def test_wind_costs_battery_and_pushes_it_about() -> None:
    calm, storm = flown(Wind()), flown(STORM)
    effort = [f.end.effort_s / f.end.flight_s for f in (calm, storm) if f.end.effort_s is not None]
    assert effort[1] > effort[0] > 1.0

    def off_course(flight: DynamicFlight) -> float:
        return max(abs(flight.at(t).pose.y) for t in np.arange(0.0, flight.duration_s, 0.05))

    assert off_course(calm) < 0.05 < off_course(storm) < 1.5


def test_the_same_seeds_fly_the_same_and_others_do_not() -> None:
    assert flown(STORM).end == flown(STORM).end
    assert flown(STORM).end != flown(STORM, seed=2).end


def test_it_ends_where_it_touches_something() -> None:
    end = Pilot(WallAt(5.0), Flight(), Wind(), (1,)).plan(START, [(8.0, 0.0, 5.0)], None).end
    assert end.hit == "wall"
    assert end.pose.x == pytest.approx(5.0, abs=0.02)


def test_told_to_stop_it_brakes_within_a_few_metres() -> None:
    flight = flown(Wind())
    there, stopped = flight.at(1.4), flight.stopped_at(1.4)
    assert 0.3 < stopped.pose.x - there.pose.x < 4.5
    assert stopped.path_m > there.path_m
    assert stopped.flight_s > 1.4


def test_gusts_have_the_strength_and_the_memory_they_should() -> None:
    gusts = Gusts(Wind(speed_m_s=5.0, towards=0.0, gusts_m_s=1.5), (7,))
    blown = np.array([gusts.next() for _ in range(150_000)])
    assert blown.mean(axis=0) == pytest.approx((5.0, 0.0, 0.0), abs=0.4)
    assert blown.std(axis=0) == pytest.approx((1.5, 1.5, 0.75), rel=0.2)
    later = round(GUST_TIME_S / DT_S)
    swing = blown[:, 0] - blown[:, 0].mean()
    assert (swing[:-later] * swing[later:]).mean() / swing.var() == pytest.approx(math.exp(-1.0), abs=0.15)


def episode(scene: Scene, flight: Flight) -> LiveEpisode:
    return LiveEpisode("e", make_ready(scene, build_boxes), EpisodeQuestion(scene=scene, flight=flight), "tiny", "")


def end_of_a_move(scene: Scene, flight: Flight) -> Pose:
    live = episode(scene, flight)
    try:
        assert live.begin(1, Move(path=(Point3(x=0.0, y=-15.0, z=5.0),))) is None
        assert live.advance(math.inf)
        return live.drone.pose
    finally:
        live.close()


def test_a_scene_with_wind_is_flown_by_dynamics_and_one_without_is_not() -> None:
    windy = make_yard(air=Air(wind=Wind(speed_m_s=4.0)))
    assert end_of_a_move(make_yard(), Flight()).z == 5.0
    assert end_of_a_move(windy, Flight(model="kinematic")).z == 5.0
    for scene, flight in ((windy, Flight()), (make_yard(), Flight(model="quadrotor"))):
        assert 0.0 < abs(end_of_a_move(scene, flight).z - 5.0) < 0.3


def test_an_empty_battery_only_lands_and_the_reserve_is_told() -> None:
    live = episode(make_yard(), Flight(endurance_s=4.0, reserve=0.6))
    try:
        live.begin(1, Move(path=(Point3(x=0.0, y=-15.0, z=4.0),)))
        live.advance(math.inf)
        state = live.state()
        assert state.battery.reserve == 0.6
        assert state.battery.remaining is not None
        assert 0.0 < state.battery.remaining < 0.6
        assert state.health.problems == ("its battery is down to the reserve",)
        live.begin(2, Move(path=(Point3(x=0.0, y=-30.0, z=4.0),)))
        live.advance(math.inf)
        with pytest.raises(Conflict, match="the battery is empty: the drone only lands"):
            live.begin(3, Move(path=(Point3(x=0.0, y=-15.0, z=4.0),)))
        live.land()
        live.advance(math.inf)
        assert live.drone.landed
    finally:
        live.close()
