"""Places, as the drone sees them."""

import pytest

from contracts.geometry import Point3, Pose
from mission.places import apart_deg
from mission.stage_actions.searching import ONE_DIRECTION_DEG

HERE = Pose(x=1.0, y=2.0, z=3.0, yaw=0.7)


def test_the_angle_between_two_places_does_not_depend_on_how_far_they_are() -> None:
    near, far = Point3(x=3.0, y=2.0, z=3.0), Point3(x=1.0, y=2.0, z=13.0)
    assert apart_deg(HERE, near, far) == pytest.approx(90.0)
    assert apart_deg(HERE, near, Point3(x=0.0, y=2.0, z=3.0)) == pytest.approx(180.0)


def test_one_thing_put_at_two_depths_lies_in_one_direction_and_two_windows_do_not() -> None:
    near, behind = Point3(x=7.0, y=2.0, z=3.0), Point3(x=13.0, y=2.5, z=3.0)
    assert apart_deg(HERE, near, behind) < ONE_DIRECTION_DEG
    assert apart_deg(HERE, near, Point3(x=7.0, y=5.0, z=3.0)) > ONE_DIRECTION_DEG
