"""Ornaments: what is there only to be looked at."""

from math import cos, pi, sin

import numpy as np

from services.sim.catalogue.palette import CREAM, GOLD, INK, SKIN, Paint
from services.sim.catalogue.parts import bent, disc, ring
from services.sim.catalogue.registry import BIG, STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box as block
from services.sim.geometry.solids import cone, cylinder, ellipsoid, frustum, lathe, quad
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "ornaments",
    "garden gnome",
    "gnome",
    "garden dwarf",
    "lawn gnome",
    colours=("red", "blue", "green", "purple", "orange", "yellow", "pink"),
    places=STANDING,
    size_m=(0.43, 0.53, 0.91),
)
def garden_gnome(paint: Paint) -> Mesh:
    parts = [
        lathe([(0, 0.1), (0.18, 0.1), (0.2, 0.2), (0.13, 0.44), (0, 0.46)], 12, paint.main),
        lathe([(0, 0.52), (0.16, 0.52), (0.165, 0.56), (0.1, 0.7), (0.02, 0.9), (0, 0.9)], 12, paint.main),
        ellipsoid((0.12, 0.125, 0.11), (0, 0, 0.47), 9, 4, SKIN),
        tube([(0.09, 0, 0.46), (0.15, 0, 0.38), (0.165, 0, 0.24)], [0.1, 0.085, 0.012], 7, "#fdfdfb"),
        ellipsoid(0.034, (0.135, 0, 0.485), 6, 4, "#e88a74"),
        lathe([(0.192, 0.215), (0.18, 0.255)], 12, INK),
    ]
    for s in (-1, 1):
        parts += [
            ellipsoid((0.12, 0.085, 0.07), (0.06, s * 0.1, 0.06), 7, 4, INK),
            tube(
                [(0, s * 0.13, 0.4), (0.04, s * 0.21, 0.3), (0.12, s * 0.15, 0.27)],
                [0.055, 0.055, 0.045],
                6,
                paint.main,
            ),
            ellipsoid(0.042, (0.14, s * 0.13, 0.27), 6, 4, SKIN),
            disc(0.017, 0.02, (0.118, s * 0.045, 0.512), INK, 6),
        ]
    return concatenate(parts)


@catalogued(
    "ornaments",
    "flag",
    "banner",
    "flag pole",
    "flagpole",
    "pennant",
    colours=("red", "orange", "green", "blue", "purple", "yellow", "white", "black"),
    places=BIG,
    size_m=(0.36, 1.11, 1.6),
)
def flag(paint: Paint) -> Mesh:
    def at(i: int, z: float) -> tuple[float, float, float]:
        y = 0.03 + i * 0.13
        return (0.07 * sin(i * 1.1) * min(1.0, i / 2), y, z - 0.012 * i)

    parts = []
    for i in range(7):
        stripe = (
            (0.9, 1.1, paint.main),
            (1.1, 1.28, paint.other("#ffffff", "#d3202a", "white")),
            (1.28, 1.5, paint.main),
        )
        for z0, z1, colour in stripe:
            parts.append(quad([at(i, z0), at(i + 1, z0), at(i + 1, z1), at(i, z1)], colour).two_sided())
    pole = [
        rod((0, 0, 0.04), (0, 0, 1.56), 0.024, 6, paint.other("#d9dde0", "#6d747d", "white")),
        ellipsoid(0.045, (0, 0, 1.55), 7, 4, GOLD),
    ]
    return concatenate([*parts, *pole, frustum(0.18, 0.1, 0.07, (0, 0, 0), 10, "#5f656c")])


@catalogued(
    "ornaments",
    "bird cage",
    "birdcage",
    "cage with a bird",
    "parrot cage",
    colours=("white", "black", "red", "blue", "green", "yellow", "pink"),
    places=STANDING,
    size_m=(0.5, 0.49, 0.87),
)
def bird_cage(paint: Paint) -> Mesh:
    parts = [
        cylinder(0.25, 0.1, (0, 0, 0), 14, paint.main),
        ring(0.235, 0.014, (0, 0, 0.33), paint.main, 11, 3),
        ring(0.235, 0.014, (0, 0, 0.54), paint.main, 11, 3),
    ]
    for i in range(11):
        c, s = cos(i * 2 * pi / 11), sin(i * 2 * pi / 11)
        parts.append(
            tube(
                [
                    (0.235 * c, 0.235 * s, 0.08),
                    (0.235 * c, 0.235 * s, 0.54),
                    (0.16 * c, 0.16 * s, 0.69),
                    (0.01 * c, 0.01 * s, 0.76),
                ],
                0.013,
                3,
                paint.main,
            )
        )
    bird = paint.other("#f6c915", "#2f7fe0", "yellow", "white")
    parts += [ellipsoid(0.045, (0, 0, 0.765), 6, 4, paint.main), ring(0.04, 0.012, (0, 0, 0.82), paint.main, 7, 3, "x")]
    parts += [rod((0, -0.2, 0.27), (0, 0.2, 0.27), 0.012, 4, paint.metal)]
    parts += [
        ellipsoid((0.06, 0.095, 0.075), (0, 0, 0.355), 6, 4, bird),
        ellipsoid(0.052, (0, 0.085, 0.43), 7, 4, bird),
        cone(0.02, 0.05, segments=5, colour="#e8571b").transformed(roll=-pi / 2, move=(0, 0.13, 0.43)),
        tube([(0, -0.06, 0.34), (0, -0.17, 0.29)], [0.04, 0.015], 4, bird),
    ]
    return concatenate(parts)


