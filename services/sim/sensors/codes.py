"""Depth in the sensor's own measure, where its error is the same everywhere: disparity for two cameras, and for
time of flight the integral of dz / sigma(z). Both ways are tables, so that a picture costs two look-ups.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.images import DEPTH_METRES_PER_UNIT, INVALID, NO_RETURN
from contracts.sensor_profiles import StereoDepth, TimeOfFlightDepth

_STEPS_BITS = 3
_TOF_CODES_PER_SIGMA = 16.0
_MOST_CODES = 65_535


class Codes(NamedTuple):
    """`of_units` (65536,) uint16: the code of a depth in wire units, 0 for what is no depth or lies at infinity;
    `units_of` (65536,) uint16: the depth measured for a code, the same for all codes of one step, 0 outside the
    sensor's range. `sigma`: the error's standard deviation in codes."""

    of_units: NDArray[np.uint16]
    units_of: NDArray[np.uint16]
    sigma: float


@lru_cache(maxsize=16)
def codes_of(sensor: StereoDepth | TimeOfFlightDepth) -> Codes:
    """Made once for each sensor."""
    return _disparities(sensor) if isinstance(sensor, StereoDepth) else _times(sensor)


def _disparities(sensor: StereoDepth) -> Codes:
    codes_per_px = (1 << _STEPS_BITS) / sensor.disparity_step_px
    pixel_metres = sensor.focal_px * sensor.baseline_m
    depths = np.arange(65_536) * DEPTH_METRES_PER_UNIT
    with np.errstate(divide="ignore"):
        codes = np.minimum(codes_per_px * pixel_metres / depths, _MOST_CODES)
    codes[[INVALID, NO_RETURN]] = 0.0
    steps = np.arange(65_536 >> _STEPS_BITS) + 0.5 - 0.5 / (1 << _STEPS_BITS)
    measured = codes_per_px * pixel_metres / (steps * (1 << _STEPS_BITS))
    return Codes(
        np.rint(codes).astype(np.uint16),
        np.repeat(_units(measured, sensor), 1 << _STEPS_BITS),
        sensor.disparity_noise_px * codes_per_px,
    )


def _times(sensor: TimeOfFlightDepth) -> Codes:
    """sigma(z) = a + b z², so the measure is atan(z sqrt(b / a)) / sqrt(a b)."""
    a, b = sensor.noise_m, sensor.noise_per_m2
    depths = np.arange(65_536) * DEPTH_METRES_PER_UNIT
    scale = min(_TOF_CODES_PER_SIGMA, (_MOST_CODES - 1) * np.sqrt(a * b) / (np.pi / 2))
    codes = 1.0 + scale * np.arctan(depths * np.sqrt(b / a)) / np.sqrt(a * b)
    codes[[INVALID, NO_RETURN]] = 0.0
    turned = (np.arange(65_536) - 1.0) * np.sqrt(a * b) / scale
    measured = np.where(turned < np.pi / 2 - 1e-6, np.tan(np.clip(turned, 0.0, np.pi / 2 - 1e-6)), np.inf)
    return Codes(
        np.rint(codes).astype(np.uint16),
        _units(measured * np.sqrt(a / b), sensor),
        float(scale),
    )


def _units(measured_m: NDArray[np.floating], sensor: StereoDepth | TimeOfFlightDepth) -> NDArray[np.uint16]:
    """Depths in wire units, invalid outside the sensor's range."""
    inside = (measured_m >= sensor.min_m) & (measured_m <= sensor.max_m)
    units = np.zeros(len(measured_m), np.uint16)
    units[inside] = np.clip(np.rint(measured_m[inside] / DEPTH_METRES_PER_UNIT), 1, NO_RETURN - 1).astype(np.uint16)
    units[0] = INVALID
    return units
