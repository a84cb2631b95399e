"""Rain in a picture, and in what a time-of-flight camera measures; fog in front of one."""

import numpy as np

from contracts.scene import Air
from contracts.sensor_profiles import StereoDepth, TimeOfFlightDepth, shipped_sensors
from services.sim.sensors.chance import generator
from services.sim.sensors.depth import FOG_REACH, Frame, sensed_depth
from services.sim.sensors.rain import rained

DARK = np.full((400, 400, 3), 60, np.uint8)
TOF = shipped_sensors("tof-10m").depth
D455 = shipped_sensors("d455").depth


def wall(depth_m: float) -> Frame:
    checkers = ((np.indices((400, 400)).sum(axis=0) // 2) % 2 * 120 + 60).astype(np.uint8)
    return Frame(np.repeat(checkers[..., None], 3, axis=2), np.full((400, 400), depth_m / 0.002, np.uint16), None)


def test_more_rain_more_streaks_all_of_them_brighter_than_what_is_behind() -> None:
    covered = []
    for rain_mm_h in (2.0, 20.0, 80.0):
        seen = rained(DARK, 200.0, rain_mm_h, 0.008, np.random.default_rng(3))
        assert (seen >= DARK).all()
        covered.append((seen > DARK).mean())
    assert 0.0 < covered[0] < covered[1] < covered[2] < 0.5


def test_streaks_follow_from_the_generator_alone() -> None:
    one, two, other = (rained(DARK, 200.0, 20.0, 0.008, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)


def test_drops_answer_light_that_is_sent_out_and_two_cameras_do_not_see_them() -> None:
    storm = Air(rain_mm_h=100.0)
    assert isinstance(TOF, TimeOfFlightDepth)
    assert isinstance(D455, StereoDepth)
    near = [
        (sensed_depth(wall(8.0), sensor, generator((1,), 1, "front"), storm) * 0.002 < 6.5).mean()
        - (sensed_depth(wall(8.0), sensor, generator((1,), 1, "front")) * 0.002 < 6.5).mean()
        for sensor in (TOF, D455)
    ]
    assert 0.0004 < near[0] < 0.003
    assert near[1] == 0.0


def test_light_that_is_sent_out_does_not_come_back_through_thick_fog() -> None:
    fog = Air(visibility_m=24.0)
    assert isinstance(TOF, TimeOfFlightDepth)
    beyond, within = (
        sensed_depth(wall(depth_m), TOF, generator((1,), 1, "front"), fog)
        for depth_m in (24.0 * FOG_REACH + 0.5, 24.0 * FOG_REACH - 0.5)
    )
    assert not beyond.any()
    assert (within > 0).mean() > 0.95
