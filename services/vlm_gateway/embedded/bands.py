"""A picture as a stack of narrow bands, each told by its edges and colours: what floors and outlines are read from.

Rows of windows show as bands with many upright edges between bands without; sky, wall and street differ in colour.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

SIDE_PX = 400
BANDS = 100
SEGMENTS = 4
PER_SEGMENT = 7
REACH = 14
"""Bands looked at above and below each band: with every second one of them, 0.28 of the picture."""

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]


def small(rgb: Picture) -> Picture:
    """(H, W, 3) uint8 of any size -> (SIDE_PX, SIDE_PX, 3)."""
    if rgb.shape[:2] == (SIDE_PX, SIDE_PX):
        return rgb
    return np.asarray(cv2.resize(rgb, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA), np.uint8)


def row_bands(rgb: Picture, low: float = 0.1, high: float = 0.9) -> Floats:
    """(BANDS, features) from the top, with their surroundings. rgb: (SIDE_PX, SIDE_PX, 3); low..high: columns used."""
    lab = cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB).astype(np.float32) / 255.0
    light = np.ascontiguousarray(lab[:, :, 0])
    upright = np.abs(cv2.Sobel(light, cv2.CV_32F, 1, 0))
    level = cv2.Sobel(light, cv2.CV_32F, 0, 1)
    maps = (lab[:, :, 0], lab[:, :, 1], lab[:, :, 2], light * light, upright, np.abs(level), level)
    left, right = int(low * SIDE_PX), int(high * SIDE_PX)
    parts = [
        m[:, left:right].reshape(BANDS, SIDE_PX // BANDS, SEGMENTS, (right - left) // SEGMENTS).mean(axis=(1, 3))
        for m in maps
    ]
    stacked = np.stack(parts, axis=2)
    stacked[:, :, 3] = np.sqrt(np.maximum(stacked[:, :, 3] - stacked[:, :, 0] ** 2, 0.0))
    return with_surroundings(stacked.reshape(BANDS, SEGMENTS * PER_SEGMENT))


def column_bands(rgb: Picture) -> Floats:
    """(BANDS, features) from the left, with their surroundings. rgb: (SIDE_PX, SIDE_PX, 3)."""
    return row_bands(np.ascontiguousarray(rgb.transpose(1, 0, 2)), 0.0, 1.0)


def with_surroundings(bands: Floats) -> Floats:
    """(B, F) -> (B, F * (REACH + 1) + 1): every second band within reach, repeated beyond the ends, and the place."""
    count = len(bands)
    at = np.clip(np.arange(count)[:, None] + np.arange(-REACH, REACH + 1, 2)[None, :], 0, count - 1)
    beyond = (np.arange(count)[:, None] + np.arange(-REACH, REACH + 1, 2)[None, :] != at).astype(np.float32)
    place = np.linspace(0, 1, count, dtype=np.float32)[:, None]
    return np.concatenate([bands[at].reshape(count, -1), beyond, place], axis=1).astype(np.float32)


def peaks(heat: Floats, threshold: float, apart: int) -> list[int]:
    """Indices of the local maxima of at least `threshold`, no two nearer than `apart`, in rising order."""
    chosen: list[int] = []
    for i in np.argsort(-heat, kind="stable"):
        if heat[i] < threshold:
            break
        if all(abs(int(i) - k) >= apart for k in chosen):
            chosen.append(int(i))
    return sorted(chosen)


def longest_run(inside: NDArray[np.bool_], gap: int = 3) -> tuple[int, int] | None:
    """First and past-the-last index of the longest run of true values, gaps of at most `gap` bridged."""
    best: tuple[int, int] | None = None
    start = last = -1
    for i in np.flatnonzero(inside):
        k = int(i)
        if start < 0 or k - last > gap + 1:
            start = k
        last = k
        if best is None or last + 1 - start > best[1] - best[0]:
            best = (start, last + 1)
    return best
