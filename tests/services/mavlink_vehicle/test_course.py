"""The set-point's own motion: straight legs, bounded speed and acceleration, a stop at every corner, then the turn."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.geometry import Point3, Pose
from episode_kit.kinematics import wrapped
from services.mavlink_vehicle.course import Course, FlightLimits, Part, course, distance_m

LIMITS = FlightLimits(speed_m_s=3.0, acceleration_m_s2=1.5, yaw_rate_rad_s=0.8, climb_m_s=2.0, sink_m_s=1.2)
START = Pose(x=1.0, y=2.0, z=3.0, yaw=0.5)
DT_S = 0.1
quickly = settings(deadline=None, max_examples=40)
corners = st.builds(Point3, x=st.floats(-60, 60), y=st.floats(-60, 60), z=st.floats(0.5, 40))
paths = st.lists(corners, max_size=5)


def flown(wanted: Course) -> list[Pose]:
    """The set-point at every step, corners waited for no longer than they take."""
    points = []
    for part in wanted.parts:
        steps = math.ceil(part.duration_s / DT_S) + 1
        points += [wanted.at(part, step * DT_S) for step in range(steps)]
    return points


@quickly
@given(paths, st.none() | st.floats(-6.0, 6.0))
def test_neither_speed_nor_turning_exceeds_its_limit_and_it_ends_at_the_end(path: list, yaw: float | None) -> None:
    wanted = course(START, path, yaw, LIMITS)
    points = flown(wanted) or [START]
    for a, b in pairwise(points):
        assert distance_m(a, b) <= LIMITS.speed_m_s * DT_S + 1e-6
        assert -LIMITS.sink_m_s * DT_S - 1e-6 <= b.z - a.z <= LIMITS.climb_m_s * DT_S + 1e-6
        assert abs(wrapped(b.yaw - a.yaw)) <= LIMITS.yaw_rate_rad_s * DT_S + 1e-6
    end = path[-1] if path else START
    assert math.dist((points[-1].x, points[-1].y, points[-1].z), (end.x, end.y, end.z)) < 2e-3
    if yaw is not None:
        assert abs(wrapped(points[-1].yaw - yaw)) < 1e-6


@quickly
@given(paths)
def test_acceleration_stays_within_its_limit(path: list) -> None:
    wanted = course(START, path, None, LIMITS)
    for part in wanted.parts:
        steps = range(math.ceil(part.duration_s / DT_S) + 2)
        way = [distance_m(part.start, wanted.at(part, step * DT_S)) for step in steps]
        speeds = [(b - a) / DT_S for a, b in pairwise(way)]
        assert all(abs(b - a) / DT_S <= LIMITS.acceleration_m_s2 + 1e-3 for a, b in pairwise(speeds))


@quickly
@given(corners, st.floats(0.0, 60.0))
def test_told_to_stop_it_brakes_on_its_leg_within_its_limit(corner: Point3, after_s: float) -> None:
    wanted = course(START, [corner], None, LIMITS)
    if not wanted.parts or wanted.parts[0].length_m < 0.1:
        return
    leg = wanted.parts[0]
    here, stop = wanted.at(leg, after_s), wanted.stop(leg, after_s)
    most_m = LIMITS.speed_m_s**2 / (2 * LIMITS.acceleration_m_s2)
    assert distance_m(here, stop) <= most_m + 0.1
    off_m = distance_m(leg.start, stop) + distance_m(stop, leg.end) - leg.length_m
    assert off_m == pytest.approx(0.0, abs=1e-6)


def test_without_a_yaw_the_nose_ends_where_the_last_level_leg_went() -> None:
    wanted = course(START, [Point3(x=1.0, y=12.0, z=3.0), Point3(x=1.0, y=12.0, z=9.0)], None, LIMITS)
    assert flown(wanted)[-1].yaw == pytest.approx(math.pi / 2)
    assert [type(part) for part in wanted.parts] == [Part] * 3


def test_an_empty_path_to_the_same_heading_is_no_course_at_all() -> None:
    assert course(START, [], 0.5, LIMITS).parts == ()
    assert course(START, [], None, LIMITS).parts == ()
    assert course(START, [Point3(x=1.0, y=2.0, z=3.0)], None, LIMITS).parts == ()
