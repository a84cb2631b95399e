"""Ornaments that hang from a lintel or sit on a wall or a pane."""

from math import cos, pi, sin

import numpy as np
from shapely import Polygon

from services.sim.catalogue.palette import BRIGHT, CREAM, GOLD, Paint
from services.sim.catalogue.parts import circle, mark, ring, silhouette, star
from services.sim.catalogue.registry import HANGING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate, make
from services.sim.geometry.solids import cone, cylinder, ellipsoid, frustum, lathe
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "ornaments",
    "wind chime",
    "wind chimes",
    "chimes",
    "windchime",
    "hanging chimes",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "black"),
    places=HANGING,
    size_m=(0.4, 0.4, 1.01),
)
def wind_chime(paint: Paint) -> Mesh:
    parts = [
        cylinder(0.2, 0.06, (0, 0, 0.76), 12, paint.main),
        cone(0.06, 0.12, (0, 0, 0.82), 6, paint.main),
        ring(0.03, 0.009, (0, 0, 0.97), paint.metal, 8, 4, "x"),
    ]
    for i in range(6):
        a = i * pi / 3 + pi / 6
        y, x = 0.155 * cos(a), 0.155 * sin(a)
        low = 0.3 - 0.07 * ((i * 2) % 3)
        parts += [
            rod((x, y, low), (x, y, 0.68), 0.034, 7, paint.main),
            rod((x, y, 0.68), (x, y, 0.77), 0.007, 3, paint.ink),
        ]
    parts += [
        rod((0, 0, 0.12), (0, 0, 0.77), 0.007, 3, paint.ink),
        cylinder(0.07, 0.03, (0, 0, 0.46), 10, paint.accent),
        silhouette([(0, 0.0), (0.07, 0.09), (0, 0.15), (-0.07, 0.09)], 0.02, paint.accent),
    ]
    return concatenate(parts)


@catalogued(
    "ornaments",
    "paper lantern",
    "lantern",
    "chinese lantern",
    "lampion",
    "hanging lantern",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "white"),
    places=HANGING,
    size_m=(0.52, 0.51, 0.96),
)
def lantern(paint: Paint) -> Mesh:
    gold = paint.other(GOLD, "#c22a22", "yellow", "orange", "white")
    profile: list[tuple[float, float]] = []
    for i, a in enumerate(np.linspace(-1.15, 1.15, 11)):
        profile.append((0.26 * cos(a) * (1.0 if i % 2 else 0.95), 0.55 + 0.2 * sin(a)))
    body = lathe(profile, 14, paint.main)
    caps = [cylinder(0.12, 0.05, (0, 0, z), 10, gold) for z in (0.32, 0.73)]
    hook = [rod((0, 0, 0.78), (0, 0, 0.9), 0.01, 4, paint.ink), ring(0.03, 0.01, (0, 0, 0.92), paint.ink, 8, 4, "x")]
    tassel = [
        rod((0, 0, 0.24), (0, 0, 0.32), 0.01, 4, gold),
        ellipsoid(0.035, (0, 0, 0.24), 6, 4, gold),
        frustum(0.05, 0.025, 0.22, (0, 0, 0), 8, gold),
    ]
    return concatenate([body, *caps, *hook, *tassel])


@catalogued(
    "ornaments",
    "star",
    "christmas star",
    "decorative star",
    "five-pointed star",
    colours=BRIGHT,
    places=("wall", "pane"),
    size_m=(0.15, 0.86, 0.81),
)
def star_shape(paint: Paint) -> Mesh:
    rim = star(5, 0.45, 0.18)
    peak = np.array([0.13, 0.0, 0.0])
    parts = [silhouette(rim, 0.04, paint.dark)]
    corners = [np.array([0.02, y, z]) for y, z in rim]
    for i, a in enumerate(corners):
        b = corners[(i + 1) % 10]
        facet = np.array([a, b, peak])
        normal = np.cross(b - a, peak - a)
        flat = np.tile(normal / np.linalg.norm(normal), (3, 1))
        parts.append(make(facet, [(0, 1, 2)], flat, np.zeros((3, 2)), paint.main if i % 2 else paint.light))
    return concatenate(parts)


