import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from episode_kit.kinematics import (
    heading_of,
    speed_profile,
    straight_legs,
    turn_time_s,
    wrapped,
)

lengths = st.floats(0.01, 500.0)
speeds = st.floats(0.2, 20.0)
accelerations = st.floats(0.2, 20.0)


def test_a_long_leg_ramps_up_cruises_and_ramps_down() -> None:
    # 4 m/s at 2 m/s2: 2 s and 4 m for each ramp, the other 12 m at 4 m/s
    profile = speed_profile(20.0, 4.0, 2.0)
    assert profile.peak_m_s == pytest.approx(4.0)
    assert profile.ramp_s == pytest.approx(2.0)
    assert profile.cruise_s == pytest.approx(3.0)
    assert profile.duration_s == pytest.approx(7.0)


def test_a_short_leg_never_reaches_the_top_speed() -> None:
    # half of 2 m at 2 m/s2 takes 1 s and ends at 2 m/s
    profile = speed_profile(2.0, 4.0, 2.0)
    assert profile.peak_m_s == pytest.approx(2.0)
    assert profile.duration_s == pytest.approx(2.0)
    assert profile.cruise_s == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("time_s", "distance_m"),
    [(0.0, 0.0), (1.0, 1.0), (2.0, 4.0), (3.5, 10.0), (5.0, 16.0), (6.0, 19.0), (7.0, 20.0), (9.0, 20.0)],
)
def test_distance_over_time_follows_the_trapezoid(time_s: float, distance_m: float) -> None:
    profile = speed_profile(20.0, 4.0, 2.0)
    assert profile.distance_at(time_s) == pytest.approx(distance_m)
    if time_s <= profile.duration_s:
        assert profile.time_at(distance_m) == pytest.approx(time_s)


def test_no_way_takes_no_time() -> None:
    profile = speed_profile(0.0, 4.0, 2.0)
    assert profile.duration_s == 0.0
    assert profile.distance_at(1.0) == 0.0


@given(lengths, speeds, accelerations)
def test_neither_bound_is_ever_passed(length_m: float, speed: float, acceleration: float) -> None:
    profile = speed_profile(length_m, speed, acceleration)
    steps = 200
    dt = profile.duration_s / steps
    at = [profile.distance_at(i * dt) for i in range(steps + 1)]
    velocity = [(b - a) / dt for a, b in itertools.pairwise(at)]
    assert at[-1] == pytest.approx(length_m)
    assert max(velocity) <= speed * (1 + 1e-6)
    change = [abs(b - a) / dt for a, b in itertools.pairwise(velocity)]
    assert max(change) <= acceleration * (1 + 1e-3)


@given(lengths, speeds, accelerations, st.floats(0.0, 1.0))
def test_time_and_distance_are_each_others_inverse(
    length_m: float, speed: float, acceleration: float, share: float
) -> None:
    profile = speed_profile(length_m, speed, acceleration)
    assert profile.distance_at(profile.time_at(share * length_m)) == pytest.approx(share * length_m, abs=1e-6)


def test_legs_that_run_straight_on_are_one_leg() -> None:
    legs = straight_legs((0, 0, 2), [(1, 0, 2), (3, 0, 2), (3, 0, 2), (3, 2, 2)])
    assert [(leg.start, leg.end) for leg in legs] == [((0, 0, 2), (3, 0, 2)), ((3, 0, 2), (3, 2, 2))]


def test_flying_back_is_not_straight_on() -> None:
    assert len(straight_legs((0, 0, 2), [(2, 0, 2), (1, 0, 2)])) == 2


def test_a_path_that_goes_nowhere_has_no_legs() -> None:
    assert straight_legs((1, 1, 1), [(1, 1, 1)]) == []


def test_the_heading_is_that_of_the_last_horizontal_travel() -> None:
    assert heading_of(straight_legs((0, 0, 0), [(0, 4, 0), (0, 4, 5)])) == pytest.approx(math.pi / 2)
    assert heading_of(straight_legs((0, 0, 0), [(0, 0, 5)])) is None


def test_a_turn_goes_the_shorter_way_round() -> None:
    assert turn_time_s(math.radians(170), math.radians(-170), 0.5) == pytest.approx(math.radians(20) / 0.5)
    assert wrapped(3 * math.pi) == pytest.approx(math.pi)
    assert wrapped(-math.pi) == pytest.approx(math.pi)