@catalogued(
    "ornaments",
    "snowman",
    "snow man",
    "frosty snowman",
    colours=("white",),
    places=STANDING,
    size_m=(0.53, 0.82, 0.98),
)
def snowman(paint: Paint) -> Mesh:
    coal = "#17181b"
    parts = [
        ellipsoid((0.22, 0.22, 0.2), (0, 0, 0.19), 10, 6, paint.main),
        ellipsoid((0.17, 0.17, 0.155), (0, 0, 0.46), 10, 6, paint.main),
        ellipsoid(0.13, (0, 0, 0.69), 9, 6, paint.main),
    ]
    parts += [
        cylinder(0.17, 0.025, (0, 0, 0.78), 10, coal),
        cylinder(0.105, 0.17, (0, 0, 0.8), 10, coal),
        lathe([(0.108, 0.815), (0.108, 0.85)], 10, "#cf2027"),
    ]
    parts += [
        lathe([(0.115, 0.575), (0.145, 0.6), (0.115, 0.63)], 10, "#cf2027"),
        block((0.03, 0.07, 0.2), (0.17, 0.07, 0.5), "#cf2027"),
    ]
    parts += [cone(0.032, 0.2, segments=6, colour="#f07a13").transformed(pitch=pi / 2, move=(0.11, 0, 0.69))]
    parts += [disc(0.022, 0.03, (0.115, s * 0.05, 0.73), coal, 6) for s in (-1, 1)]
    parts += [disc(0.024, 0.03, (x, 0, z), coal, 6) for x, z in ((0.155, 0.53), (0.17, 0.45), (0.21, 0.25))]
    parts += [
        tube([(0, s * 0.14, 0.48), (0.02, s * 0.3, 0.58), (0.02, s * 0.4, 0.7)], [0.02, 0.016, 0.01], 4, "#5a3a1d")
        for s in (-1, 1)
    ]
    return concatenate(parts)


@catalogued(
    "ornaments",
    "flamingo",
    "garden flamingo",
    "lawn flamingo",
    "plastic flamingo",
    colours=("pink", "white", "red", "orange", "purple"),
    places=BIG,
    size_m=(0.34, 0.87, 1.25),
)
def flamingo(paint: Paint) -> Mesh:
    neck = bent([(0, 0.15, 0.68), (0, 0.31, 0.78), (0, 0.28, 0.96), (0, 0.19, 1.06), (0, 0.24, 1.18)], 3)
    leg = paint.other("#e8567a", "#f2903a", "red", "pink")
    parts = [
        ellipsoid((0.15, 0.26, 0.15), (0, 0, 0.64), 12, 6, paint.main),
        tube([(0, -0.15, 0.64), (0, -0.3, 0.63), (0, -0.42, 0.55)], [0.12, 0.08, 0.01], 6, paint.main),
        ellipsoid((0.04, 0.19, 0.1), (0.13, -0.05, 0.66), 8, 4, paint.dark),
        tube(neck, np.linspace(0.075, 0.048, len(neck)).tolist(), 7, paint.main),
        ellipsoid((0.07, 0.095, 0.07), (0, 0.265, 1.18), 8, 5, paint.main),
        tube([(0, 0.32, 1.18), (0, 0.41, 1.15)], [0.05, 0.042], 6, paint.other("#fff3e6", "#f7b08a", "white")),
        tube([(0, 0.4, 1.155), (0, 0.43, 1.07)], [0.045, 0.012], 6, INK),
        disc(0.018, 0.15, (0, 0.28, 1.2), INK, 6),
        tube([(0.04, 0.02, 0.55), (0.04, 0.0, 0.04)], 0.026, 5, leg),
        tube([(-0.04, 0.0, 0.55), (-0.04, 0.16, 0.42), (-0.04, 0.03, 0.3)], 0.026, 5, leg),
        lathe([(0, 0), (0.17, 0), (0.14, 0.05), (0, 0.06)], 10, "#4d8a3a"),
    ]
    return concatenate(parts)


@catalogued(
    "ornaments",
    "toadstool",
    "mushroom",
    "garden mushroom",
    "fly agaric",
    colours=("red", "brown", "orange", "blue", "purple", "pink"),
    places=STANDING,
    size_m=(0.72, 0.7, 0.65),
)
def toadstool(paint: Paint) -> Mesh:
    stalk = lathe([(0, 0), (0.14, 0), (0.1, 0.1), (0.085, 0.3)], 10, CREAM, smooth=True)
    profile = [(0.1, 0.26), (0.3, 0.22), (0.32, 0.26), (0.28, 0.4), (0.17, 0.52), (0.0, 0.57)]
    gills = lathe(profile[:2], 14, "#e9d9b8")
    cap = lathe(profile[1:], 14, paint.main, smooth=True)
    spots = []
    for lift, n, turn in ((0.3, 7, 0.0), (0.62, 5, 0.4), (1.57, 1, 0.0)):
        for i in range(n):
            a = turn + i * 2 * pi / n
            r, z = 0.305 * cos(lift), 0.265 + 0.3 * sin(lift)
            spot = ellipsoid((0.014, 0.05, 0.05), (0, 0, 0), 6, 3, "#ffffff").transformed(pitch=-lift * 0.9)
            spots.append(spot.transformed(yaw=a, move=(r * cos(a), r * sin(a), z)))
    return concatenate(
        [stalk, gills, cap, *spots, lathe([(0.1, 0.17), (0.13, 0.15), (0.09, 0.2)], 10, "#f7efdc")]
    ).transformed(scale=1.12)
