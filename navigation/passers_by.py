"""Who walks or drives by, as depth shows it: a lump of returns near the ground where an earlier look saw far past.

Nothing is told from a picture: a thing moves where it is now and was not before. Where it will be is not known; who
walks may turn, so that a place is safe for as long as nobody could have walked there.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.camera import Place, Pose
from navigation.guard import Look
from navigation.point_cloud import Points
from navigation.sensing import FREE, looked_at

HEAD_M = 2.2
"""Nobody who walks reaches higher, and no car."""
WALKS_M_S = 1.6
"""A brisk walk; the mean of adults on pavements is 1.3 to 1.4 (Bohannon 1997)."""
REACH_M = 12.0
NOISY_REACH_M = 6.5
"""Beyond it the error of two cameras, which grows with the square of the distance, moves walls by a person's width."""
_CELL_M = 0.2
_LUMP_CELL_M = 0.4
_PAST_M = 0.5
_ASIDE_M = 0.3
"""An earlier look saw so far past the place and past both its sides: no edge that the pose's error shifts is a move."""
_LEAST_CELLS = 6
_LEAST_TALL_M, _LEAST_WIDE_M = 0.6, 0.25
"""Smaller are posts and twigs, which depth shows in one look and misses in another."""
_STARTS_S = 0.5
_HOVERS_S = 1.0
"""So long a drone stays where a flight ends, until it has looked again."""


class Mover(NamedTuple):
    """What has moved to (x, y), `half_m` wide to each side, as far as it is seen."""

    x: float
    y: float
    half_m: float


class Near(NamedTuple):
    """A mover could come into the way at `at`; `away_m`: how far from there it is now."""

    at: Place
    away_m: float


def movers(now: Look, before: Sequence[Look]) -> list[Mover]:
    """Those that the look shows near the drone and the ground, by what earlier looks saw there, oldest first. A sensor
    that misses thin things sees past a fence in one look and shows it in the next: for it nothing has moved to where a
    look that still saw past came after one that showed something."""
    points = _cells(now)
    past = np.array([_seen_past(points, look) for look in before], bool).reshape(len(before), len(points))
    candidates = past.any(axis=0)
    points, past = points[candidates], past[:, candidates]
    moved = np.ones(len(points), bool)
    if now.misses_thin:
        stood = np.zeros(len(points), bool)
        for look, saw_past in zip(before, past, strict=True):
            moved &= ~(stood & saw_past)
            stood |= _shown(points, look)
    return _lumps(points[moved])


def in_the_way(path: Sequence[Place], pose: Pose, speed_m_s: float, low_m: float, seen: Sequence[Mover]) -> Near | None:
    """Where any of them could meet a drone that flies from `pose` along `path` at about that speed and then hovers:
    they reach as high as `low_m` for its centre, and `low_m - HEAD_M` beyond their sides."""
    here, gone_s = Place(pose.x, pose.y, pose.z), 0.0
    for number, there in enumerate(path, 1):
        length_m = math.dist(here, there)
        for share in np.linspace(0.0, 1.0, max(2, math.ceil(length_m / _CELL_M) + 1)):
            at = Place(*(a + float(share) * (b - a) for a, b in zip(here, there, strict=True)))
            ends_s = _HOVERS_S if number == len(path) and share == 1.0 else 0.0
            walked_m = WALKS_M_S * (_STARTS_S + gone_s + share * length_m / speed_m_s + ends_s)
            for mover in seen if at.z < low_m else ():
                away_m = math.hypot(mover.x - at.x, mover.y - at.y)
                if away_m - mover.half_m < walked_m + low_m - HEAD_M:
                    return Near(at, away_m)
        here, gone_s = there, gone_s + length_m / speed_m_s
    return None


def without(looks: Sequence[Look], seen: Sequence[Mover]) -> list[Look]:
    """The same looks without who moves, as the last one shows it, and without what an earlier one alone showed below
    head height: what stands there still the last one shows as well, and of a sensor that misses thin things one other.
    Nobody who walks by carries anything overhead. Where nobody moves, the looks as they are."""
    if not seen:
        return list(looks)
    *earlier, last = looks
    there = last.points
    for mover in seen:
        beside = np.hypot(there[:, 0] - mover.x, there[:, 1] - mover.y) <= mover.half_m + _ASIDE_M
        there = there[~beside | (there[:, 2] >= HEAD_M)]
    return [*(_standing(look, looks) for look in earlier), last._replace(points=there)]


