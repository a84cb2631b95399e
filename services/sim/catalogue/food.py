"""Food, larger than life as a shop's dummies are, so that it can be told apart from a drone's distance."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
from shapely import Point, Polygon, box

from services.sim.catalogue.palette import INK, LEAF, TAN, Paint
from services.sim.catalogue.parts import bent, circle, fluted, mark, ring, silhouette, tinted
from services.sim.catalogue.registry import SMALL, STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import cylinder, ellipsoid, frustum, lathe
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "food",
    "pumpkin",
    "jack-o'-lantern",
    "carved pumpkin",
    "halloween pumpkin",
    "squash",
    colours=("orange", "white", "green", "yellow"),
    places=STANDING,
    size_m=(0.66, 0.65, 0.64),
)
def pumpkin(paint: Paint) -> Mesh:
    body = fluted(ellipsoid((0.27, 0.27, 0.2), (0, 0, 0.2), 32, 6, paint.main), 8, 0.1, paint.dark)
    stem = tube(
        bent([(0, 0, 0.37), (0, 0.01, 0.45), (0, 0.07, 0.5)], 2),
        [0.06, 0.045, 0.04, 0.04, 0.045],
        6,
        paint.other("#3f6b22", "#6b4a22", "green"),
    )
    ink = "#120d08"
    eyes = [Polygon([(s * 0.11 - 0.055, 0.225), (s * 0.11 + 0.055, 0.225), (s * 0.11, 0.315)]) for s in (-1, 1)]
    nose = Polygon([(-0.025, 0.175), (0.025, 0.175), (0, 0.22)])
    grin = Polygon(
        [
            (-0.17, 0.16),
            (-0.08, 0.125),
            (-0.05, 0.15),
            (-0.02, 0.12),
            (0.04, 0.12),
            (0.06, 0.148),
            (0.09, 0.13),
            (0.17, 0.16),
            (0.1, 0.065),
            (0.045, 0.05),
            (0.02, 0.08),
            (-0.03, 0.05),
            (-0.1, 0.065),
        ]
    )
    strips = [grin.intersection(box(-0.18 + 0.06 * i, 0, -0.12 + 0.06 * i, 0.3)) for i in range(6)]
    return concatenate([body, stem, *[_laid_on(mark(s, 0.0, ink)) for s in (*eyes, nose, *strips)]]).transformed(
        scale=1.2
    )


def _laid_on(flat: Mesh) -> Mesh:
    """A small flat mark laid on the pumpkin's side."""
    p = flat.positions.copy()
    bulge = 1 - (p[:, 1] / 0.27) ** 2 - ((p[:, 2] - 0.2) / 0.2) ** 2
    p[:, 0] = 0.27 * np.sqrt(np.clip(bulge, 0.05, 1)) + 0.01
    return replace(flat, positions=p)


@catalogued(
    "food",
    "watermelon slice",
    "slice of watermelon",
    "watermelon",
    "melon slice",
    "piece of watermelon",
    colours=("red", "yellow", "pink", "orange"),
    places=SMALL,
    size_m=(0.21, 0.84, 0.44),
)
def watermelon(paint: Paint) -> Mesh:
    def half(r: float) -> list[tuple[float, float]]:
        return [(r * cos(a), 0.42 + r * sin(a)) for a in np.linspace(pi, 2 * pi, 15)]

    seeds = [
        Point(r * cos(a), 0.42 + r * sin(a))
        for r, angles in ((0.25, (3.45, 4.1, 4.71, 5.33, 5.97)), (0.13, (3.8, 4.71, 5.62)))
        for a in angles
    ]
    parts = [
        silhouette(half(0.42), 0.16, "#1f7a33"),
        mark(half(0.375), 0.086, "#e9f5d0"),
        mark(half(0.35), 0.092, paint.main),
    ]
    parts += [mark(s.buffer(0.022, quad_segs=1), 0.098, INK) for s in seeds]
    return concatenate(parts).transformed(pitch=-0.1)


@catalogued(
    "food",
    "bananas",
    "banana",
    "bunch of bananas",
    "plantains",
    colours=("yellow", "green"),
    places=SMALL,
    size_m=(0.29, 0.62, 0.53),
)
def bananas(paint: Paint) -> Mesh:
    parts = []
    for k, (reach, x) in enumerate(((-0.1, 0.0), (0.02, 0.08), (0.14, 0.04), (0.26, -0.04))):
        path = bent(
            [(0, 0, 0.47), (x, reach * 0.4 + 0.05, 0.4), (x * 1.3, reach + 0.1, 0.22), (x, reach - 0.06, 0.05)], 2
        )
        fruit = tube(path, [0.025, 0.035, 0.062, 0.07, 0.07, 0.055, 0.022], 6, paint.main if k % 2 else paint.light)
        tip = tube([(x, reach - 0.045, 0.06), (x, reach - 0.09, 0.025)], [0.026, 0.016], 5, "#4a3512")
        parts += [fruit, tip]
    stalk = tube([(0, 0.03, 0.44), (0, -0.02, 0.53)], [0.055, 0.04], 6, paint.other("#6b4d1c", "#3c2d12", "brown"))
    return concatenate([*parts, stalk])


