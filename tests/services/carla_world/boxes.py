"""A world of boxes for the probe: its depth by ray casting, and what a sphere hits in it, exactly."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from episode_kit.kinematics import Vector
from services.carla_world.sweep import between


class Box(NamedTuple):
    """Two opposite corners, metres."""

    low: Vector
    high: Vector

    def distance_m(self, place: Vector) -> float:
        """From a place to its surface; 0 inside."""
        return math.hypot(*(max(a - p, 0.0, p - b) for a, p, b in zip(self.low, place, self.high, strict=True)))


class BoxWorld:
    """`size`: of the probe's picture, in pixels."""

    def __init__(self, *boxes: Box, size: int = 640) -> None:
        self._boxes = boxes
        self._size = size
        self.looks = 0

    def look(self, start: Vector, end: Vector) -> NDArray[np.float64]:
        """As `services.carla_world.sweep.Look` has it."""
        self.looks += 1
        forward = np.subtract(end, start) / math.dist(start, end)
        level = np.array((forward[0], forward[1], 0.0))
        level = level / np.linalg.norm(level) if np.linalg.norm(level) > 1e-9 else np.array((1.0, 0.0, 0.0))
        right = np.array((level[1], -level[0], 0.0))
        up = np.cross(right, forward)
        tangents = (np.arange(self._size) + 0.5) / (self._size / 2) - 1.0
        across, down = np.meshgrid(tangents, tangents)
        rays = forward + across[..., None] * right - down[..., None] * up
        depth = np.full(across.shape, np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            for box in self._boxes:
                a, b = (np.subtract(corner, start) / rays for corner in box)
                near, far = np.fmin(a, b).max(axis=2), np.fmax(a, b).min(axis=2)
                depth = np.where((near <= far) & (near > 0), np.minimum(depth, near), depth)
        return depth

    def free_m(self, start: Vector, end: Vector, radius_m: float) -> float:
        """How far a sphere comes along the straight way before it touches a box."""
        length_m, free_m = math.dist(start, end), 0.0
        while free_m < length_m:
            gap_m = self.clearance_m(between(start, end, free_m / length_m)) - radius_m
            if gap_m < 1e-4:
                return free_m
            free_m += gap_m
        return length_m

    def clearance_m(self, place: Vector) -> float:
        return min((box.distance_m(place) for box in self._boxes), default=math.inf)