@catalogued(
    "ornaments",
    "butterfly",
    "wall butterfly",
    "metal butterfly",
    "butterfly ornament",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "white"),
    places=("wall", "pane"),
    size_m=(0.21, 0.97, 0.73),
)
def butterfly(paint: Paint) -> Mesh:
    upper = Polygon([(0.03, 0.0), (0.14, 0.26), (0.34, 0.4), (0.48, 0.37), (0.49, 0.22), (0.4, 0.02), (0.2, -0.05)])
    lower = Polygon([(0.03, 0.0), (0.2, -0.05), (0.36, -0.08), (0.4, -0.2), (0.31, -0.33), (0.2, -0.33), (0.08, -0.18)])
    parts = []
    for s in (-1, 1):
        for wing, spot in ((upper, (0.38, 0.25, 0.052)), (lower, (0.27, -0.2, 0.044))):
            ring_ = [(s * y, z) for y, z in wing.exterior.coords[:-1]]
            inner = [(s * y, z) for y, z in wing.buffer(-0.024, quad_segs=1).exterior.coords[:-1]]
            flat = [
                silhouette(ring_, 0.03, paint.ink),
                mark(inner, 0.022, paint.main),
                mark(circle(spot[2], 8, (s * spot[0], spot[1])), 0.028, paint.accent),
            ]
            parts.append(concatenate(flat).transformed(yaw=s * 0.18))
    body = tube([(0.05, 0, -0.26), (0.06, 0, -0.05), (0.06, 0, 0.14)], [0.015, 0.045, 0.035], 6, paint.ink)
    head = ellipsoid(0.05, (0.06, 0, 0.17), 6, 4, paint.ink)
    feelers = [
        tube([(0.06, 0, 0.19), (0.06, s * 0.08, 0.3), (0.06, s * 0.14, 0.33)], 0.01, 3, paint.ink) for s in (-1, 1)
    ]
    return concatenate([*parts, body, head, *feelers])


@catalogued(
    "ornaments",
    "wreath",
    "door wreath",
    "advent wreath",
    "christmas wreath",
    "leaf wreath",
    colours=("green", "red", "white", "brown", "purple", "yellow"),
    places=("wall", "pane"),
    size_m=(0.27, 0.83, 0.85),
)
def wreath(paint: Paint) -> Mesh:
    parts = [ring(0.29, 0.075, (0.1, 0, 0), paint.dark, 12, 5, "x")]
    for i in range(24):
        a = i * 2 * pi / 24
        r = 0.29 + (0.05 if i % 2 else -0.05)
        turn = a + (0.9 if i % 2 else 2.2)
        leaf = ellipsoid((0.05, 0.115, 0.05), (0, 0, 0), 3, 3, paint.main if i % 3 else paint.light).transformed(
            roll=turn
        )
        parts.append(leaf.transformed(move=(0.16, r * cos(a), r * sin(a))))
    bow = paint.other("#d3202a", GOLD, "red", "brown", "purple")
    parts += [silhouette([(0, -0.29), (s * 0.17, -0.38), (s * 0.17, -0.2)][::s], 0.05, bow, x=0.22) for s in (-1, 1)]
    parts += [silhouette([(0, -0.29), (s * 0.13, -0.42), (s * 0.04, -0.44)][::s], 0.03, bow, x=0.22) for s in (-1, 1)]
    parts += [
        ellipsoid(0.04, (0.24, 0.29 * cos(a), 0.29 * sin(a)), 6, 3, paint.other("#e33a2e", CREAM, "red", "brown"))
        for a in (0.2, 1.1, 2.0, 2.95)
    ]
    return concatenate([*parts, ellipsoid(0.05, (0.25, 0, -0.29), 6, 4, bow)])
