"""Furniture: what stands on a balcony."""

from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from services.sim.catalogue.palette import BRIGHT, CREAM, INK, WOOD, Paint
from services.sim.catalogue.parts import arch, mark, ring, tapered, tinted
from services.sim.catalogue.registry import BIG, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box as block
from services.sim.geometry.solids import cylinder, ellipsoid, frustum, lathe, quad
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "furniture",
    "chair",
    "dining chair",
    "kitchen chair",
    "wooden chair",
    colours=(*BRIGHT, "brown", "black"),
    places=BIG,
    size_m=(0.61, 0.58, 1.11),
)
def chair(paint: Paint) -> Mesh:
    parts = [block((0.54, 0.58, 0.07), (0.02, 0, 0.52), paint.main)]
    parts += [
        rod((sx * 0.22 + 0.02, sy * 0.25, 0), (sx * 0.2 + 0.02, sy * 0.24, 0.5), 0.035, 5, paint.main)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    parts += [rod((-0.22, sy * 0.25, 0.5), (-0.29, sy * 0.25, 1.1), 0.035, 5, paint.main) for sy in (-1, 1)]
    parts += [
        block((0.04, 0.5, 0.13), (-0.283, 0, 1.02), paint.main),
        block((0.04, 0.48, 0.08), (-0.265, 0, 0.83), paint.main),
        block((0.04, 0.48, 0.08), (-0.245, 0, 0.68), paint.main),
    ]
    return concatenate([*parts, block((0.42, 0.46, 0.05), (0.03, 0, 0.575), paint.accent)])


@catalogued(
    "furniture",
    "stool",
    "bar stool",
    "barstool",
    "three-legged stool",
    "round stool",
    colours=("red", "orange", "yellow", "green", "blue", "white", "brown", "black"),
    places=BIG,
    size_m=(0.59, 0.6, 0.83),
)
def stool(paint: Paint) -> Mesh:
    seat = lathe([(0, 0.7), (0.22, 0.7), (0.25, 0.73), (0.25, 0.79), (0.22, 0.82), (0, 0.82)], 16, paint.main)
    rim = lathe([(0.253, 0.735), (0.253, 0.76)], 16, paint.accent)
    angles = [pi / 2 - 2 * pi / 3, pi / 2, pi / 2 + 2 * pi / 3]
    legs = [
        rod(
            (0.3 * cos(a + 1.57), 0.3 * sin(a + 1.57), 0),
            (0.13 * cos(a + 1.57), 0.13 * sin(a + 1.57), 0.71),
            0.04,
            6,
            paint.main,
        )
        for a in angles
    ]
    return concatenate([seat, rim, *legs, ring(0.24, 0.018, (0, 0, 0.25), paint.dark, 12, 4)])


@catalogued(
    "furniture",
    "bench",
    "garden bench",
    "park bench",
    "wooden bench",
    colours=("green", "brown", "red", "blue", "white", "yellow"),
    places=BIG,
    size_m=(0.66, 1.44, 0.94),
)
def bench(paint: Paint) -> Mesh:
    parts = [block((0.13, 1.44, 0.05), (x, 0, 0.45), paint.main) for x in (-0.1, 0.06, 0.22)]
    parts += [block((0.04, 1.44, 0.12), (-0.2 - 0.05 * i, 0, 0.57 + 0.15 * i), paint.main) for i in range(3)]
    for s in (-1, 1):
        y = s * 0.62
        iron = paint.other(INK, "#8d949c", "brown")
        parts += [
            tube([(0.26, y, 0), (0.24, y, 0.43), (-0.2, y, 0.43), (-0.33, y, 0.92)], 0.035, 4, iron),
            rod((-0.3, y, 0), (-0.18, y, 0.43), 0.035, 4, iron),
        ]
        parts += [tube([(0.25, y, 0.43), (0.26, y, 0.66), (-0.24, y, 0.66)], 0.035, 4, iron)]
    return concatenate(parts)


@catalogued(
    "furniture",
    "table",
    "small table",
    "balcony table",
    "garden table",
    "dining table",
    colours=(*BRIGHT, "brown"),
    places=BIG,
    size_m=(0.7, 1.1, 1.02),
)
def table(paint: Paint) -> Mesh:
    parts = [block((0.7, 1.1, 0.07), (0, 0, 0.715), paint.main), block((0.58, 0.96, 0.1), (0, 0, 0.64), paint.dark)]
    parts += [
        tapered((0.06, 0.06), (0.1, 0.1), 0.68, (sx * 0.28, sy * 0.47, 0), paint.main)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    mug = paint.accent
    parts += [
        cylinder(0.06, 0.15, (0.12, 0.28, 0.75), 10, mug),
        arch((0.12, 0.33, 0.78), (0.12, 0.33, 0.88), (0, 0.07, 0), 0.014, mug, 5, 4),
    ]
    parts += [
        lathe([(0, 0.75), (0.07, 0.75), (0.19, 0.85), (0.16, 0.85), (0, 0.8)], 12, mug).transformed(move=(0, -0.12, 0))
    ]
    fruit = paint.other("#e0452c", "#7cb82f", "red", "orange", "brown")
    parts += [
        ellipsoid(0.075, (x, y - 0.12, 0.88), 7, 4, fruit) for x, y in ((0.05, -0.07), (0.05, 0.07), (-0.06, 0.0))
    ]
    return concatenate([*parts, ellipsoid(0.07, (0, -0.12, 0.95), 7, 4, fruit)])


@catalogued(
    "furniture",
    "armchair",
    "easy chair",
    "upholstered chair",
    "club chair",
    "lounge chair",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "brown"),
    places=BIG,
    size_m=(0.85, 1.03, 1.05),
)
def armchair(paint: Paint) -> Mesh:
    parts = [block((0.72, 0.96, 0.3), (0, 0, 0.24), paint.main), block((0.6, 0.58, 0.16), (0.07, 0, 0.46), paint.light)]
    parts += [
        tapered((0.2, 0.94), (0.16, 0.8), 0.68, (-0.27, 0, 0.3), paint.main, (-0.07, 0)),
        lathe([(0, -0.4), (0.09, -0.4), (0.09, 0.4), (0, 0.4)], 8, paint.main).transformed(
            roll=pi / 2, move=(-0.33, 0, 0.96)
        ),
    ]
    for s in (-1, 1):
        parts += [
            block((0.7, 0.2, 0.42), (0.02, s * 0.4, 0.42), paint.main),
            lathe([(0, -0.37), (0.12, -0.37), (0.12, 0.37), (0, 0.37)], 10, paint.main).transformed(
                pitch=pi / 2, move=(0.05, s * 0.4, 0.62)
            ),
        ]
        parts += [
            mark([(s * 0.4 + 0.07 * cos(a), 0.62 + 0.07 * sin(a)) for a in np.arange(8) * pi / 4], 0.427, paint.dark)
        ]
        parts += [rod((x, s * 0.38, 0), (x, s * 0.38, 0.1), 0.045, 5, INK) for x in (-0.28, 0.3)]
    pillow = ellipsoid((0.08, 0.2, 0.17), (0, 0, 0), 8, 5, paint.accent).transformed(pitch=-0.3, move=(-0.1, 0, 0.66))
    return concatenate([*parts, pillow])


@catalogued(
    "furniture",
    "bookshelf",
    "bookcase",
    "shelf of books",
    "book shelf",
    colours=("red", "green", "blue", "white", "brown", "black", "yellow", "purple"),
    places=BIG,
    size_m=(0.33, 0.9, 1.4),
)
def bookshelf(paint: Paint) -> Mesh:
    parts = [block((0.04, 0.88, 1.4), (-0.14, 0, 0.7), paint.dark, without=("-z",))]
    parts += [block((0.32, 0.08, 1.4), (0.01, s * 0.41, 0.7), paint.main) for s in (-1, 1)]
    parts += [
        block((0.32, 0.76, 0.08 if i in (0, 3) else 0.07), (0.01, 0, 0.06 + i * 0.433), paint.main) for i in range(4)
    ]
    hues = [
        h
        for h in ("#f4ead0", "#3c68b8", "#c2352f", "#e2b33c", "#3d8a57", "#f4ead0", "#83548f")
        if paint.colour
        not in {
            "#3c68b8": ("blue",),
            "#c2352f": ("red",),
            "#e2b33c": ("yellow",),
            "#3d8a57": ("green",),
            "#83548f": ("purple",),
            "#f4ead0": ("white",),
        }.get(h, ())
    ]
    rng = np.random.default_rng(11)
    for i in range(3):
        y, n = -0.35, 0
        while y < 0.12 + 0.08 * i:
            w, h = float(rng.uniform(0.06, 0.1)), float(rng.uniform(0.22, 0.31))
            parts.append(
                block(
                    (0.2, w - 0.012, h),
                    (0.0, y + w / 2, 0.095 + i * 0.433 + h / 2),
                    hues[(n + 2 * i) % len(hues)],
                    without=("-x", "-z"),
                )
            )
            y, n = y + w, n + 1
    return concatenate(parts)


@catalogued(
    "furniture",
    "parasol",
    "sun umbrella",
    "sunshade",
    "beach umbrella",
    "patio umbrella",
    "garden umbrella",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink"),
    places=BIG,
    size_m=(1.5, 1.5, 1.59),
)
def parasol(paint: Paint) -> Mesh:
    stripe = paint.other("#fdfdfb", "#2a62c4", "yellow")
    profile = [(0.75, 1.13), (0.75, 1.23), (0.4, 1.43), (0.0, 1.55)]

    def panel(i: int) -> str:
        segment = i % 12 if i < 48 else i - 48
        return str(stripe) if segment % 3 == 1 else str(paint.main)

    canopy = tinted(lathe(profile, 12, paint.main), panel)
    under = lathe(profile, 12, paint.main).flipped()
    pole = rod((0, 0, 0.05), (0, 0, 1.56), 0.03, 6, "#d9dde0")
    base = [frustum(0.26, 0.2, 0.08, (0, 0, 0), 12, "#6f757c"), ellipsoid(0.035, (0, 0, 1.555), 6, 4, paint.main)]
    return concatenate([canopy, under, pole, *base])


@catalogued(
    "furniture",
    "deck chair",
    "deckchair",
    "beach chair",
    "sun lounger",
    "folding sling chair",
    colours=("red", "orange", "green", "blue", "purple", "yellow"),
    places=BIG,
    size_m=(1.07, 0.66, 1.01),
)
def deck_chair(paint: Paint) -> Mesh:
    sling = [(0.5, 0.34), (0.2, 0.22), (-0.1, 0.36), (-0.42, 0.94)]
    stripe = paint.other("#fdfdfb", "#2a62c4", "yellow")
    parts = []
    y = -0.27
    for i, width in enumerate((0.152, 0.042, 0.152, 0.042, 0.152)):
        for (x0, z0), (x1, z1) in pairwise(sling):
            corners = [(x1, y, z1), (x0, y, z0), (x0, y + width, z0), (x1, y + width, z1)]
            parts.append(quad(corners, stripe if i % 2 else paint.main).two_sided())
        y += width
    frame = paint.other(WOOD, CREAM, "orange", "yellow")
    for s in (-1, 1):
        side = s * 0.3
        parts += [rod((0.55, side, 0.34), (-0.5, side, 0.02), 0.03, 4, frame)]
        parts += [rod((0.45, side, 0.02), (-0.44, side, 0.98), 0.03, 4, frame)]
    parts += [rod((x, -0.31, z), (x, 0.31, z), 0.028, 5, frame) for x, z in ((0.52, 0.34), (-0.44, 0.96), (0.44, 0.04))]
    return concatenate(parts)
