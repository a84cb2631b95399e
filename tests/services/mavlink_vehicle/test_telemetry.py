"""Poses of the last seconds: asked for a moment between two of them; and who flies, by the modes that are told."""

import math
from types import SimpleNamespace
from typing import cast

import pytest
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

from services.mavlink_vehicle.control import Control
from services.mavlink_vehicle.frames import Enu
from services.mavlink_vehicle.listener import Listener
from services.mavlink_vehicle.telemetry import NoPose, PoseHistory, Telemetry


class Clock:
    """A clock that a test turns."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def history(*poses: tuple[float, float, float]) -> PoseHistory:
    kept = PoseHistory()
    for time_s, east_m, yaw in poses:
        kept.add(time_s, Enu(east_m, 0.0, 2.0, yaw))
    return kept


def test_a_pose_is_interpolated_to_the_moment_of_a_picture() -> None:
    kept = history((10.0, 0.0, 0.0), (10.1, 1.0, 0.2))
    assert kept.at(10.025) == pytest.approx((0.25, 0.0, 2.0, 0.05))
    assert kept.at(10.0).east_m == 0.0


def test_a_heading_is_interpolated_the_short_way_round() -> None:
    kept = history((10.0, 0.0, math.pi - 0.1), (10.1, 0.0, -math.pi + 0.1))
    assert abs(kept.at(10.05).yaw) == pytest.approx(math.pi)


def test_a_moment_of_which_nothing_is_known_is_refused_with_what_is() -> None:
    kept = history((10.0, 0.0, 0.0), (10.1, 1.0, 0.0), (11.0, 2.0, 0.0))
    with pytest.raises(NoPose, match=r"no position is kept of 2\.0 s ago"):
        kept.at(9.0)
    with pytest.raises(NoPose, match="older than the moment"):
        kept.at(12.0)
    with pytest.raises(NoPose, match=r"no position was told for 0\.9 s"):
        kept.at(10.5)
    with pytest.raises(NoPose, match="has not said where it is"):
        PoseHistory().at(10.0)


def test_a_moment_just_after_the_last_pose_takes_that_one() -> None:
    assert history((10.0, 3.0, 0.0)).at(10.2).east_m == 3.0


def told(telemetry: Telemetry, clock: Clock, mode: str, after_s: float = 0.1) -> None:
    clock.now += after_s
    telemetry.mode, telemetry.mode_told_s = mode, clock.now  # type: ignore[assignment]


def test_a_stick_that_is_moved_is_the_pilots_at_once(clock: Clock) -> None:
    telemetry = Telemetry(clock)
    control = Control(telemetry)
    told(telemetry, clock, "hold")
    control.expect("offboard")
    told(telemetry, clock, "posctl")
    control.check()
    assert control.taken is not None
    assert "the pilot has taken over: its mode is POSCTL" in control.taken
    assert control.in_hand() == "taken"


def test_the_mode_from_before_a_command_may_be_told_a_moment_longer_and_no_more(clock: Clock) -> None:
    telemetry = Telemetry(clock)
    control = Control(telemetry)
    told(telemetry, clock, "hold")
    control.expect("offboard")
    told(telemetry, clock, "hold", 1.0)
    control.check()
    assert control.ours
    told(telemetry, clock, "hold", 3.0)
    control.check()
    assert control.taken is not None


def test_a_failsafe_after_the_mode_was_confirmed_is_somebody_elses_with_its_words(clock: Clock) -> None:
    telemetry = Telemetry(clock)
    control = Control(telemetry)
    control.expect("offboard")
    told(telemetry, clock, "offboard")
    control.check()
    telemetry.warned("Low battery: returning")
    told(telemetry, clock, "return_to_launch")
    control.check()
    assert control.taken is not None
    assert "RETURN_TO_LAUNCH (Low battery: returning)" in control.taken


def test_whoever_has_it_keeps_it_until_the_mission_is_over(clock: Clock) -> None:
    telemetry = Telemetry(clock)
    control = Control(telemetry)
    control.expect("offboard")
    told(telemetry, clock, "manual")
    control.check()
    told(telemetry, clock, "offboard")
    control.check()
    assert control.in_hand() == "taken"
    control.leave()
    assert control.in_hand() == "free"


def test_a_position_that_moves_faster_than_the_drone_has_leapt(clock: Clock) -> None:
    telemetry = Telemetry(clock, yaw=0.0, armed=True, landed=False)
    for east_m in (0.0, 0.3, 0.6):
        clock.now += 0.1
        telemetry.moved(Enu(east_m, 0.0, 2.0, 0.0), 3.0)
    assert telemetry.leapt_m is None
    clock.now += 0.1
    telemetry.moved(Enu(5.0, 0.0, 2.0, 0.0), 3.0)
    assert telemetry.leapt_m == pytest.approx(4.4)


def test_how_often_poses_come_is_told_by_the_last_seconds() -> None:
    assert history().rate_hz == 0.0
    assert history(*((10.0 + 0.25 * i, 0.0, 0.0) for i in range(9))).rate_hz == pytest.approx(4.0)


def test_of_several_batteries_the_emptiest_counts_and_one_that_tells_nothing_does_not() -> None:
    listener = Listener(cast(TelemetryAsync, None), Telemetry())
    for number, percent, volts in ((0, 80.0, 15.9), (1, -1.0, 12.0), (2, 30.0, 15.1), (1, math.nan, 12.0)):
        listener._drained(SimpleNamespace(id=number, remaining_percent=percent, voltage_v=volts))
    assert (listener.telemetry.remaining, listener.telemetry.voltage_v) == (0.3, 15.1)
    alone = Listener(cast(TelemetryAsync, None), Telemetry())
    alone._drained(SimpleNamespace(id=0, remaining_percent=-1.0, voltage_v=15.2))
    assert (alone.telemetry.remaining, alone.telemetry.voltage_v) == (None, 15.2)


def test_an_estimate_that_is_set_anew_while_the_drone_stands_has_not_leapt(clock: Clock) -> None:
    telemetry = Telemetry(clock, yaw=0.0, landed=True)
    for east_m in (0.0, 40.0):
        clock.now += 0.1
        telemetry.moved(Enu(east_m, 0.0, 2.0, 0.0), 0.0)
    assert telemetry.leapt_m is None
