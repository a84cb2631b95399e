"""The procedural pictures behind the tiled texture layers: drawn from fixed seeds, sRGB, the top row first.

Wall and roof patterns are near white, so that a scene's colours tint them; grass and roads carry their own colours.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]


class Pattern(NamedTuple):
    """`paint(size)` gives a (size, size, 3) uint8 picture; one repeat spans `tile_m` metres."""

    paint: Callable[[int], Picture]
    tile_m: float


def noise(size: int, cells: int, seed: int, octaves: int = 1, gain: float = 0.5, cells_y: int | None = None) -> Floats:
    """(size, size) smooth, tileable value noise about 0, roughly -1..1; `size` is a multiple of the cells."""
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


def picture(value: Floats, tint: tuple[float, float, float] = (1, 1, 1)) -> Picture:
    """Grey 0..1, (H, W), or colour, (H, W, 3), to bytes."""
    rgb = value[..., None] * np.array(tint) if value.ndim == 2 else value
    return np.asarray(np.clip(np.rint(rgb * 255), 0, 255).astype(np.uint8))


def grid(size: int) -> tuple[Floats, Floats]:
    """x to the right and y down, 0..1, each (size, size)."""
    y, x = np.mgrid[0:size, 0:size] / size
    return x, y


def plain(size: int) -> Picture:
    return np.full((size, size, 3), 255, np.uint8)


def plaster(size: int) -> Picture:
    return picture(0.93 + 0.05 * noise(size, 4, 1, 4) + 0.025 * noise(size, 128, 2, 2))


def _bond(size: int, across: int, courses: int, joint: tuple[float, float], low: float, seed: int) -> Picture:
    """Running bond: `joint` is the mortar's share of a stone's width and height, `low` the darkest stone."""
    rng = np.random.default_rng(seed)
    x, y = grid(size)
    row = np.floor(y * courses).astype(int)
    shifted = x * across + 0.5 * (row % 2)
    col = np.floor(shifted).astype(int) % across
    tone = rng.uniform(low, 1.0, (courses, across))[row, col]
    warm = rng.uniform(-0.05, 0.05, (courses, across))[row, col]
    fx, fy = shifted % 1, (y * courses) % 1
    mortar = (fx < joint[0]) | (fy < joint[1])
    grain = 0.05 * noise(size, 64, seed + 1, 2)
    value = tone + grain
    rgb = np.stack([value + warm * 0.5, value, value - warm * 0.5], -1)
    # the lower edge of each stone lies in its own shade
    rgb *= np.where((fy > 1 - joint[1]) & ~mortar, 0.88, 1.0)[..., None]
    rgb[mortar] = (low + 0.1 + grain)[mortar][:, None] * np.array([0.99, 0.98, 0.96])
    return picture(rgb)


def brick(size: int) -> Picture:
    return _bond(size, 8, 26, (0.06, 0.14), 0.70, 3)


def stone(size: int) -> Picture:
    return _bond(size, 4, 8, (0.022, 0.045), 0.84, 5)


def concrete(size: int) -> Picture:
    x, y = grid(size)
    value = 0.90 + 0.06 * noise(size, 4, 7, 5) + 0.04 * noise(size, 32, 8, 1, cells_y=2)
    joint = (np.abs(y * 2 % 1 - 0.5) > 0.492) | (np.abs(x * 2 % 1 - 0.5) > 0.494)
    holes = np.hypot((x * 4 % 1 - 0.5), (y * 4 % 1 - 0.5)) < 0.025
    return picture(np.where(joint | holes, value * 0.80, value))


def panel(size: int) -> Picture:
    """Storey-high panels with sealed joints."""
    x, y = grid(size)
    rng = np.random.default_rng(9)
    tone = rng.uniform(0.93, 1.0, (2, 2))[(y * 2).astype(int), (x * 2).astype(int)]
    value = tone + 0.025 * noise(size, 8, 10, 4)
    fx, fy = np.abs(x * 2 % 1 - 0.5), np.abs(y * 2 % 1 - 0.5)
    value = np.where((fx > 0.490) | (fy > 0.490), 0.62, value)
    return picture(np.where((fy > 0.480) & (fy <= 0.490), value * 1.05, value))


def wood(size: int) -> Picture:
    """Weatherboard: 10 boards, each casting a small shade."""
    _, y = grid(size)
    f = y * 10 % 1
    rng = np.random.default_rng(11)
    tone = rng.uniform(0.90, 1.0, 10)[np.floor(y * 10).astype(int)]
    value = tone - 0.10 * f + 0.04 * noise(size, 4, 12, 3, cells_y=64)
    return picture(np.where(f > 0.90, value * 0.62, value))


def timber(size: int) -> Picture:
    """Grain along y, for beams, doors and trunks."""
    return picture(0.86 + 0.12 * noise(size, 32, 13, 3, cells_y=4) + 0.05 * noise(size, 8, 14, 2))


def lacquer(size: int) -> Picture:
    x, _ = grid(size)
    value = 0.92 + 0.06 * noise(size, 4, 15, 3)
    edge = np.abs(x * 2 % 1 - 0.5) > 0.485
    return picture(np.where(edge, value * 0.76, value))


def roof_tile(size: int) -> Picture:
    """12 by 12 pantiles: round across, each course shading the next."""
    x, y = grid(size)
    rng = np.random.default_rng(17)
    row, col = np.floor(y * 12).astype(int), np.floor(x * 12).astype(int)
    tone = rng.uniform(0.80, 1.0, (12, 12))[row, col]
    fx, fy = x * 12 % 1, y * 12 % 1
    value = tone * (0.62 + 0.38 * np.sin(np.pi * fx) ** 0.7) * (0.78 + 0.22 * fy)
    return picture(np.where(fy > 0.9, value * 0.62, value))


def slate(size: int) -> Picture:
    return _bond(size, 8, 16, (0.04, 0.09), 0.74, 19)


def glazed_tile(size: int) -> Picture:
    """Temple roofs: half-round ribs running down the slope."""
    x, y = grid(size)
    fx = x * 8 % 1
    rib = np.abs(fx - 0.5) < 0.22
    value = np.where(rib, 0.72 + 0.28 * np.cos((fx - 0.5) / 0.22 * np.pi / 2), 0.56 + 0.10 * np.abs(fx - 0.5))
    value = value * np.where(y * 6 % 1 > 0.92, 0.82, 1.0) + 0.03 * noise(size, 16, 21, 2)
    return picture(value)


def seam_metal(size: int) -> Picture:
    x, _ = grid(size)
    fx = x * 4 % 1
    value = 0.92 + 0.03 * noise(size, 4, 23, 3)
    return picture(np.where(fx < 0.04, 1.0, np.where(fx < 0.09, 0.66, value)))


def grass(size: int) -> Picture:
    a, b, c = noise(size, 4, 25, 6, 0.68), noise(size, 128, 26, 2), noise(size, 2, 27, 2)
    tone = 0.86 + 0.26 * a + 0.14 * b
    return picture(np.stack([tone * (0.47 + 0.05 * c), tone * 0.58, tone * (0.29 - 0.02 * c)], -1))


def paving(size: int) -> Picture:
    return _bond(size, 6, 6, (0.045, 0.045), 0.90, 29)


def asphalt(size: int) -> Picture:
    return picture(0.40 + 0.05 * noise(size, 4, 31, 4) + 0.05 * noise(size, 256, 32), (0.98, 1.0, 1.03))


def gravel(size: int) -> Picture:
    return picture(0.80 + 0.13 * noise(size, 64, 33, 3, 0.8) + 0.04 * noise(size, 4, 34, 2))


def leaves(size: int) -> Picture:
    """Dabs of light and dark, tinted by the tree."""
    a = noise(size, 16, 35, 4, 0.9)
    value = 0.72 + 0.55 * np.tanh(2.2 * a) * 0.6
    return picture(np.stack([value * 0.97, value, value * 0.86], -1))


def town(size: int) -> Picture:
    """A far facade: 4 by 4 windows, no more than dark spots."""
    x, y = grid(size)
    rng = np.random.default_rng(37)
    glass = (np.abs(x * 4 % 1 - 0.5) < 0.24) & (np.abs(y * 4 % 1 - 0.45) < 0.27)
    tone = rng.uniform(0.30, 0.62, (4, 4))[(y * 4).astype(int), (x * 4).astype(int)]
    band = np.where(y * 4 % 1 > 0.93, 0.86, 0.97)
    value = np.where(glass, tone, band)
    return picture(np.stack([value * 0.97, value, value * 1.02], -1))


def clouds(size: int) -> Picture:
    """The density of clouds, 0..1, as grey."""
    return picture(0.5 + 0.62 * noise(size, 4, 90, 6, 0.55))


TILED: dict[str, Pattern] = {
    "plain": Pattern(plain, 1.0),
    "plaster": Pattern(plaster, 4.0),
    "brick": Pattern(brick, 2.0),
    "concrete": Pattern(concrete, 6.0),
    "panel": Pattern(panel, 6.0),
    "stone": Pattern(stone, 3.2),
    "wood": Pattern(wood, 1.8),
    "timber": Pattern(timber, 1.5),
    "lacquer": Pattern(lacquer, 3.0),
    "roof_tile": Pattern(roof_tile, 3.2),
    "slate": Pattern(slate, 2.6),
    "glazed_tile": Pattern(glazed_tile, 2.4),
    "metal": Pattern(seam_metal, 2.0),
    "grass": Pattern(grass, 9.0),
    "paving": Pattern(paving, 2.4),
    "asphalt": Pattern(asphalt, 5.0),
    "gravel": Pattern(gravel, 3.0),
    "town": Pattern(town, 12.0),
    "leaves": Pattern(leaves, 1.6),
    "clouds": Pattern(clouds, 1.0),
}
