"""Volumes that nothing may fly into, known beforehand: upright polygons with a floor and a ceiling.

Overhead wires, for one, are thinner than depth cameras can be trusted to see. The guard holds every leg against them,
and what plans ways takes them for solid.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Place
from navigation.point_cloud import Points
from navigation.polygon import inside

Floats = NDArray[np.float64]

_SAMPLE_M = 0.1
_SURFACE_M = 0.25
_CELL_M = _SURFACE_M / 2.0
_NEAR_M = 20.0
_CELLS = 512
_LIE_M = 1e-6


class Volume(NamedTuple):
    """`outline`: its corners on the plan, ENU metres; from `floor_m` to `ceiling_m`."""

    name: str
    outline: tuple[tuple[float, float], ...]
    floor_m: float
    ceiling_m: float


class Described(Protocol):
    """A volume as a message describes it."""

    @property
    def name(self) -> str: ...
    @property
    def corners(self) -> tuple[tuple[float, float], ...]: ...
    @property
    def min_height_m(self) -> float: ...
    @property
    def max_height_m(self) -> float: ...


def volumes(described: Iterable[Described]) -> tuple[Volume, ...]:
    """The same, as the mathematics takes them."""
    return tuple(Volume(v.name, v.corners, v.min_height_m, v.max_height_m) for v in described)


class Entered(NamedTuple):
    """Which volume a leg comes too near to, and where."""

    name: str
    at: Place


def entered(a: Place, b: Place, volumes: Sequence[Volume], room_m: float) -> Entered | None:
    """The first of the volumes that the leg comes nearer to than `room_m`, level or from above or below. Whoever is
    that near already, as the start or a gust had it, may leave it, but on no way that comes nearer first."""
    for volume in volumes:
        low, high = volume.floor_m - room_m, volume.ceiling_m + room_m
        if max(a.z, b.z) <= low or min(a.z, b.z) >= high or not _boxes_meet(a, b, volume, room_m):
            continue
        if _crossed_m(a, b, volume, low, high) >= room_m - _LIE_M:
            continue
        places = np.linspace(np.array(a), np.array(b), max(3, math.ceil(math.dist(a, b) / _SAMPLE_M) + 1))
        away = _away_m(places, volume)
        leaves = away[0] < room_m <= away[-1] and bool((np.diff(away) >= -_LIE_M).all())
        if not leaves:
            return Entered(volume.name, Place(*map(float, places[int(away.argmin())])))
    return None


def _boxes_meet(a: Place, b: Place, volume: Volume, room_m: float) -> bool:
    xs, ys = zip(*volume.outline, strict=True)
    beside_x = max(a.x, b.x) <= min(xs) - room_m or min(a.x, b.x) >= max(xs) + room_m
    beside_y = max(a.y, b.y) <= min(ys) - room_m or min(a.y, b.y) >= max(ys) + room_m
    return not (beside_x or beside_y)


def _crossed_m(a: Place, b: Place, volume: Volume, low: float, high: float) -> float:
    """How near, on the plan, the part of the leg between these heights comes to the outline; 0 inside."""
    first, last = 0.0, 1.0
    if abs(b.z - a.z) > _LIE_M:
        shares = sorted(((low - a.z) / (b.z - a.z), (high - a.z) / (b.z - a.z)))
        first, last = max(0.0, shares[0]), min(1.0, shares[1])
    start, leg = np.array((a.x, a.y)), np.array((b.x - a.x, b.y - a.y))
    p, q = start + first * leg, start + last * leg
    corners = np.array(volume.outline)
    if inside((p, q), corners).any():
        return 0.0
    edges = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    return min(_between_m(p, q, c, d) for c, d in edges)


def _between_m(p: Floats, q: Floats, c: Floats, d: Floats) -> float:
    """Between two straight pieces of the plan, 0 where they cross."""
    if _side(p, q, c) * _side(p, q, d) < 0 and _side(c, d, p) * _side(c, d, q) < 0:
        return 0.0
    return min(_beside_m(p, c, d), _beside_m(q, c, d), _beside_m(c, p, q), _beside_m(d, p, q))


def _side(a: Floats, b: Floats, p: Floats) -> float:
    return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))


def _beside_m(p: Floats, a: Floats, b: Floats) -> float:
    along = b - a
    share = min(1.0, max(0.0, float((p - a) @ along) / max(float(along @ along), _LIE_M)))
    return float(np.linalg.norm(p - a - share * along))


def _away_m(places: Floats, volume: Volume) -> Floats:
    """(N,) how far places (N, 3) are from it, level or from above or below; 0 within."""
    level = np.where(inside(places[:, :2], volume.outline), 0.0, _to_outline_m(places[:, :2], volume))
    upright = np.maximum(volume.floor_m - places[:, 2], places[:, 2] - volume.ceiling_m)
    return np.maximum(level, upright)


def _to_outline_m(places: Floats, volume: Volume) -> Floats:
    """(N,) from places (N, 2) to the outline."""
    corners = np.array(volume.outline)
    least = np.full(len(places), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = b - a
        share = np.clip((places - a) @ along / max(float(along @ along), _LIE_M), 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(places - a - share[:, None] * along, axis=1))
    return least


def at_height(volumes: Sequence[Volume], z: float, room_m: float) -> list[tuple[tuple[float, float], ...]]:
    """The outlines of those into which a drone at that height could fly."""
    return [v.outline for v in volumes if v.floor_m - room_m < z < v.ceiling_m + room_m]


def surfaces(volumes: Sequence[Volume], about: Place) -> Points:
    """(N, 3) ENU: what of the volumes lies within 20 m, as points of their sides, floors and ceilings, as if depth had
    shown them. Where volumes overlap, none lies on another."""
    parts = [part for volume in volumes for part in _surface(volume, about)]
    off = np.concatenate([np.zeros((0, 3)), *parts]) - np.array(about)
    off = off[np.linalg.norm(off, axis=1) <= _NEAR_M]
    cells = np.rint(off / _CELL_M).astype(np.int64) + _CELLS // 2
    _, first = np.unique((cells[:, 0] * _CELLS + cells[:, 1]) * _CELLS + cells[:, 2], return_index=True)
    points: Points = (off[np.sort(first)] + np.array(about)).astype(np.float32)
    return points


def _surface(volume: Volume, about: Place) -> list[Floats]:
    low, high = max(volume.floor_m, about.z - _NEAR_M), min(volume.ceiling_m, about.z + _NEAR_M)
    if low > high:
        return []
    corners = np.array(volume.outline)
    rim = np.concatenate([_side_near(a, b, about) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    heights = np.linspace(low, high, max(2, math.ceil((high - low) / _SURFACE_M) + 1))
    parts = [np.column_stack([np.repeat(rim, len(heights), axis=0), np.tile(heights, len(rim))])]
    first = np.maximum(corners.min(axis=0), (about.x - _NEAR_M, about.y - _NEAR_M))
    last = np.minimum(corners.max(axis=0), (about.x + _NEAR_M, about.y + _NEAR_M))
    if (first < last).all():
        east, north = np.meshgrid(*(np.arange(f, e, _SURFACE_M) for f, e in zip(first, last, strict=True)))
        plan = np.column_stack([east.ravel(), north.ravel()])
        plan = plan[inside(plan, corners)]
        parts += [np.column_stack([plan, np.full(len(plan), z)]) for z in (volume.floor_m, volume.ceiling_m)]
    return parts


def _side_near(a: Floats, b: Floats, about: Place) -> Floats:
    """(N, 2) places along a side, however long: those in the square that reaches 20 m to each side of `about`."""
    along = b - a
    first, last = 0.0, 1.0
    for start, way, middle in zip(a.tolist(), along.tolist(), (about.x, about.y), strict=True):
        if abs(way) > _LIE_M:
            shares = sorted(((middle - _NEAR_M - start) / way, (middle + _NEAR_M - start) / way))
            first, last = max(first, shares[0]), min(last, shares[1])
        elif abs(start - middle) > _NEAR_M:
            last = -1.0
    pieces = max(1, math.ceil(float(np.linalg.norm(along)) / _SURFACE_M))
    places: Floats = a + along * np.arange(math.ceil(first * pieces), math.floor(last * pieces) + 1)[:, None] / pieces
    return places
