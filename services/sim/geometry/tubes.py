"""Round rods along a path, and straight ones: primitives as those of `solids`."""

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from services.sim.geometry.mesh import Colour, Mesh, concatenate, make
from services.sim.geometry.solids import Vector


def tube(
    path: ArrayLike,
    radius: float | Sequence[float],
    segments: int = 8,
    colour: Colour = "#ffffff",
    layer: int = 0,
    closed: bool = False,
) -> Mesh:
    """A round rod along a path ((K, 3)), with lids at the ends, or joined end to start when `closed`. `radius` may
    be one number or one per point."""
    p = np.asarray(path, np.float64).reshape(-1, 3)
    r = np.broadcast_to(np.asarray(radius, np.float64), (len(p),)).copy()
    if closed:
        p, r = np.vstack([p, p[:1]]), np.append(r, r[0])
    step = np.diff(p, axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    tangent = np.vstack([step[:1], step[:-1] + step[1:], step[-1:]])
    if closed:
        tangent[0] = tangent[-1] = step[0] + step[-1]
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    side = np.cross(tangent[0], (0, 0, 1) if abs(tangent[0][2]) < 0.9 else (1, 0, 0))
    angle = np.linspace(0, 2 * pi, segments + 1)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    positions, normals, uv = [], [], []
    for i in range(len(p)):
        side = side - tangent[i] * float(side @ tangent[i])
        side = side / max(float(np.linalg.norm(side)), 1e-12)
        other = np.cross(tangent[i], side)
        n = np.outer(np.cos(angle), side) + np.outer(np.sin(angle), other)
        positions.append(p[i] + n * r[i])
        normals.append(n)
        uv.append(np.column_stack([angle * r[i], np.full(len(angle), along[i])]))
    m, j = segments + 1, np.arange(segments)
    faces = [
        np.concatenate(
            [np.column_stack([a + j, a + j + 1, a + m + j + 1]), np.column_stack([a + j, a + m + j + 1, a + m + j])]
        )
        for a in range(0, m * (len(p) - 1), m)
    ]
    body = make(
        np.concatenate(positions), np.concatenate(faces), np.concatenate(normals), np.concatenate(uv), colour, layer
    )
    if closed:
        return body
    lids = []
    for rim, normal, order in ((positions[0], -tangent[0], -1), (positions[-1], tangent[-1], 1)):
        fan = np.column_stack([np.zeros(segments - 2, int), np.arange(1, segments - 1), np.arange(2, segments)])
        lids.append(
            make(rim[:-1], fan[:, ::order], np.tile(normal, (segments, 1)), np.zeros((segments, 2)), colour, layer)
        )
    return concatenate([body, *lids])


def rod(
    start: Vector, end: Vector, radius: float, segments: int = 6, colour: Colour = "#ffffff", layer: int = 0
) -> Mesh:
    """A straight round rod."""
    return tube([start, end], radius, segments, colour, layer)
