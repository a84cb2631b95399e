"""Primitives: boxes, prisms, turned and drawn-out shapes, spheres, tubes, plates.

Every function returns a `Mesh` with uv in metres along the surface (plates: 0..1), one colour and one layer; build
composite things with `mesh.concatenate`.
"""

from collections.abc import Sequence
from math import dist, pi, sqrt

import mapbox_earcut as earcut
import numpy as np
from numpy.typing import ArrayLike, NDArray

from services.sim.geometry.mesh import Colour, Mesh, concatenate, make, rgb

Vector = Sequence[float]

_BOX_FACES = (  # normal, then the directions of u and v
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
)
_QUAD = np.array([(0, 1, 2), (0, 2, 3)], np.uint32)
_UNIT_UV = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float64)
_BOX_NORMALS = np.array([n for n, _, _ in _BOX_FACES], np.float64)
_BOX_SPANS = np.array([(u, v) for _, u, v in _BOX_FACES], np.float64)
_BOX_CORNERS = np.array(
    [
        [np.array(n) + a * np.array(u) + b * np.array(v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for n, u, v in _BOX_FACES
    ],
    np.float64,
)
_SIDES = {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4, "-z": 5}


def quad(corners: ArrayLike, colour: Colour = "#ffffff", layer: int = 0, uv: ArrayLike | None = None) -> Mesh:
    """Four corners counter-clockwise seen from the front, starting at the lower left; uv in metres by default."""
    p = np.asarray(corners, np.float64).reshape(4, 3)
    # plain numbers: a scene has thousands of these, and numpy is slow on three
    (ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz) = p.tolist()
    ux, uy, uz, vx, vy, vz = cx - ax, cy - ay, cz - az, dx - bx, dy - by, dz - bz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = max(sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    w, h = dist((ax, ay, az), (bx, by, bz)), dist((ax, ay, az), (dx, dy, dz))
    return Mesh(
        p.astype(np.float32),
        np.array([(nx / length, ny / length, nz / length)] * 4, np.float32),
        np.array([(0, 0), (w, 0), (w, h), (0, h)] if uv is None else uv, np.float32).reshape(4, 2),
        np.array([rgb(colour)] * 4, np.uint8),
        np.full(4, layer, np.uint16),
        _QUAD.copy(),
    )


def box(
    size: Vector,
    centre: Vector = (0.0, 0.0, 0.0),
    colour: Colour = "#ffffff",
    layer: int = 0,
    without: Sequence[str] = (),
) -> Mesh:
    """A box of `size` (x, y, z) about `centre`; sides named in `without` ("+x", "-z", ...) are left out."""
    half = np.asarray(size, np.float64) / 2
    skip = {_SIDES[s] for s in without}
    kept = [i for i in range(6) if i not in skip]
    positions = _BOX_CORNERS[kept] * half + np.asarray(centre, np.float64)
    spans = 2 * np.abs(_BOX_SPANS[kept] @ half)
    uv = _UNIT_UV[None] * spans[:, None, :]
    faces = _QUAD[None] + (np.arange(len(kept), dtype=np.uint32) * 4)[:, None, None]
    return make(positions, faces, np.repeat(_BOX_NORMALS[kept], 4, axis=0), uv, colour, layer)


def standing_box(size: Vector, foot: Vector = (0.0, 0.0, 0.0), colour: Colour = "#ffffff", layer: int = 0) -> Mesh:
    """A box whose underside's middle is `foot`."""
    return box(size, (foot[0], foot[1], foot[2] + size[2] / 2), colour, layer)


def plate(
    width: float, height: float, centre: Vector = (0.0, 0.0, 0.0), colour: Colour = "#ffffff", layer: int = 0
) -> Mesh:
    """An upright rectangle facing +x (one side), uv 0..1: for pictures. Seen from the front, its left edge is at -y."""
    x, y, z = centre
    w, h = width / 2, height / 2
    corners = [(x, y - w, z - h), (x, y + w, z - h), (x, y + w, z + h), (x, y - w, z + h)]
    return quad(corners, colour, layer, [(0, 0), (1, 0), (1, 1), (0, 1)])


def polygon(outline: ArrayLike, z: float = 0.0, colour: Colour = "#ffffff", layer: int = 0, up: bool = True) -> Mesh:
    """A flat, filled outline ((N, 2), counter-clockwise) at height z, facing up or down."""
    ring = np.asarray(outline, np.float64).reshape(-1, 2)
    faces = triangulated(ring)
    p = np.column_stack([ring, np.full(len(ring), z)])
    normal = (0, 0, 1) if up else (0, 0, -1)
    return make(p, faces if up else faces[:, ::-1], np.tile(normal, (len(p), 1)), ring, colour, layer)


def triangulated(ring: NDArray[np.float64], holes: Sequence[NDArray[np.float64]] = ()) -> NDArray[np.uint32]:
    """(M, 3) counter-clockwise faces filling a ring, minus holes; indices run through the ring, then the holes."""
    rings = [ring, *holes]
    points = np.ascontiguousarray(np.concatenate(rings), np.float64)
    ends = np.cumsum([len(r) for r in rings]).astype(np.uint32)
    faces = earcut.triangulate_float64(points, ends).reshape(-1, 3)
    a, b, c = (points[faces[:, i]] for i in range(3))
    u, v = b - a, c - a
    backwards = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    faces[backwards] = faces[backwards][:, ::-1]
    return faces.astype(np.uint32)


def prism(
    outline: ArrayLike,
    z0: float,
    z1: float,
    colour: Colour = "#ffffff",
    layer: int = 0,
    top: bool = True,
    bottom: bool = False,
) -> Mesh:
    """An outline ((N, 2), counter-clockwise) drawn up from z0 to z1, with hard edges."""
    ring = np.asarray(outline, np.float64).reshape(-1, 2)
    parts = []
    run = 0.0
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        length = float(np.linalg.norm(b - a))
        uv = [(run, z0), (run + length, z0), (run + length, z1), (run, z1)]
        parts.append(quad([(*a, z0), (*b, z0), (*b, z1), (*a, z1)], colour, layer, uv))
        run += length
    if top:
        parts.append(polygon(ring, z1, colour, layer))
    if bottom:
        parts.append(polygon(ring, z0, colour, layer, up=False))
    return concatenate(parts)


def extruded(outline: ArrayLike, thickness: float, colour: Colour = "#ffffff", layer: int = 0, x: float = 0.0) -> Mesh:
    """An upright silhouette ((N, 2) of (y, z), counter-clockwise seen from +x), `thickness` deep along x about `x`."""
    flat = prism(outline, -thickness / 2, thickness / 2, colour, layer, bottom=True)
    turn = np.array([[0, 0, 1, x], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], np.float64)
    return flat.transformed(turn)


def lathe(
    profile: ArrayLike,
    segments: int = 12,
    colour: Colour = "#ffffff",
    layer: int = 0,
    smooth: bool = False,
) -> Mesh:
    """A profile ((K, 2) of (radius, z), from the bottom up, outside on its right) revolved about z.

    Radius 0 at an end closes the shape. `smooth` rounds the shading along the profile; round the axis it is always
    smooth.
    """
    k = np.asarray(profile, np.float64).reshape(-1, 2)
    angle = np.linspace(0, 2 * pi, segments + 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    edge = np.diff(k, axis=0)
    flat = np.column_stack([edge[:, 1], -edge[:, 0]])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(edge, axis=1))])
    parts = []
    for i in range(len(edge)):
        if np.linalg.norm(edge[i]) < 1e-9:
            continue
        n0, n1 = flat[i], flat[i]
        if smooth:
            n0 = flat[i] if i == 0 else flat[i - 1] + flat[i]
            n1 = flat[i] if i == len(edge) - 1 else flat[i] + flat[i + 1]
        mean_radius = max(float(k[:, 0].max()), 1e-6)
        p, n, uv = [], [], []
        for (r, z), (nr, nz), v in ((k[i], n0, along[i]), (k[i + 1], n1, along[i + 1])):
            length = max(float(np.hypot(nr, nz)), 1e-12)
            p.append(np.column_stack([ring * r, np.full(len(ring), z)]))
            n.append(np.column_stack([ring * (nr / length), np.full(len(ring), nz / length)]))
            uv.append(np.column_stack([angle * mean_radius, np.full(len(ring), v)]))
        j = np.arange(segments)
        m = segments + 1
        lower = np.column_stack([j, j + 1, m + j + 1]) if k[i, 0] > 1e-9 else np.zeros((0, 3))
        upper = np.column_stack([j, m + j + 1, m + j]) if k[i + 1, 0] > 1e-9 else np.zeros((0, 3))
        faces = np.concatenate([lower, upper])
        parts.append(make(np.concatenate(p), faces, np.concatenate(n), np.concatenate(uv), colour, layer))
    return concatenate(parts)


def frustum(
    radius_bottom: float,
    radius_top: float,
    height: float,
    foot: Vector = (0.0, 0.0, 0.0),
    segments: int = 12,
    colour: Colour = "#ffffff",
    layer: int = 0,
    caps: bool = True,
) -> Mesh:
    """A cone cut off: standing on `foot`, with top and bottom lids where `caps` and the radius is not 0."""
    profile = [(radius_bottom, 0.0), (radius_top, height)]
    if caps and radius_bottom > 0:
        profile.insert(0, (0.0, 0.0))
    if caps and radius_top > 0:
        profile.append((0.0, height))
    return lathe(profile, segments, colour, layer).transformed(move=foot)


def cylinder(
    radius: float,
    height: float,
    foot: Vector = (0.0, 0.0, 0.0),
    segments: int = 12,
    colour: Colour = "#ffffff",
    layer: int = 0,
) -> Mesh:
    return frustum(radius, radius, height, foot, segments, colour, layer)


def cone(
    radius: float,
    height: float,
    foot: Vector = (0.0, 0.0, 0.0),
    segments: int = 12,
    colour: Colour = "#ffffff",
    layer: int = 0,
) -> Mesh:
    return frustum(radius, 0.0, height, foot, segments, colour, layer)


def ellipsoid(
    radii: float | Vector,
    centre: Vector = (0.0, 0.0, 0.0),
    segments: int = 12,
    rings: int = 7,
    colour: Colour = "#ffffff",
    layer: int = 0,
) -> Mesh:
    """A sphere (one radius) or an ellipsoid (three)."""
    a = np.linspace(-pi / 2, pi / 2, rings + 1)
    profile = np.column_stack([np.cos(a), np.sin(a)])
    profile[[0, -1], 0] = 0.0
    ball = lathe(profile, segments, colour, layer, smooth=True)
    return ball.transformed(scale=np.broadcast_to(np.asarray(radii, np.float64), (3,)).tolist(), move=centre)
