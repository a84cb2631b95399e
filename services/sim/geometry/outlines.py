"""Ground plans: moving their edges out, sweeping profiles round them, cutting them into rectangles."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from navigation.polygon import inside
from services.sim.geometry.mesh import Colour, Mesh
from services.sim.geometry.solids import quad

Plan = NDArray[np.float64]
"""(N, 2) metres, counter-clockwise seen from above."""


def plan_of(points: ArrayLike) -> Plan:
    return np.asarray(points, np.float64).reshape(-1, 2)


def grown(plan: Plan, distance_m: float) -> Plan:
    """Every edge moved out by the distance (in, if negative), corners mitred."""
    edge = np.roll(plan, -1, axis=0) - plan
    u = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    before = np.roll(u, 1, axis=0)
    cross = before[:, 0] * u[:, 1] - before[:, 1] * u[:, 0]
    straight = np.abs(cross) < 1e-6
    safe = np.where(straight, 1.0, cross)
    shift = np.where(straight[:, None], np.column_stack([u[:, 1], -u[:, 0]]), (before - u) / safe[:, None])
    return np.asarray(plan + distance_m * shift)


def swept_edge(
    plan: Plan, edge: int, profile: Sequence[tuple[float, float]], colour: Colour, layer: int = 0
) -> list[Mesh]:
    """A profile of (metres out of the wall, z), outside on its right going up, along one edge, mitred at both ends."""
    rings = [(grown(plan, out)[[edge, (edge + 1) % len(plan)]], z) for out, z in profile]
    meshes = []
    for (a, za), (b, zb) in pairwise(rings):
        meshes.append(quad([(*a[0], za), (*a[1], za), (*b[1], zb), (*b[0], zb)], colour, layer))
    return meshes


def swept(plan: Plan, profile: Sequence[tuple[float, float]], colour: Colour, layer: int = 0) -> list[Mesh]:
    """`swept_edge` all round."""
    return [m for i in range(len(plan)) for m in swept_edge(plan, i, profile, colour, layer)]


def band(out_m: float, z0: float, z1: float) -> list[tuple[float, float]]:
    """The profile of a flat band."""
    return [(0.0, z0), (out_m, z0), (out_m, z1), (0.0, z1)]


def is_convex(plan: Plan) -> bool:
    a = np.roll(plan, -1, axis=0) - plan
    b = np.roll(a, -1, axis=0)
    return bool((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > -1e-6).all())


class Rectangle:
    """A rectangle of a plan: its middle, the unit vector along its longer side, its length and width in metres."""

    def __init__(self, middle: NDArray[np.float64], along: NDArray[np.float64], length_m: float, width_m: float):
        self.middle, self.along, self.length_m, self.width_m = middle, along, length_m, width_m

    def place(self, local: ArrayLike) -> NDArray[np.float64]:
        """(N, 3) from the rectangle's own axes (x along, y across, z up) to the world's."""
        p = np.asarray(local, np.float64).reshape(-1, 3)
        across = np.array([-self.along[1], self.along[0]])
        return np.column_stack([self.middle + p[:, :1] * self.along + p[:, 1:2] * across, p[:, 2]])

    def corners(self) -> Plan:
        x, y = self.length_m / 2, self.width_m / 2
        return self.place([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)])[:, :2]


def rectangles(plan: Plan) -> list[Rectangle]:
    """The largest rectangles that together cover a plan with right angles only; they may overlap. Empty for others."""
    edge = np.roll(plan, -1, axis=0) - plan
    u = edge[0] / np.linalg.norm(edge[0])
    turn = np.array([[u[0], u[1]], [-u[1], u[0]]])
    local = plan @ turn.T
    step = np.roll(local, -1, axis=0) - local
    if (np.minimum(np.abs(step[:, 0]), np.abs(step[:, 1])) > 1e-3).any():
        return []
    xs, ys = (np.unique(np.round(local[:, k], 4)) for k in (0, 1))
    middles = [((a + b) / 2, (c + d) / 2) for a, b in pairwise(xs) for c, d in pairwise(ys)]
    cells = inside(middles, local).reshape(len(xs) - 1, len(ys) - 1)
    full = [
        (i, j, k, m)
        for i in range(len(xs) - 1)
        for j in range(i + 1, len(xs))
        for k in range(len(ys) - 1)
        for m in range(k + 1, len(ys))
        if cells[i:j, k:m].all()
    ]
    largest = [
        a
        for a in full
        if not any(a != b and b[0] <= a[0] and b[1] >= a[1] and b[2] <= a[2] and b[3] >= a[3] for b in full)
    ]
    found = []
    for i, j, k, m in largest:
        middle = np.array([xs[i] + xs[j], ys[k] + ys[m]]) / 2 @ turn
        size = xs[j] - xs[i], ys[m] - ys[k]
        along = turn[0] if size[0] >= size[1] else turn[1]
        found.append(Rectangle(middle, along, float(max(size)), float(min(size))))
    return found
