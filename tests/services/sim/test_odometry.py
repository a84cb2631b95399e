"""Odometry that drifts: what the drone is told, and what is true."""

import math

import numpy as np
import pytest

from contracts.geometry import Point3, Pose
from contracts.scene import Scene
from contracts.sensor_profiles import PoseSensor
from contracts.sim import Claim, EpisodeQuestion, Flight
from contracts.vehicle import Move, MoveResult
from episode_kit.odometry import Odometry, Way
from services.sim.episode import LiveEpisode
from services.sim.scenes import make_ready
from tests.services.sim.conftest import build_boxes

HERE = Pose(x=1.0, y=2.0, z=3.0, yaw=0.5)


REAL = PoseSensor(
    horizontal_noise_m=0.02,
    vertical_noise_m=0.03,
    yaw_noise_deg=0.5,
    drift=0.02,
    vertical_drift=0.01,
    yaw_drift_deg_per_m=0.1,
)


def test_the_error_is_the_share_of_the_way_flown_and_leaves_height_and_heading_alone() -> None:
    odometry = Odometry(PoseSensor(), 0.02, (7, 0))
    odometry.flown(HERE, Way(horizontal_m=30.0))
    odometry.flown(HERE, Way(horizontal_m=20.0))
    believed = odometry.believed(HERE)
    assert math.dist((believed.x, believed.y), (HERE.x, HERE.y)) == pytest.approx(1.0)
    assert (believed.z, believed.yaw) == (HERE.z, HERE.yaw)
    back = odometry.true(Point3(x=believed.x, y=believed.y, z=believed.z))
    assert (back.x, back.y) == pytest.approx((HERE.x, HERE.y))


def test_the_direction_hangs_on_the_seeds_alone() -> None:
    def after(*seeds: int) -> tuple[float, float]:
        odometry = Odometry(PoseSensor(), 0.01, seeds)
        odometry.flown(HERE, Way(horizontal_m=10.0))
        return odometry.believed(HERE).x, odometry.believed(HERE).y

    assert after(1, 2) == after(1, 2)
    assert len({after(k, 0) for k in range(5)}) == 5


def test_a_turned_frame_keeps_what_is_beside_the_drone_where_it_says() -> None:
    odometry = Odometry(REAL, 0.0, (3,), start=(HERE.x, HERE.y))
    odometry.flown(HERE, Way(40.0, 40.0, 20.0))
    believed = odometry.believed(HERE)
    assert abs(believed.yaw - HERE.yaw) == pytest.approx(math.radians(4.0))
    assert abs(believed.z - HERE.z) == pytest.approx(0.4)
    # five metres ahead of where it believes to be and to look are five metres ahead of where it is and looks
    ahead = Point3(x=believed.x + 5 * math.cos(believed.yaw), y=believed.y + 5 * math.sin(believed.yaw), z=believed.z)
    true = odometry.true(ahead)
    assert (true.x, true.y, true.z) == pytest.approx(
        (HERE.x + 5 * math.cos(HERE.yaw), HERE.y + 5 * math.sin(HERE.yaw), HERE.z)
    )
    assert odometry.true_yaw(believed.yaw) == pytest.approx(HERE.yaw)


def test_what_is_believed_runs_on_without_a_leap_from_one_flight_to_the_next() -> None:
    odometry = Odometry(REAL, 0.0, (5,))
    for k in range(1, 4):
        there, way = HERE.model_copy(update={"x": 10.0 * k, "yaw": 0.3 * k}), Way(10.0, 9.0, 5.0)
        before = odometry.believed(there, way)
        odometry.flown(there, way)
        after = odometry.believed(there)
        assert (after.x, after.y, after.z, after.yaw) == pytest.approx((before.x, before.y, before.z, before.yaw))


def test_jumps_come_as_often_as_the_sensor_says() -> None:
    odometry = Odometry(PoseSensor(jumps_per_minute=6.0, jump_m=1.0), 0.0, (9,))
    leaps = 0
    for _ in range(1000):
        before = odometry.believed(HERE)
        odometry.flown(HERE, Way(flight_s=1.0))
        after = odometry.believed(HERE)
        leaps += math.dist((before.x, before.y), (after.x, after.y)) > 0.01
    assert 70 < leaps < 130


def test_a_reading_has_the_noise_of_its_number() -> None:
    odometry = Odometry(REAL, 0.0, (1,), noise_seed=4)
    read = [odometry.reading(HERE, (0, look)) for look in range(400)]
    assert odometry.reading(HERE, (0, 7)) == read[7]
    assert np.std([pose.x for pose in read]) == pytest.approx(0.02, rel=0.15)
    assert np.std([pose.z for pose in read]) == pytest.approx(0.03, rel=0.15)
    assert np.std([pose.yaw for pose in read]) == pytest.approx(math.radians(0.5), rel=0.15)


def _episode(scene: Scene, drift: float) -> LiveEpisode:
    question = EpisodeQuestion(scene=scene, flight=Flight(drift=drift))
    return LiveEpisode("e", make_ready(scene, build_boxes), question, "tiny", "")


def _moved(episode: LiveEpisode, number: int, *path: Point3) -> MoveResult:
    assert episode.begin(number, Move(path=path)) is None
    assert episode.advance(math.inf)
    return episode.result(number)


def test_the_reported_pose_strays_while_moves_and_pictures_stay_true(yard: Scene) -> None:
    episode = _episode(yard, 0.02)
    try:
        told = episode.state().pose
        path = (Point3(x=told.x, y=told.y, z=7.65), Point3(x=told.x, y=told.y + 8.0, z=7.65))
        result = _moved(episode, 1, *path)
        # told to fly 8 m, it did; it only believes to be elsewhere
        assert episode.drone.pose.y == pytest.approx(told.y + 8.0)
        assert math.dist((result.pose.x, result.pose.y), (episode.drone.pose.x, episode.drone.pose.y)) == pytest.approx(
            0.16
        )
        assert result.vehicle.pose == result.pose
        # a step of 1 m from where it believes to be is a true metre
        again = Point3(x=result.pose.x - 1.0, y=result.pose.y, z=result.pose.z)
        before = episode.drone.pose
        _moved(episode, 2, again)
        assert episode.drone.pose.x == pytest.approx(before.x - 1.0)
        assert episode.drone.pose.y == pytest.approx(before.y)
    finally:
        episode.close()


def test_a_claim_is_judged_by_the_true_pose_and_means_what_is_seen_beside_the_drone(yard: Scene) -> None:
    for drift in (0.0, 0.1):
        episode = _episode(yard, drift)
        try:
            x, y = 0.0, -7.0
            _moved(episode, 1, Point3(x=0.0, y=-15.0, z=7.65), Point3(x=x, y=y, z=7.65))
            off = (episode.state().pose.x - episode.drone.pose.x, episode.state().pose.y - episode.drone.pose.y)
            verdict = episode.claim(Claim(target=Point3(x=off[0], y=-5.3 + off[1], z=7.1)))
            assert verdict.delivered
            assert verdict.distance_m == pytest.approx(2.0, abs=0.01)
        finally:
            episode.close()
