"""Shapes that many things of the catalogue share: rings, handles, silhouettes, flat marks, tapered boxes.

Silhouettes lie in the plane of (y, z), seen from +x; y runs to the right of someone who looks at the front.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import asin, atan2, cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from services.sim.geometry.mesh import Colour, Mesh, concatenate, rgb
from services.sim.geometry.solids import Vector, extruded, polygon, quad
from services.sim.geometry.tubes import tube

Points = NDArray[np.float64]


def circle(radius: float | tuple[float, float], n: int = 16, centre: tuple[float, float] = (0, 0)) -> Points:
    """(n, 2), counter-clockwise."""
    a = np.linspace(0, 2 * pi, n, endpoint=False)
    return np.asarray(np.column_stack([np.cos(a), np.sin(a)]) * np.asarray(radius) + np.asarray(centre), np.float64)


def star(points: int, outer: float, inner: float, centre: tuple[float, float] = (0, 0)) -> Points:
    """(2 points, 2), counter-clockwise, one point up."""
    a = np.arange(2 * points) * pi / points + pi / 2
    r = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
    return np.asarray(np.column_stack([np.cos(a) * r, np.sin(a) * r]) + np.asarray(centre), np.float64)


def disc(radius: float, thickness: float, centre: Vector, colour: Colour, n: int = 16) -> Mesh:
    """A round plate facing +x, its middle at `centre`."""
    return extruded(circle(radius, n), thickness, colour).transformed(move=centre)


def silhouette(shape: BaseGeometry | ArrayLike, thickness: float, colour: Colour, x: float = 0.0) -> Mesh:
    """A flat shape without holes (one or several polygons, or an outline) drawn out along x about `x`."""
    return concatenate([extruded(ring, thickness, colour, x=x) for ring in _rings(shape)])


def mark(shape: BaseGeometry | ArrayLike, x: float, colour: Colour) -> Mesh:
    """A flat shape without holes at `x`, visible from +x only."""
    turn = np.array([[0, 0, 1, x], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], np.float64)
    return concatenate([polygon(ring, 0.0, colour).transformed(turn) for ring in _rings(shape)])


def rectangle(y0: float, z0: float, y1: float, z1: float) -> Points:
    return np.array([(y0, z0), (y1, z0), (y1, z1), (y0, z1)], np.float64)


def _rings(shape: BaseGeometry | ArrayLike) -> list[Points]:
    if not isinstance(shape, BaseGeometry):
        shape = Polygon(np.asarray(shape, np.float64))
    shape = shape.simplify(1e-3)
    return [np.asarray(orient(part, 1.0).exterior.coords, np.float64)[:-1] for part in getattr(shape, "geoms", [shape])]


def ring(
    radius: float, thickness: float, centre: Vector, colour: Colour, n: int = 16, sides: int = 6, facing: str = "z"
) -> Mesh:
    """A torus whose axis is x or z; `thickness` is the radius of its tube."""
    c = circle(radius, n)
    flat = np.zeros(n)
    path = np.column_stack([c, flat]) if facing == "z" else np.column_stack([flat, c])
    return tube(path + np.asarray(centre), thickness, sides, colour, closed=True)


def arch(
    start: Vector,
    end: Vector,
    rise: Vector,
    radius: float,
    colour: Colour,
    steps: int = 8,
    sides: int = 5,
) -> Mesh:
    """A rod bent in half an ellipse from `start` to `end`, its middle raised by the vector `rise`: a handle."""
    a, b, up = (np.asarray(v, np.float64) for v in (start, end, rise))
    t = np.linspace(0, pi, steps + 1)[:, None]
    path = (a + b) / 2 + (a - b) / 2 * np.cos(t) + up * np.sin(t)
    return tube(path, radius, sides, colour)


def tapered(
    bottom: tuple[float, float],
    top: tuple[float, float],
    height: float,
    foot: Vector,
    colour: Colour,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """A box whose underside and top differ in size ((x, y) each); `shift` moves the top."""

    def corners(size: tuple[float, float], z: float, by: tuple[float, float]) -> Points:
        sx, sy = size[0] / 2, size[1] / 2
        flat = np.array([(-sx, -sy), (sx, -sy), (sx, sy), (-sx, sy)]) + by
        return np.asarray(np.column_stack([flat, np.full(4, z)]) + np.asarray(foot), np.float64)

    low, high = corners(bottom, 0.0, (0.0, 0.0)), corners(top, height, shift)
    sides = [quad([low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]], colour) for i in range(4)]
    return concatenate([*sides, quad(high, colour), quad(low[::-1], colour)])


def bent(points: Sequence[Vector], per_leg: int = 3) -> Points:
    """A smooth path (Catmull-Rom) through the points, `per_leg` pieces between two of them."""
    p = np.asarray(points, np.float64)
    padded = np.vstack([2 * p[0] - p[1], p, 2 * p[-1] - p[-2]])
    out = []
    for i in range(1, len(padded) - 2):
        a, b, c, d = padded[i - 1 : i + 3]
        for t in np.arange(per_leg) / per_leg:
            out.append(
                0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
            )
    return np.array([*out, p[-1]])


def to_front(mesh: Mesh) -> Mesh:
    """What pointed up points to the front (+x)."""
    return mesh.transformed(pitch=pi / 2)


def tinted(mesh: Mesh, colour_of: Callable[[int], Colour]) -> Mesh:
    """Each flat piece (three corners of its own) in the colour of its number: facets and patterns."""
    corners = mesh.faces.reshape(-1)
    colours = np.repeat(np.array([rgb(colour_of(i)) for i in range(len(mesh.faces))], np.uint8), 3, axis=0)
    return Mesh(
        mesh.positions[corners],
        mesh.normals[corners],
        mesh.uv[corners],
        colours,
        mesh.layer[corners],
        np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
    )


def fluted(mesh: Mesh, lobes: int, depth: float, groove: Colour) -> Mesh:
    """Lobes round the z axis, as a pumpkin has; the grooves between them take their own colour."""
    p = mesh.positions.astype(np.float64)
    wave = np.cos(np.arctan2(p[:, 1], p[:, 0]) * lobes)
    p[:, :2] *= (1 - depth * (1 - wave) / 2)[:, None]
    colours = mesh.colours.copy()
    colours[wave < -0.5] = rgb(groove)
    return replace(mesh, positions=p.astype(np.float32), colours=colours)


def on_ball(flat: Mesh, radii: tuple[float, float, float], z: float, bearing: float, rise: float) -> Mesh:
    """A small mark laid on an ellipsoid whose middle is at height z, towards `bearing` and `rise` (radians)."""
    point = np.array([cos(bearing) * cos(rise), sin(bearing) * cos(rise), sin(rise)]) * radii
    normal = point / np.square(radii)
    normal /= np.linalg.norm(normal)
    where = point + normal * 0.008 + np.array([0, 0, z])
    return flat.transformed(yaw=atan2(normal[1], normal[0]), pitch=-asin(normal[2]), move=where.tolist())
