"""What a real colour camera makes of a picture."""

import cv2
import numpy as np
import pytest

from contracts.cameras import default_rig
from contracts.sensor_profiles import PictureSensor, shipped_sensors
from services.sim.sensors.chance import generator
from services.sim.sensors.picture import Motion, motion_of, sensed_picture

CAMERA = default_rig().camera("front").scaled_to(200)
STILL = Motion(0.0, 0.0)


def grey(level: int) -> np.ndarray:
    return np.full((200, 200, 3), level, np.uint8)


def rng(look: int = 1) -> np.random.Generator:
    return generator((1,), look, "front")


def test_the_perfect_camera_gives_the_very_picture() -> None:
    picture = grey(90)
    assert sensed_picture(picture, CAMERA, PictureSensor(), Motion(500.0, 0.0), rng()) is picture


@pytest.mark.parametrize("level", [20, 80, 200])
def test_the_noise_is_that_of_reading_and_of_light(level: int) -> None:
    sensor = PictureSensor(read_noise=1.5, shot_noise=0.2)
    seen = sensed_picture(grey(level), CAMERA, sensor, STILL, rng()).astype(float)
    assert seen.mean() == pytest.approx(level, abs=0.3)
    assert seen.std() == pytest.approx(np.sqrt(1.5**2 + 0.2**2 * level + 1 / 12), rel=0.06)


def test_the_exposure_differs_from_look_to_look() -> None:
    sensor = PictureSensor(exposure_ev=0.3)
    levels = [sensed_picture(grey(80), CAMERA, sensor, STILL, rng(look)).mean() for look in range(60)]
    assert np.std(np.log2(np.array(levels) / 80)) == pytest.approx(0.3, rel=0.35)


def test_a_turn_smears_upright_edges_and_leaves_level_ones() -> None:
    upright, level = grey(40), grey(40)
    upright[:, 100:], level[100:] = 200, 200
    sensor, motion = PictureSensor(exposure_s=0.02), motion_of(CAMERA, 1.0, 0.0, 0.0, 5.0)
    assert motion.right_px_s == pytest.approx(100.0)
    smeared = sensed_picture(upright, CAMERA, sensor, motion_of(CAMERA, 5.0, 0.0, 0.0, 5.0), rng())
    assert 7 <= ((smeared[50, :, 0] > 45) & (smeared[50, :, 0] < 195)).sum() <= 12
    assert np.array_equal(sensed_picture(level, CAMERA, sensor, motion_of(CAMERA, 5.0, 0.0, 0.0, 5.0), rng()), level)


def test_a_rolling_shutter_leans_what_is_upright_while_the_drone_turns() -> None:
    picture = grey(40)
    picture[:, 90:110] = 200
    sensor = PictureSensor(rolling_shutter_s=0.02)
    leaning = sensed_picture(picture, CAMERA, sensor, Motion(500.0, 0.0), rng())
    top, bottom = (np.flatnonzero(leaning[row, :, 0] > 120).mean() for row in (5, 195))
    assert abs(top - bottom) == pytest.approx(10.0, abs=1.5)


def test_noise_costs_more_bytes_and_not_the_picture() -> None:
    x = np.linspace(0, 255, 200)
    picture = np.repeat(np.tile(x, (200, 1))[..., None], 3, axis=2).astype(np.uint8)
    seen = sensed_picture(picture, CAMERA, shipped_sensors("d455").picture, STILL, rng())
    assert cv2.PSNR(picture, seen) > 18
