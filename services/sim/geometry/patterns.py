"""The procedural pictures behind the texture layers: tileable, drawn from fixed seeds, sRGB.

Wall and roof patterns are near white, so that a scene's colours tint them; things with colours of their own (panes,
leaves, grass) carry them.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Pattern(NamedTuple):
    """`paint(size)` gives a (size, size, 3) uint8 picture; one repeat spans `tile_m` metres."""

    paint: Callable[[int], NDArray[np.uint8]]
    tile_m: float


def noise(size: int, cells: int, seed: int, octaves: int = 1, gain: float = 0.5, cells_y: int | None = None) -> Floats:
    """(size, size) smooth, tileable value noise about 0, roughly -1..1."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size, size))
    amplitude, norm = 1.0, 0.0
    cx, cy = cells, cells_y or cells
    for _ in range(octaves):
        grid = rng.uniform(-1, 1, (min(cy, size), min(cx, size)))
        pad = np.pad(grid, 2, mode="wrap")
        sy, sx = size // grid.shape[0], size // grid.shape[1]
        big = cv2.resize(pad, (pad.shape[1] * sx, pad.shape[0] * sy), interpolation=cv2.INTER_CUBIC)
        total += amplitude * big[2 * sy : 2 * sy + size, 2 * sx : 2 * sx + size]
        norm += amplitude
        amplitude *= gain
        cx, cy = cx * 2, cy * 2
    return total / norm


def _picture(value: Floats, tint: tuple[float, float, float] = (1, 1, 1)) -> NDArray[np.uint8]:
    """Grey 0..1, (H, W), or colour, (H, W, 3), to bytes."""
    rgb = value[..., None] * np.array(tint) if value.ndim == 2 else value
    return np.clip(np.rint(rgb * 255), 0, 255).astype(np.uint8)


def plain(size: int) -> NDArray[np.uint8]:
    return np.full((size, size, 3), 255, np.uint8)


def plaster(size: int) -> NDArray[np.uint8]:
    return _picture(0.94 + 0.035 * noise(size, 4, 1, 3) + 0.02 * noise(size, 128, 2, 2))


def brick(size: int) -> NDArray[np.uint8]:
    """8 bricks by 16 courses, running bond; one repeat is 2 m by 1.12 m scaled to a square of 2 m."""
    return _bricks(size, 8, 26, 0.06, 0.11)


def _bricks(size: int, across: int, courses: int, joint_x: float, joint_y: float) -> NDArray[np.uint8]:
    rng = np.random.default_rng(3)
    y, x = np.mgrid[0:size, 0:size] / size
    row = np.floor(y * courses).astype(int)
    shifted = x * across + 0.5 * (row % 2)
    col = np.floor(shifted).astype(int) % across
    tone = rng.uniform(0.72, 1.0, (courses, across))[row, col]
    warm = rng.uniform(-0.05, 0.05, (courses, across))[row, col]
    fx, fy = shifted % 1, (y * courses) % 1
    mortar = (fx < joint_x) | (fy < joint_y)
    grain = 0.05 * noise(size, 64, 4, 2)
    value = tone + grain
    rgb = np.stack([value + warm * 0.5, value, value - warm * 0.5], -1)
    rgb[mortar] = (0.93 + grain)[mortar][:, None] * np.array([0.95, 0.94, 0.92])
    return _picture(rgb)


def clouds(size: int) -> NDArray[np.uint8]:
    """The density of clouds, 0..1, as grey."""
    return _picture(0.5 + 0.62 * noise(size, 4, 90, 6, 0.55))


PATTERNS: dict[str, Pattern] = {
    "plain": Pattern(plain, 1.0),
    "plaster": Pattern(plaster, 4.0),
    "brick": Pattern(brick, 2.0),
    "clouds": Pattern(clouds, 1.0),
}
