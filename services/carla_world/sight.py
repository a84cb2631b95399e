"""What lies on a line of sight, by the probe's depth."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from episode_kit.judge import Hit, Thing
from episode_kit.kinematics import Vector
from services.carla_world.sweep import HIT, Look, between

SHORT_OF_M = 0.1
"""A line that ends so near before its end is free: windows and things are modelled where CARLA's only nearly are."""
OF_A_THING_M = 0.6
"""What is hit so near to the middle of a thing is that thing."""
_ROUND_THE_EDGE = 0.95
NOTHING_OF_OURS = 0


class _Seen(NamedTuple):
    """Where a place lies in the probe's view: tangents to the right and upwards, and planar depth."""

    right: float
    up: float
    depth_m: float


class DepthSight:
    """`things`: of the scene, by their ids."""

    def __init__(self, look: Look, things: dict[str, Thing]) -> None:
        self._look = look
        self._things = things

    def first_hits(self, start: Vector, ends: Sequence[Vector]) -> list[Hit | None]:
        """For each straight line from `start`: the first thing on it, null where it is free. Raises what `look`
        raises."""
        middle = _mean(ends)
        views = [_seen(start, middle, end) for end in ends]
        if all(max(abs(view.right), abs(view.up)) < _ROUND_THE_EDGE for view in views):
            depth_m = self._look(start, middle)
            return [self._hit(start, end, view, depth_m) for end, view in zip(ends, views, strict=True)]
        return [self._hit(start, end, _seen(start, end, end), self._look(start, end)) for end in ends]

    def _hit(self, start: Vector, end: Vector, view: _Seen, depth_m: NDArray[np.float64]) -> Hit | None:
        size = depth_m.shape[0]
        column, row = (int((1.0 + tangent) * size / 2) for tangent in (view.right, -view.up))
        share = float(depth_m[min(row, size - 1), min(column, size - 1)]) / view.depth_m
        length_m = math.dist(start, end)
        if share * length_m >= length_m - SHORT_OF_M:
            return None
        there = between(start, end, share)
        part = next((t.part for t in self._things.values() if math.dist(t.middle, there) <= OF_A_THING_M), None)
        return Hit(NOTHING_OF_OURS if part is None else part, HIT)


def _seen(start: Vector, towards: Vector, place: Vector) -> _Seen:
    """`place` in the view of a probe at `start` that looks `towards` a place; its upper edge is level."""
    forward = np.subtract(towards, start)
    forward = forward / np.linalg.norm(forward)
    level = math.hypot(forward[0], forward[1])
    east = (forward[0] / level, forward[1] / level) if level > 1e-9 else (1.0, 0.0)
    right = np.array((east[1], -east[0], 0.0))
    up = np.cross(right, forward)
    gap = np.subtract(place, start)
    depth_m = float(gap @ forward)
    if depth_m <= 0.0:
        return _Seen(math.inf, math.inf, depth_m)
    return _Seen(float(gap @ right) / depth_m, float(gap @ up) / depth_m, depth_m)


def _mean(places: Sequence[Vector]) -> Vector:
    x, y, z = np.mean(np.asarray(places), axis=0)
    return float(x), float(y), float(z)
