"""What a real depth camera makes of the depth that is really there.

Holes, thin things and edges are found in the true depth, the error is added in the sensor's own measure
(`services.sim.sensors.codes`), and what lies outside its range is invalid. Everything by a generator that is given.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.images import DEPTH_METRES_PER_UNIT, INVALID, NO_RETURN
from contracts.scene import CALM, Air
from contracts.sensor_profiles import RealDepth, StereoDepth, TimeOfFlightDepth
from services.sim.sensors.chance import BANK_CODES_PER_SIGMA, blotches, white
from services.sim.sensors.codes import Codes, codes_of
from services.sim.sensors.rain import echoed

Units = NDArray[np.uint16]
_THIN_M = 0.3
"""A thing stands out of what lies behind it by so much."""
_MIXED_M = 3.0
"""A mixed pixel lies at most so far behind the near side of its edge."""
_CONTRAST_PX = 7
FOG_REACH = 0.25


class Frame(NamedTuple):
    """One camera's true frame: rgb (H, W, 3) uint8; units (H, W) uint16 in wire units, 65535 where nothing returns;
    glass (H, W) bool, null where the renderer does not tell panes."""

    rgb: NDArray[np.uint8]
    units: Units
    glass: NDArray[np.bool_] | None


def sensed_depth(
    frame: Frame, sensor: StereoDepth | TimeOfFlightDepth, rng: np.random.Generator, air: Air = CALM
) -> Units:
    """(H, W) uint16 in wire units, 0 where the sensor says nothing; a real camera never says no-return. Fog takes the
    contrast that two cameras match by from the picture itself; light that is sent out comes back from no farther than
    `FOG_REACH` of the visibility."""
    codes = codes_of(sensor)
    height, width = frame.units.shape
    units = _thin_missed(frame.units, sensor, rng)
    _mix_edges(units, sensor, rng)
    if isinstance(sensor, TimeOfFlightDepth):
        if air.visibility_m is not None:
            units[units > air.visibility_m * FOG_REACH / DEPTH_METRES_PER_UNIT] = INVALID
        if air.rain_mm_h:
            units = echoed(units, air.rain_mm_h, rng)
    measured = _measured(units, codes, _error(sensor, codes, height, width, rng))
    measured[_holes(frame, sensor, rng)] = INVALID
    if rng.random() < sensor.partial_frames:
        measured[int(rng.integers(height)) :] = INVALID
    return measured


def _measured(units: Units, codes: Codes, error: NDArray[np.int16]) -> Units:
    there = cv2.LUT(units, codes.of_units)
    noisy = cv2.add(there, error, dtype=cv2.CV_16U)
    return np.asarray(cv2.LUT(noisy, codes.units_of) * (there > 0), np.uint16)


def _error(sensor: RealDepth, codes: Codes, height: int, width: int, rng: np.random.Generator) -> NDArray[np.int16]:
    """(H, W) in codes, alike over the sensor's grain."""
    rows, columns = -(-height // sensor.grain_px) + 1, -(-width // sensor.grain_px) + 1
    drawn = white(rng, rows * columns).reshape(rows, columns).astype(np.float32)
    if sensor.grain_px > 1:
        # between the corners of the grain the error is a mean of four: two thirds as large
        drawn = np.asarray(cv2.resize(drawn, (width, height), interpolation=cv2.INTER_LINEAR)) * 1.5
    scaled = drawn[:height, :width] * (codes.sigma / BANK_CODES_PER_SIGMA)
    return scaled.astype(np.int16)


def _thin_missed(units: Units, sensor: RealDepth, rng: np.random.Generator) -> Units:
    """A copy in which some of what is thin shows what lies behind it, and some is invalid."""
    if sensor.thin_px < 2 or sensor.thin_holes + sensor.thin_missed == 0.0:
        return units.copy()
    kernel = np.ones((sensor.thin_px, sensor.thin_px), np.uint8)
    behind = np.asarray(cv2.morphologyEx(units, cv2.MORPH_CLOSE, kernel), np.uint16)
    thin = behind - units > round(_THIN_M / DEPTH_METRES_PER_UNIT)
    height, width = units.shape
    share = sensor.thin_holes + sensor.thin_missed
    lost = thin & blotches(rng, height, width, share)
    missed = lost & blotches(rng, height, width, sensor.thin_missed / share)
    seen = units.copy()
    seen[lost] = INVALID
    seen[missed] = behind[missed]
    return seen


def _mix_edges(units: Units, sensor: RealDepth, rng: np.random.Generator) -> None:
    """Flying pixels: beside an edge some pixels see both sides, and lie between them."""
    if sensor.edge_mixed == 0.0:
        return
    kernel = np.ones((3, 3), np.uint8)
    near, far = cv2.erode(units, kernel), cv2.dilate(units, kernel)
    at = np.flatnonzero((far - near > round(sensor.edge_m / DEPTH_METRES_PER_UNIT)) & (near > 0))
    at = at[rng.random(len(at), np.float32) < sensor.edge_mixed]
    nearest = near.ravel()[at].astype(np.float32)
    deep = np.minimum(far.ravel()[at] - nearest, _MIXED_M / DEPTH_METRES_PER_UNIT)
    mixed = nearest + deep * rng.random(len(at), np.float32)
    units.ravel()[at] = np.minimum(mixed, NO_RETURN - 1).astype(np.uint16)


def _holes(frame: Frame, sensor: RealDepth, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Where nothing comes back from glass, or nothing can be matched on a plain wall."""
    height, width = frame.units.shape
    holes = np.zeros((height, width), np.bool_)
    if frame.glass is not None and sensor.glass_holes > 0.0:
        holes |= frame.glass & blotches(rng, height, width, sensor.glass_holes)
    if isinstance(sensor, StereoDepth) and sensor.min_contrast > 0 and sensor.plain_holes > 0.0:
        grey = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
        kernel = np.ones((_CONTRAST_PX, _CONTRAST_PX), np.uint8)
        contrast = np.asarray(cv2.subtract(cv2.dilate(grey, kernel), cv2.erode(grey, kernel)))
        holes |= (contrast < sensor.min_contrast) & blotches(rng, height, width, sensor.plain_holes)
    return holes
