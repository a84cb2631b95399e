"""Rain between a camera and what it looks at: bright streaks in the picture, and drops that a depth camera takes for
things.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.images import DEPTH_METRES_PER_UNIT

_STREAKS_PER_MM_H = 14.0
"""In a picture of 800 x 800 pixels."""
_PIXELS = 800 * 800
_FALL_M_S = 7.0
_NEAR_M, _FAR_M = 0.6, 6.0
_ECHOES_PER_MM_H = 1.2e-5
"""Share of a time-of-flight picture's pixels in which a drop answers before what lies behind it."""


def rained(
    rgb: NDArray[np.uint8], focal_px: float, rain_mm_h: float, exposure_s: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """(H, W, 3) with streaks as long as drops fall while the shutter is open, near ones longer and broader."""
    height, width = rgb.shape[:2]
    count = int(rng.poisson(_STREAKS_PER_MM_H * rain_mm_h**0.7 * height * width / _PIXELS))
    layer = np.zeros((height, width), np.uint8)
    away_m = _NEAR_M / np.sqrt(rng.uniform((_NEAR_M / _FAR_M) ** 2, 1.0, count))
    length_px = np.clip(focal_px * _FALL_M_S * max(exposure_s, 0.004) / away_m, 3.0, 120.0)
    x, y = rng.uniform(0, width, count), rng.uniform(-20.0, height, count)
    lean = float(rng.normal(0.0, 0.12))
    for k in range(count):
        end = (round(x[k] + lean * length_px[k]), round(y[k] + length_px[k]))
        thick = 2 if away_m[k] < 1.0 else 1
        cv2.line(layer, (round(x[k]), round(y[k])), end, int(55 / away_m[k]) + 14, thick, cv2.LINE_AA)
    bright = cv2.blur(layer, (3, 3))
    # drops gather light from all round: they show before what is dark, and hardly before the sky or by night
    all_round = min(225, 20 + 2 * int(rgb[::16, ::16].mean()))
    missing = cv2.subtract(np.full_like(rgb, all_round), rgb)
    gained = cv2.multiply(missing, cv2.merge([bright] * 3), scale=1 / 140.0)
    return np.asarray(cv2.add(rgb, gained), np.uint8)


def echoed(units: NDArray[np.uint16], rain_mm_h: float, rng: np.random.Generator) -> NDArray[np.uint16]:
    """(H, W) depth in which some pixels measure a drop, not what is behind it."""
    count = int(rng.poisson(_ECHOES_PER_MM_H * rain_mm_h * units.size))
    at = rng.integers(0, units.size, count)
    seen = units.copy()
    drops = rng.uniform(_NEAR_M, _FAR_M, count) / DEPTH_METRES_PER_UNIT
    seen.ravel()[at] = np.minimum(seen.ravel()[at], drops.astype(np.uint16))
    return seen
