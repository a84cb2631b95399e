"""NED and degrees on one side, ENU and radians on the other, and what lies between a local frame and a mission's."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.geometry import Point3, Pose
from episode_kit.kinematics import wrapped
from services.mavlink_vehicle.frames import Alignment, Enu, Ned, enu_of, heading_of, ned_of, yaw_of

metres = st.floats(-1_500.0, 1_500.0)
degrees = st.floats(-720.0, 720.0)
radians = st.floats(-20.0, 20.0)
quickly = settings(deadline=None, max_examples=60)
neds = st.builds(Ned, metres, metres, metres, degrees)
enus = st.builds(Enu, metres, metres, metres, radians)
poses = st.builds(Pose, x=metres, y=metres, z=metres, yaw=radians)


def same_angle(a: float, b: float) -> bool:
    return abs(wrapped(a - b)) < 1e-9


@quickly
@given(neds)
def test_ned_to_enu_and_back_is_the_same_place_and_heading(ned: Ned) -> None:
    back = ned_of(enu_of(ned))
    assert back[:3] == ned[:3]
    assert same_angle(math.radians(back.heading_deg), math.radians(ned.heading_deg))
    assert -180.0 < back.heading_deg <= 180.0


@quickly
@given(enus)
def test_enu_to_ned_and_back_is_the_same_place_and_yaw(enu: Enu) -> None:
    back = enu_of(ned_of(enu))
    assert back[:3] == enu[:3]
    assert same_angle(back.yaw, enu.yaw)
    assert -math.pi < back.yaw <= math.pi


@pytest.mark.parametrize(
    ("heading_deg", "yaw"), [(0.0, math.pi / 2), (90.0, 0.0), (180.0, -math.pi / 2), (-90.0, math.pi), (270.0, math.pi)]
)
def test_north_east_south_and_west(heading_deg: float, yaw: float) -> None:
    assert yaw_of(heading_deg) == pytest.approx(yaw)
    assert same_angle(math.radians(heading_of(yaw)), math.radians(heading_deg))


@quickly
@given(neds, neds)
def test_a_step_north_is_a_step_along_y_and_a_step_down_one_against_z(a: Ned, b: Ned) -> None:
    p, q = enu_of(a), enu_of(b)
    assert (q.north_m - p.north_m, q.east_m - p.east_m) == (b.north_m - a.north_m, b.east_m - a.east_m)
    assert q.up_m - p.up_m == a.down_m - b.down_m


@quickly
@given(enus, poses)
def test_an_alignment_brings_one_place_to_the_other_heading_included(local: Enu, pose: Pose) -> None:
    there = Alignment.between(local, pose).pose(local)
    assert (there.x, there.y, there.z) == pytest.approx((pose.x, pose.y, pose.z), abs=1e-6)
    assert same_angle(there.yaw, pose.yaw)


@quickly
@given(enus, poses, enus)
def test_what_is_aligned_and_sent_back_is_where_it_was(local: Enu, pose: Pose, other: Enu) -> None:
    alignment = Alignment.between(local, pose)
    there = alignment.pose(other)
    back = alignment.local(there, there.yaw)
    assert back[:3] == pytest.approx(other[:3], abs=1e-6)
    assert same_angle(back.yaw, other.yaw)


@quickly
@given(enus, poses, enus, enus)
def test_an_alignment_keeps_distances_and_heights(local: Enu, pose: Pose, a: Enu, b: Enu) -> None:
    alignment = Alignment.between(local, pose)
    p, q = alignment.pose(a), alignment.pose(b)
    assert math.dist((p.x, p.y, p.z), (q.x, q.y, q.z)) == pytest.approx(math.dist(a[:3], b[:3]), abs=1e-6)
    assert q.z - p.z == pytest.approx(b.up_m - a.up_m, abs=1e-6)


@quickly
@given(enus)
def test_without_a_scene_east_stays_east_and_the_start_is_the_origin(local: Enu) -> None:
    pose = Alignment.from_origin(local, 0.35).pose(local)
    assert (pose.x, pose.y, pose.z) == pytest.approx((0.0, 0.0, 0.35), abs=1e-9)
    assert same_angle(pose.yaw, local.yaw)
    east = Alignment.from_origin(local, 0.35).local(Point3(x=1.0, y=0.0, z=0.35), 0.0)
    assert east.east_m - local.east_m == pytest.approx(1.0, abs=1e-6)