def _standing(look: Look, looks: Sequence[Look]) -> Look:
    """What it shows overhead, and of a sensor that misses thin things what another look shows as well."""
    stays = look.points[:, 2] >= HEAD_M
    if look.misses_thin:
        low = look.points[~stays]
        others = [_shown(low, other) for other in looks if other is not look]
        stays[~stays] = np.any(others, axis=0)
    return look._replace(points=look.points[stays])


def rises(path: Sequence[Place], pose: Pose) -> bool:
    """Does the way lead straight up?"""
    end = path[-1]
    return len(path) == 1 and end.z > pose.z and math.hypot(end.x - pose.x, end.y - pose.y) < _ASIDE_M


def goes_low(path: Sequence[Place], pose: Pose, low_m: float) -> bool:
    """Does the way lead where they reach, but for straight up and out of there?"""
    return not rises(path, pose) and min(pose.z, *(place.z for place in path)) < low_m


def _cells(look: Look) -> Points:
    """(N, 3) one return of each small cube that could be of somebody near."""
    reach_m = NOISY_REACH_M if look.misses_thin else REACH_M
    away = np.hypot(look.points[:, 0] - look.pose.x, look.points[:, 1] - look.pose.y)
    near = look.points[(away <= reach_m) & (look.points[:, 2] < HEAD_M)]
    cells = np.floor(near / _CELL_M).astype(np.int64)
    key = (cells[:, 0] << 42) + (cells[:, 1] << 21) + cells[:, 2]
    one_each: Points = near[np.unique(key, return_index=True)[1]]
    return one_each


def _seen_past(points: Points, look: Look) -> NDArray[np.bool_]:
    """(N,) nothing was there or to either side of there, as that look has it."""
    ray = points - np.array((look.pose.x, look.pose.y, look.pose.z), np.float32)
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), np.float32(1e-6))
    aside = np.column_stack([-ray[:, 1], ray[:, 0], np.zeros(len(ray), np.float32)]) * np.float32(_ASIDE_M)
    beyond = points + ray * np.float32(_PAST_M)
    past = looked_at(beyond, look.views, look.pose) == FREE
    for side in (aside, -aside):
        past[past] = looked_at(beyond[past] + side[past], look.views, look.pose) == FREE
    return np.asarray(past)


def _shown(points: Points, look: Look) -> NDArray[np.bool_]:
    """(N,) a return of that look lies within a cell's width or two."""
    if not len(points):
        return np.zeros(0, bool)
    low, high = points.min(axis=0) - 2.0 * _CELL_M, points.max(axis=0) + 2.0 * _CELL_M
    near = look.points[((look.points > low) & (look.points < high)).all(axis=1)]
    taken = np.zeros(np.ceil((high - low) / _CELL_M).astype(np.intp) + 1, bool)
    taken[tuple(np.floor((near - low) / _CELL_M).astype(np.intp).T)] = True
    x, y, z = np.floor((points - low) / _CELL_M).astype(np.intp).T
    about = (-1, 0, 1)
    return np.asarray(np.any([taken[x + i, y + j, z + k] for i in about for j in about for k in about], axis=0))


def _lumps(points: Points) -> list[Mover]:
    """Those of the points (N, 3) that stand together, tall and wide enough for somebody."""
    if len(points) < _LEAST_CELLS:
        return []
    cells = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / _LUMP_CELL_M).astype(np.intp)
    plan = np.zeros(cells.max(axis=0) + 1, np.uint8)
    plan[cells[:, 0], cells[:, 1]] = 1
    count, labels = cv2.connectedComponents(plan, connectivity=8)
    of = labels[cells[:, 0], cells[:, 1]]
    found = []
    for lump in (points[of == number] for number in range(1, count)):
        east, north, tall = (float(extent) for extent in np.ptp(lump, axis=0))
        if len(lump) >= _LEAST_CELLS and tall >= _LEAST_TALL_M and max(east, north) >= _LEAST_WIDE_M:
            x, y = (float(v) for v in (lump.min(axis=0) + lump.max(axis=0))[:2] / 2.0)
            found.append(Mover(x, y, max(east, north) / 2.0))
    return found
