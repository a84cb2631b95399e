"""What a flight would hit, by depth: a free camera in CARLA touches nothing.

A probe, a square depth camera, looks along the way from where the drone's sphere is. What it sees inside the cylinder
that the sphere would sweep stops the sphere where it would touch that; nothing inside the cylinder can be hidden by
anything outside it. A long way is looked along in pieces, so that pixels stay small against the sphere.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from episode_kit.kinematics import Vector
from episode_kit.trajectory import Sweep

PROBE_PX = 640
PIECE_M = 8.0
"""At its end a pixel of the probe is 2.5 cm wide."""
APART_M = 0.02
"""The sphere stops so far before what it would touch, so that along a wall it can fly on."""
HIT = "something in CARLA's world"
"""Depth does not tell what it is."""

Look = Callable[[Vector, Vector], NDArray[np.float64]]
"""(H, W) metres along the optical axis of the probe at the first place that looks at the second; inf: nothing."""


class _Rays(NamedTuple):
    """(H, W) tangents of the bearing to the right and upwards of each pixel of the probe; its view is 90 degrees wide,
    the centre of pixel (row, column) lies at (column + 0.5, row + 0.5)."""

    right: NDArray[np.float64]
    up: NDArray[np.float64]


class DepthSweeper:
    """Moves a sphere of `radius_m` through what `look` sees."""

    def __init__(self, look: Look, radius_m: float) -> None:
        self._look = look
        self._radius_m = radius_m

    def sweep(self, start: Vector, end: Vector) -> Sweep:
        """How far the sphere comes from `start` towards `end`. Raises what `look` raises."""
        length_m = math.dist(start, end)
        free_m = 0.0
        while free_m < length_m:
            here = between(start, end, free_m / length_m)
            piece_m = min(PIECE_M, length_m - free_m)
            came_m = free_ahead_m(self._look(here, end), self._radius_m, piece_m)
            free_m += came_m
            if came_m < piece_m:
                return Sweep(free_m, HIT)
        return Sweep(length_m, None)

    def touching(self, place: Vector) -> bool:
        """Whether anything is nearer to `place` than the sphere is wide: looks into all six directions."""
        x, y, z = place
        around = ((x + 1, y, z), (x - 1, y, z), (x, y + 1, z), (x, y - 1, z), (x, y, z + 1), (x, y, z - 1))
        return any(nearest_m(self._look(place, there)) < self._radius_m for there in around)


def free_ahead_m(depth_m: NDArray[np.float64], radius_m: float, reach_m: float) -> float:
    """How far the sphere comes straight ahead, at most `reach_m`, before it is `APART_M` from what the probe sees."""
    rays = _rays(depth_m.shape[0])
    near = depth_m < reach_m + radius_m + APART_M
    z = depth_m[near]
    aside_m = z * np.hypot(rays.right[near], rays.up[near])
    inside = aside_m < radius_m
    if not inside.any():
        return reach_m
    touch_m = z[inside] - np.sqrt(radius_m**2 - aside_m[inside] ** 2)
    return float(np.clip(touch_m.min() - APART_M, 0.0, reach_m))


def nearest_m(depth_m: NDArray[np.float64]) -> float:
    """The distance of the nearest thing in the probe's view."""
    rays = _rays(depth_m.shape[0])
    return float((depth_m * np.sqrt(1.0 + rays.right**2 + rays.up**2)).min())


def between(start: Vector, end: Vector, share: float) -> Vector:
    """The place at that share of the straight way."""
    x, y, z = (a + (b - a) * share for a, b in zip(start, end, strict=True))
    return x, y, z


@lru_cache(maxsize=2)
def _rays(size: int) -> _Rays:
    tangents = (np.arange(size) + 0.5 - size / 2) / (size / 2)
    right, down = np.meshgrid(tangents, tangents)
    return _Rays(right, -down)
