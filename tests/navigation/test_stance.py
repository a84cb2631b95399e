"""Which walls stand about the drone, and what a good place before one is."""

import math

import pytest

from navigation.camera import Pose, pinhole
from navigation.stance import StandOff, free_way_m, wall_ahead, walls_about
from tests.navigation.raycast_world import Prism, World, rectangle

GROUND = Pose(0.0, 0.0, 1.2, math.pi / 2)
CAMERA = pinhole(160, 160, 90.0)
HOUSE = Prism(rectangle(0.0, 14.0, 20.0, 10.0), 0.0, 15.0)
CAR = Prism(rectangle(0.0, 5.0, 4.5, 1.8), 0.0, 1.5)


def _views(pose: Pose, *prisms: Prism):
    return list(World(prisms, ground=True).views(pose, CAMERA).values())


@pytest.mark.parametrize("off_deg", [-50.0, -40.0, 0.0, 45.0])
def test_however_the_drone_is_turned_it_knows_how_to_face_the_facade(off_deg: float) -> None:
    pose = GROUND._replace(yaw=GROUND.yaw + math.radians(off_deg))
    wall = wall_ahead(walls_about(_views(pose, HOUSE), pose))
    assert wall is not None
    assert wall.facing_yaw == pytest.approx(math.pi / 2, abs=0.05)
    assert wall.distance_m == pytest.approx(9.0, abs=0.2)


def test_a_car_before_the_house_is_no_wall_and_a_one_storey_house_is_one() -> None:
    assert walls_about(_views(GROUND, CAR), GROUND) == []
    hut = Prism(rectangle(0.0, 10.0, 4.0, 4.0), 0.0, 3.0)
    assert walls_about(_views(GROUND, hut), GROUND)[0].distance_m == pytest.approx(8.0, abs=0.2)


def test_a_drone_that_faces_away_has_nothing_ahead() -> None:
    away = GROUND._replace(yaw=-math.pi / 2)
    assert wall_ahead(walls_about(_views(away, HOUSE), away)) is None


@pytest.mark.parametrize(
    ("reach_m", "distance_m", "goal_m"),
    [(40.0, 9.0, None), (40.0, 1.2, 7.0), (40.0, 34.0, 10.0), (10.0, 9.0, 5.2), (10.0, 5.0, None), (10.0, 2.0, 5.2)],
)
def test_too_near_and_too_far_by_what_the_sensor_reaches(
    reach_m: float, distance_m: float, goal_m: float | None
) -> None:
    assert StandOff.within(reach_m).goal_m(distance_m) == (None if goal_m is None else pytest.approx(goal_m))


def test_a_way_is_as_free_as_it_is_seen_to_be() -> None:
    views = _views(GROUND, HOUSE, CAR)
    assert free_way_m(views, GROUND.z, 0.0, 8.0, 0.85) == pytest.approx(4.1 - 0.85, abs=0.4)
    assert free_way_m(views, GROUND.z, -90.0, 8.0, 0.85) == 8.0
    assert free_way_m(views, GROUND.z, 180.0, 8.0, 0.85) == 0.0


def test_a_little_farther_off_is_right_where_what_hangs_over_the_drone_makes_it_so() -> None:
    stand_off = StandOff.within(10.0)
    assert stand_off.goal_m(7.0) == pytest.approx(stand_off.good_m)
    assert stand_off.goal_m(7.0, more_m=3.0) is None
    assert stand_off.goal_m(9.0, more_m=3.0) == pytest.approx(stand_off.good_m)
    assert stand_off.goal_m(2.0, more_m=3.0) is not None
