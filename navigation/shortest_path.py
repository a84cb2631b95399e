"""Shortest ways round buildings: a visibility graph of the ground plan.

Every obstacle is a polygon grown by a clearance. Instead of building the grown outline (which folds over itself in a
narrow courtyard), corner points are set round each convex corner and a straight leg is allowed where it keeps the
clearance from every original edge. Used for SPL's shortest path and for the oracle's sense of direction.
"""

import heapq
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.polygon import inside

Xy = tuple[float, float]
Polygon = Sequence[Xy]

_TOLERANCE_M = 1e-6
_LEGS_AT_ONCE = 20_000


class Route(NamedTuple):
    """`waypoints` from start to goal, both included; metres, ENU."""

    length_m: float
    waypoints: tuple[Xy, ...]


class NoWay(NamedTuple):
    """There is no way that keeps the clearance; `reason` says which end is shut in, or that both are free."""

    reason: str


class VisibilityGraph:
    """The graph of one set of obstacles.

    obstacles: simple polygons, vertices in either order, metres, ENU; `clearance_m` is kept from all of them.
    """

    def __init__(self, obstacles: Sequence[Polygon], clearance_m: float) -> None:
        """Raises ValueError for a polygon of fewer than three corners or a negative clearance."""
        if clearance_m < 0.0:
            raise ValueError(f"the clearance can't be negative: {clearance_m}")
        outlines = [_counter_clockwise(polygon) for polygon in obstacles]
        self._clearance_m = clearance_m
        self._outlines = outlines
        self._from = np.concatenate([*outlines, np.zeros((0, 2))])
        self._to = np.concatenate([*(np.roll(outline, -1, axis=0) for outline in outlines), np.zeros((0, 2))])
        corners = [point for outline in outlines for point in _corner_points(outline, clearance_m)]
        nodes = np.array(corners, np.float64).reshape(-1, 2)
        self._nodes = nodes[self._clear_points(nodes)]
        n = len(self._nodes)
        i, j = np.triu_indices(n, 1)
        allowed = self._clear_legs(self._nodes[i], self._nodes[j])
        self._legs = np.full((n, n), np.inf)
        length = np.hypot(*(self._nodes[i] - self._nodes[j]).T)
        self._legs[i[allowed], j[allowed]] = length[allowed]
        self._legs[j[allowed], i[allowed]] = length[allowed]

    def route(self, start: Xy, goal: Xy) -> Route | NoWay:
        """The shortest way. An end that lies within the clearance of a wall first steps straight away from it."""
        return self.routes((start,), goal)[0]

    def routes(self, starts: Sequence[Xy], goal: Xy) -> tuple[Route | NoWay, ...]:
        """The shortest way from each start to one goal."""
        free_goal = self._stepped_out(goal)
        if free_goal is None:
            return tuple(NoWay("the goal is shut in: no free place with the clearance beside it") for _ in starts)
        rest, after = self._to_goal(free_goal)
        return tuple(self._one(start, goal, free_goal, rest, after) for start in starts)

    def clear_places(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) does each place (N, 2) keep the clearance from all obstacles?"""
        return self._clear_points(places)

    def clear_legs(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) does each straight leg, from places (N, 2) to places (N, 2) that keep the clearance, keep it too?"""
        return self._clear_legs(starts, ends)

    def _to_goal(self, goal: Xy) -> tuple[NDArray[np.float64], list[int]]:
        """Distances of all nodes to the goal, and each node's next node (-1: the goal itself). Dijkstra."""
        rest = self._seen_from(goal)
        after = [-1] * len(rest)
        heap = [(float(d), k) for k, d in enumerate(rest) if d < np.inf]
        heapq.heapify(heap)
        while heap:
            done, k = heapq.heappop(heap)
            if done > rest[k]:
                continue
            through = done + self._legs[k]
            for m in np.flatnonzero(through < rest - _TOLERANCE_M):
                rest[m] = through[m]
                after[m] = k
                heapq.heappush(heap, (float(through[m]), int(m)))
        return rest, after

    def _one(self, start: Xy, goal: Xy, free_goal: Xy, rest: NDArray[np.float64], after: list[int]) -> Route | NoWay:
        free_start = self._stepped_out(start)
        if free_start is None:
            return NoWay("the start is shut in: no free place with the clearance beside it")
        middle: list[Xy]
        if self._clear_legs(np.array([free_start]), np.array([free_goal]))[0]:
            middle = [free_start, free_goal]
        else:
            total = self._seen_from(free_start) + rest
            if not len(total) or not np.isfinite(total.min()):
                return NoWay("start and goal are free, but no way between them keeps the clearance")
            k = int(total.argmin())
            middle = [free_start]
            while k >= 0:
                middle.append((float(self._nodes[k, 0]), float(self._nodes[k, 1])))
                k = after[k]
            middle.append(free_goal)
        points = [start, *middle, goal]
        way = [start, *(b for a, b in pairwise(points) if math.dist(a, b) > _TOLERANCE_M)]
        return Route(sum(math.dist(a, b) for a, b in pairwise(way)), tuple(way))

    def _seen_from(self, place: Xy) -> NDArray[np.float64]:
        """(N,) straight distance to each node, inf where the leg is not clear."""
        here = np.broadcast_to(np.array(place), self._nodes.shape)
        distances = np.hypot(*(self._nodes - here).T)
        return np.where(self._clear_legs(here, self._nodes), distances, np.inf)

    def _stepped_out(self, place: Xy) -> Xy | None:
        """The place itself, or the nearest one straight away from the nearest wall that has the clearance."""
        point = np.array([place], np.float64)
        if self._clear_points(point)[0]:
            return place
        distances, feet = _to_segments(point, self._from, self._to)
        nearest = int(distances[0].argmin())
        foot = feet[0, nearest]
        edge = self._to[nearest] - self._from[nearest]
        away = point[0] - foot
        outwards = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
        if self._inside(point)[0] or np.hypot(*away) < _TOLERANCE_M:
            away = outwards  # in or on the wall: the window's own side is outside
        away = away / np.hypot(*away)
        free = foot + away * (self._clearance_m + _TOLERANCE_M)
        return (float(free[0]), float(free[1])) if self._clear_points(free[None])[0] else None

    def _clear_points(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        if not len(self._from) or not len(points):
            return np.ones(len(points), bool)
        near, _ = _to_segments(points, self._from, self._to)
        clear: NDArray[np.bool_] = near.min(axis=1) >= self._clearance_m - _TOLERANCE_M
        return clear & ~self._inside(points)

    def _inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        found = np.zeros(len(points), bool)
        for outline in self._outlines:
            found |= inside(points, outline)
        return found

    def _clear_legs(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) does each leg, whose ends are clear, keep the clearance from every edge?"""
        clear = np.ones(len(start), bool)
        if not len(self._from):
            return clear
        for first in range(0, len(start), _LEGS_AT_ONCE):
            part = slice(first, first + _LEGS_AT_ONCE)
            near = _between_segments(start[part], end[part], self._from, self._to).min(axis=1)
            # with no clearance a leg may run along a wall; crossing one gives a distance of exactly -1
            clear[part] = near >= self._clearance_m - _TOLERANCE_M
        return clear


def shortest_route(start: Xy, goal: Xy, obstacles: Sequence[Polygon], clearance_m: float) -> Route | NoWay:
    """The shortest way of the ground plan from start to goal that keeps `clearance_m` from all obstacles."""
    return VisibilityGraph(obstacles, clearance_m).route(start, goal)


def _counter_clockwise(polygon: Polygon) -> NDArray[np.float64]:
    points = np.array(polygon, np.float64).reshape(-1, 2)
    if len(points) < 3 or not np.isfinite(points).all():
        raise ValueError(f"an obstacle needs at least three finite corners: {polygon!r}")
    following = np.roll(points, -1, axis=0)
    area2 = float((points[:, 0] * following[:, 1] - following[:, 0] * points[:, 1]).sum())
    return points if area2 > 0 else points[::-1].copy()


def _corner_points(outline: NDArray[np.float64], clearance_m: float) -> list[Xy]:
    """Round each convex corner, the corners of a polyline that touches the clearance's arc from outside, one for each
    quarter turn begun: their legs keep the clearance."""
    points = []
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    for a, b, c in zip(before, outline, after, strict=True):
        first, second = math.atan2(*(b - a)[::-1]), math.atan2(*(c - b)[::-1])
        turn = math.remainder(second - first, math.tau)
        if turn <= 1e-9:
            continue
        pieces = max(1, math.ceil(turn / (math.pi / 2) - 1e-9))
        reach = (clearance_m + _TOLERANCE_M) / math.cos(turn / pieces / 2)
        for k in range(pieces):
            angle = first - math.pi / 2 + (k + 0.5) * turn / pieces
            points.append((float(b[0]) + reach * math.cos(angle), float(b[1]) + reach * math.sin(angle)))
    return points


def _to_segments(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances (N, E) of points to segments, and the feet (N, E, 2) on them."""
    along = end - start
    length2 = np.maximum((along * along).sum(axis=1), 1e-18)
    t = (((points[:, None] - start) * along).sum(axis=2) / length2).clip(0.0, 1.0)
    feet = start + t[..., None] * along
    gap = points[:, None] - feet
    return np.hypot(gap[..., 0], gap[..., 1]), feet


def _between_segments(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(M, E) distances of segments a-b to segments c-d; -1 where they properly cross."""

    def side(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[np.float64]:
        cross: NDArray[np.float64] = (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1])
        cross = cross - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])
        return np.where(np.abs(cross) < 1e-9, 0.0, cross)

    a_, b_, c_, d_ = a[:, None], b[:, None], c[None], d[None]
    crosses = (side(a_, b_, c_) * side(a_, b_, d_) < 0) & (side(c_, d_, a_) * side(c_, d_, b_) < 0)
    nearest = np.minimum.reduce(
        [_to_segments(a, c, d)[0], _to_segments(b, c, d)[0], _to_segments(c, a, b)[0].T, _to_segments(d, a, b)[0].T]
    )
    return np.where(crosses, -1.0, nearest)