@catalogued(
    "food",
    "cake",
    "birthday cake",
    "layer cake",
    "torte",
    "tiered cake",
    colours=("pink", "white", "brown", "blue", "purple", "yellow", "green"),
    places=SMALL,
    size_m=(0.67, 0.67, 0.65),
)
def cake(paint: Paint) -> Mesh:
    icing = paint.other("#fffaf0", "#f06aa2", "white", "yellow")
    parts = [
        frustum(0.26, 0.3, 0.04, (0, 0, 0), 16, "#dfe3e6"),
        cylinder(0.25, 0.19, (0, 0, 0.04), 18, paint.main),
        cylinder(0.155, 0.15, (0, 0, 0.23), 14, paint.main),
    ]
    for radius, z in ((0.252, 0.23), (0.157, 0.38)):
        drop = lathe([(radius, z - 0.025), (radius + 0.006, z + 0.008), (0, z + 0.012)], 16, icing)
        parts.append(drop)
    for i in range(3):
        y = (i - 1) * 0.08
        parts += [
            rod((0.03, y, 0.38), (0.03, y, 0.51), 0.016, 5, paint.other("#3a7bd5", "#e03c31", "blue", "purple")),
            ellipsoid((0.018, 0.018, 0.035), (0.03, y, 0.545), 5, 4, "#ffb21a"),
        ]
    parts += [
        ellipsoid(0.036, (0.215 * cos(a), 0.215 * sin(a), 0.265), 5, 3, "#c8102e")
        for a in np.arange(8) * pi / 4 + pi / 8
    ]
    return concatenate(parts).transformed(scale=1.12)


@catalogued(
    "food",
    "pineapple",
    "ananas",
    "whole pineapple",
    colours=("yellow", "orange", "pink"),
    places=SMALL,
    size_m=(0.39, 0.39, 0.81),
)
def pineapple(paint: Paint) -> Mesh:
    body = tinted(
        ellipsoid((0.17, 0.17, 0.22), (0, 0, 0.22), 14, 8, paint.main),
        lambda i: paint.dark if (i + i // 14) % 4 == 0 else paint.main,
    )
    leaves = []
    for layer, (n, lean, top) in enumerate(((8, 0.17, 0.56), (6, 0.1, 0.65), (3, 0.03, 0.72))):
        for i in range(n):
            a = i * 2 * pi / n + layer * 0.4
            c, s = cos(a), sin(a)
            leaves.append(
                tube(
                    [
                        (0.04 * c, 0.04 * s, 0.4),
                        (0.5 * lean * c + 0.04 * c, 0.5 * lean * s + 0.04 * s, 0.4 + 0.6 * (top - 0.4)),
                        (lean * c, lean * s, top),
                    ],
                    [0.03, 0.035, 0.004],
                    3,
                    LEAF if layer % 2 else "#3f9440",
                )
            )
    return concatenate([body, *leaves]).transformed(scale=1.12)


@catalogued(
    "food",
    "ice cream cone",
    "ice cream",
    "ice-cream cone",
    "ice cream cornet",
    "gelato",
    colours=("pink", "white", "brown", "green", "blue", "purple", "yellow"),
    places=STANDING,
    size_m=(0.43, 0.44, 0.99),
)
def ice_cream(paint: Paint) -> Mesh:
    cone = tinted(
        lathe([(0.03, 0.03), (0.085, 0.17), (0.14, 0.3), (0.17, 0.38)], 12, TAN),
        lambda i: TAN if (i + i // 12) % 3 else "#b97c3c",
    )
    parts = [cylinder(0.14, 0.03, (0, 0, 0), 12, "#8a8f96"), cone]
    parts += [
        ellipsoid((0.215, 0.215, 0.18), (0, 0, 0.48), 12, 6, paint.main),
        ellipsoid((0.175, 0.175, 0.17), (0, 0, 0.71), 12, 6, paint.light),
    ]
    parts += [
        ellipsoid(0.055, (0, -0.02, 0.89), 7, 5, paint.other("#d0142c", "#7a1020", "pink")),
        rod((0.02, 0.08, 0.72), (0.02, 0.2, 0.98), 0.03, 5, TAN),
    ]
    return concatenate(parts)


@catalogued(
    "food",
    "doughnut",
    "donut",
    "glazed doughnut",
    "iced doughnut",
    "ring doughnut",
    colours=("pink", "white", "brown", "blue", "green", "purple"),
    places=SMALL,
    size_m=(0.25, 0.66, 0.66),
)
def doughnut(paint: Paint) -> Mesh:
    dough = ring(0.215, 0.115, (0, 0, 0.33), TAN, 16, 7, "x")
    icing = ring(0.212, 0.105, (0.03, 0, 0.33), paint.main, 16, 8, "x")
    sprinkles = []
    hues = [
        c for c in ("#ffd21f", "#e5323b", "#3e86e0", "#ffffff", "#37a34a") if paint.colour != "white" or c != "#ffffff"
    ]
    for i in range(14):
        a, r = i * 2 * pi / 14, 0.215 + (-0.03 if i % 2 else 0.035)
        one = mark(circle((0.045, 0.016), 4), 0.0, hues[i % len(hues)]).transformed(roll=a + (0.6 if i % 3 else 1.9))
        sprinkles.append(one.transformed(move=(0.134, r * cos(a), 0.33 + r * sin(a))))
    return concatenate([dough, icing, *sprinkles])
