"""What a real colour camera makes of a picture: exposure, motion blur, rolling shutter, noise."""

import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.sensor_profiles import PictureSensor
from services.sim.sensors.chance import BANK_CODES_PER_SIGMA, white

Rgb = NDArray[np.uint8]
_LEAST_SIGMA = 0.25
"""In grey levels: less does not show, and its codes would not fit into 16 bits."""
_STILL_PX = 0.3
_LEAN_PX = 0.75
"""Less from the first row to the last does not show."""


class Motion(NamedTuple):
    """How the picture moves over the sensor while it is taken, pixels a second: to the right and down."""

    right_px_s: float
    down_px_s: float


def motion_of(camera: Camera, yaw_rate_rad_s: float, aside_m_s: float, up_m_s: float, depth_m: float) -> Motion:
    """Of a camera that turns left with `yaw_rate_rad_s` and moves to its own right and up, before things that are
    `depth_m` away."""
    return Motion(
        camera.fx_px * (yaw_rate_rad_s - aside_m_s / depth_m),
        camera.fy_px * up_m_s / depth_m,
    )


def sensed_picture(rgb: Rgb, camera: Camera, sensor: PictureSensor, motion: Motion, rng: np.random.Generator) -> Rgb:
    """(H, W, 3) uint8."""
    if sensor.ideal:
        return rgb
    tremble = rng.normal(0.0, math.radians(sensor.vibration_deg_s), 2)
    right = motion.right_px_s + float(tremble[0]) * camera.fx_px
    down = motion.down_px_s + float(tremble[1]) * camera.fy_px
    seen = _rolled(rgb, right * sensor.rolling_shutter_s, down * sensor.rolling_shutter_s)
    seen = _blurred(seen, right * sensor.exposure_s, down * sensor.exposure_s)
    stops = float(rng.normal(0.0, sensor.exposure_ev)) if sensor.exposure_ev else 0.0
    return _noisy(seen, sensor, round(stops, 2), rng)


def _rolled(rgb: Rgb, right_px: float, down_px: float) -> Rgb:
    """Row after row the picture has moved on: it leans, and is stretched or pressed together."""
    if abs(right_px) < _LEAN_PX and abs(down_px) < _LEAN_PX:
        return rgb
    height, width = rgb.shape[:2]
    lean, stretch = right_px / height, down_px / height
    matrix = np.array([[1.0, lean, -right_px / 2], [0.0, 1.0 + stretch, -down_px / 2]])
    return np.asarray(cv2.warpAffine(rgb, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _blurred(rgb: Rgb, right_px: float, down_px: float) -> Rgb:
    """Averaged over the way that the picture moves while the shutter is open."""
    across, down = _box(right_px), _box(down_px)
    if across is None and down is None:
        return rgb
    one = np.ones(1, np.float32)
    return np.asarray(
        cv2.sepFilter2D(rgb, -1, one if across is None else across, one if down is None else down), np.uint8
    )


def _box(length_px: float) -> NDArray[np.float32] | None:
    """A box of that length, its ends shared with the next pixels; null for less than a third of a pixel."""
    length = min(abs(length_px), 61.0)
    if length < _STILL_PX:
        return None
    whole = max(0, math.ceil((length - 1.0) / 2.0))
    weights = np.ones(2 * whole + 1, np.float32)
    weights[[0, -1]] = 1.0 if whole == 0 else (length - (2 * whole - 1)) / 2.0
    if whole == 0:
        rim = length / 4.0
        weights = np.array([rim, 1.0 - 2 * rim, rim], np.float32)
    return np.asarray(weights / weights.sum(), np.float32)


def _noisy(rgb: Rgb, sensor: PictureSensor, stops: float, rng: np.random.Generator) -> Rgb:
    tables = _tables(sensor.read_noise, sensor.shot_noise, stops)
    if tables.to_grey is None:
        return np.asarray(cv2.LUT(rgb, tables.even.astype(np.uint8)), np.uint8)
    height, width, bands = rgb.shape
    noisy = np.asarray(cv2.LUT(rgb, tables.even), np.int16)
    noisy += white(rng, height * width * bands).reshape(height, width, bands)
    return np.asarray(cv2.LUT(noisy.view(np.uint16), tables.to_grey), np.uint8)


class _Tables(NamedTuple):
    """`even` (1, 256) int16: grey, exposed, in the measure in which noise is even, BANK_CODES_PER_SIGMA to the standard
    deviation; `to_grey` (65536,) back, uint8, by the bits of a signed number, null without noise, where the measure is
    grey itself."""

    even: NDArray[np.int16]
    to_grey: NDArray[np.uint8] | None


@lru_cache(maxsize=512)
def _tables(read: float, shot: float, stops: float) -> _Tables:
    """sigma(I)^2 = read^2 + shot^2 I: the measure is the integral of dI / sigma(I)."""
    grey = np.clip(np.arange(256) * 2.0**stops, 0.0, 255.0)
    if read == 0.0 and shot == 0.0:
        return _Tables(np.rint(grey).astype(np.int16).reshape(1, 256), None)
    fine = np.linspace(-32.0, 287.0, 8_000)
    sigma = np.maximum(np.sqrt(read**2 + shot**2 * np.maximum(fine, 0.0)), _LEAST_SIGMA)
    steps = np.diff(fine) / ((sigma[1:] + sigma[:-1]) / 2)
    measure = BANK_CODES_PER_SIGMA * np.concatenate([[0.0], np.cumsum(steps)])
    even = np.rint(np.interp(grey, fine, measure)).astype(np.int16).reshape(1, 256)
    signed = np.arange(65_536, dtype=np.uint16).view(np.int16)
    back = np.interp(signed, measure, fine)
    return _Tables(even, np.clip(np.rint(back), 0, 255).astype(np.uint8))
