"""Toys: what children leave on the balcony and at the window."""

from math import cos, pi, sin

import numpy as np
from shapely import LineString

from services.sim.catalogue.palette import BRIGHT, CREAM, GLASS, GOLD, INK, WOOD, Paint
from services.sim.catalogue.parts import bent, circle, disc, mark, rectangle, silhouette, tinted
from services.sim.catalogue.registry import BIG, STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box as block
from services.sim.geometry.solids import cone, cylinder, ellipsoid
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "toys",
    "teddy bear",
    "teddy",
    "stuffed bear",
    "plush bear",
    "cuddly bear",
    "toy bear",
    colours=("brown", "white", "pink", "blue", "purple", "red", "black"),
    places=STANDING,
    size_m=(0.44, 0.62, 0.75),
)
def teddy_bear(paint: Paint) -> Mesh:
    pale = paint.other("#f0cf9d", "#b98a5a", "white")
    bow = paint.other("#d3202a", "#2c63c6", "red", "pink")
    parts = [
        ellipsoid((0.17, 0.19, 0.22), (0, 0, 0.23), 9, 5, paint.main),
        ellipsoid((0.16, 0.2, 0.17), (0.02, 0, 0.53), 9, 6, paint.main),
        ellipsoid((0.09, 0.1, 0.075), (0.15, 0, 0.49), 7, 4, pale),
        ellipsoid((0.03, 0.04, 0.026), (0.235, 0, 0.52), 6, 3, INK),
    ]
    for s in (-1, 1):
        parts += [
            ellipsoid((0.045, 0.085, 0.085), (0, s * 0.16, 0.665), 6, 4, paint.main),
            disc(0.048, 0.02, (0.045, s * 0.165, 0.665), pale, 6),
            disc(0.026, 0.03, (0.165, s * 0.075, 0.575), paint.other(INK, CREAM, "black"), 6),
            ellipsoid((0.07, 0.07, 0.14), (0, 0, 0), 7, 4, paint.main).transformed(
                roll=s * 0.7, move=(0.06, s * 0.21, 0.32)
            ),
            ellipsoid((0.16, 0.085, 0.085), (0.13, s * 0.15, 0.085), 7, 4, paint.main),
            disc(0.06, 0.02, (0.275, s * 0.15, 0.09), pale, 6),
            mark([(0, 0.37), (s * 0.1, 0.32), (s * 0.1, 0.42)][::s], 0.19, bow),
        ]
    return concatenate(parts)


@catalogued(
    "toys",
    "rubber duck",
    "rubber duckie",
    "duck",
    "bath duck",
    "toy duck",
    colours=("yellow", "pink", "blue", "green", "white", "red", "purple"),
    places=STANDING,
    size_m=(0.6, 0.73, 0.65),
)
def rubber_duck(paint: Paint) -> Mesh:
    beak = paint.other("#f5820d", "#f8c51c", "red", "pink")
    parts = [
        ellipsoid((0.2, 0.28, 0.17), (0, -0.02, 0.17), 12, 6, paint.main),
        tube([(0, -0.2, 0.2), (0, -0.29, 0.28), (0, -0.36, 0.38)], [0.13, 0.09, 0.015], 7, paint.main),
        ellipsoid(0.16, (0.02, 0.13, 0.42), 10, 6, paint.main),
        ellipsoid((0.075, 0.1, 0.03), (0.05, 0.3, 0.42), 8, 4, beak),
        ellipsoid((0.065, 0.085, 0.025), (0.05, 0.28, 0.385), 8, 4, "#d96206"),
    ]
    for s in (-1, 1):
        parts += [
            ellipsoid(
                (0.035, 0.035, 0.045), (0.02 + s * 0.13, 0.2, 0.47), 7, 4, paint.other("#ffffff", "#d8e6f5", "white")
            ),
            ellipsoid((0.022, 0.03, 0.032), (0.02 + s * 0.148, 0.215, 0.47), 6, 3, "#101014"),
            ellipsoid((0.04, 0.15, 0.085), (s * 0.185, -0.06, 0.22), 8, 4, paint.dark),
        ]
    return concatenate(parts).transformed(scale=1.12, yaw=-0.5)


@catalogued(
    "toys",
    "rocking horse",
    "toy horse",
    "wooden horse",
    "rocking pony",
    colours=("brown", "white", "red", "blue", "green", "black"),
    places=BIG,
    size_m=(0.44, 1.15, 0.99),
)
def rocking_horse(paint: Paint) -> Mesh:
    mane = paint.other("#f2d9a0", "#4b2a15", "white")
    runner = [(0.55 * sin(a) * 1.15, 0.62 - 0.62 * cos(a)) for a in np.linspace(-1.05, 1.05, 9)]
    head = [(0.16, 0.62), (0.3, 0.86), (0.33, 0.97), (0.37, 0.93), (0.53, 0.8), (0.5, 0.71), (0.4, 0.73), (0.36, 0.5)]
    hair = [(0.13, 0.64), (0.27, 0.88), (0.31, 0.99), (0.25, 0.98), (0.17, 0.88), (0.08, 0.7)]
    parts = [
        ellipsoid((0.15, 0.31, 0.16), (0, 0, 0.54), 10, 6, paint.main),
        silhouette(head, 0.15, paint.main),
        silhouette(hair, 0.1, mane),
        tube(bent([(0, -0.27, 0.6), (0, -0.4, 0.62), (0, -0.46, 0.4)], 2), [0.03, 0.05, 0.06, 0.055, 0.02], 5, mane),
        mark(circle(0.022, 6, (0.39, 0.85)), 0.08, paint.other(INK, CREAM, "black")),
        block((0.32, 0.26, 0.06), (0, -0.05, 0.68), paint.other("#d3202a", "#2b62c9", "red")),
        block((0.33, 0.16, 0.2), (0, -0.05, 0.59), paint.other("#d3202a", "#2b62c9", "red")),
        rod((-0.17, 0.3, 0.76), (0.17, 0.3, 0.76), 0.022, 5, mane),
    ]
    for sx in (-1, 1):
        rail = [(sx * 0.17, y, z + 0.03) for y, z in runner]
        parts += [tube(rail, 0.032, 4, paint.dark)]
        parts += [rod((sx * 0.1, sy * 0.2, 0.5), (sx * 0.17, sy * 0.36, 0.12), 0.052, 5, paint.main) for sy in (-1, 1)]
    return concatenate(parts)


@catalogued(
    "toys",
    "beach ball",
    "ball",
    "inflatable ball",
    "striped ball",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink"),
    places=STANDING,
    size_m=(0.67, 0.66, 0.67),
)
def beach_ball(paint: Paint) -> Mesh:
    stripe = paint.other("#fcfcfa", "#2a5fca", "yellow")

    def panel(i: int) -> str:
        segment = i % 18 if i >= 18 else i
        return str(stripe) if segment % 6 in (4, 5) else str(paint.main)

    ball = tinted(ellipsoid(0.28, (0, 0, 0), 18, 8, paint.main), panel)
    cap = ellipsoid((0.075, 0.075, 0.02), (0, 0, 0.27), 8, 4, stripe)
    return concatenate([ball, cap]).transformed(scale=1.2, pitch=0.75, roll=-0.35)


@catalogued(
    "toys",
    "kite",
    "paper kite",
    "toy kite",
    "diamond kite",
    colours=BRIGHT,
    places=("wall",),
    size_m=(0.04, 0.86, 1.56),
)
def kite(paint: Paint) -> Mesh:
    top, bottom, left, right, mid = (0, 0.45), (0, -0.55), (-0.43, 0.12), (0.43, 0.12), (0, 0.12)
    parts = [
        silhouette([top, left, bottom, right], 0.03, paint.main),
        mark([mid, top, left], 0.02, paint.accent),
        mark([mid, bottom, right], 0.02, paint.dark),
    ]
    parts += [
        mark(LineString([top, bottom]).buffer(0.014, cap_style=2), 0.026, paint.ink),
        mark(LineString([left, right]).buffer(0.014, cap_style=2), 0.026, paint.ink),
    ]
    tail = bent([(0, 0, -0.55), (0, 0.1, -0.7), (0, -0.08, -0.88), (0, 0.06, -1.06)], 3)
    parts.append(tube(tail, 0.012, 4, paint.ink))
    for k, (y, z) in enumerate(((0.1, -0.7), (-0.08, -0.88), (0.06, -1.05))):
        tie = paint.main if k != 1 else paint.accent
        parts += [
            silhouette([(y, z), (y + s * 0.12, z - 0.055), (y + s * 0.12, z + 0.055)], 0.02, tie) for s in (-1, 1)
        ]
    return concatenate(parts)


@catalogued(
    "toys",
    "toy robot",
    "robot",
    "tin robot",
    "robot toy",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "white", "black"),
    places=STANDING,
    size_m=(0.29, 0.58, 0.87),
)
def toy_robot(paint: Paint) -> Mesh:
    parts = [
        block((0.26, 0.36, 0.3), (0, 0, 0.35), paint.main),
        block((0.24, 0.3, 0.21), (0, 0, 0.65), paint.main),
        cylinder(0.06, 0.06, (0, 0, 0.49), 8, paint.metal),
    ]
    parts += [
        rod((0, 0, 0.75), (0, 0, 0.83), 0.014, 5, paint.metal),
        ellipsoid(0.035, (0, 0, 0.83), 6, 4, paint.other("#e0252c", GOLD, "red")),
    ]
    for s in (-1, 1):
        parts += [
            disc(0.05, 0.04, (0.12, s * 0.075, 0.685), paint.accent, 10),
            disc(0.024, 0.05, (0.125, s * 0.075, 0.685), paint.other(INK, "#49d3f2", "white", "yellow", "pink"), 6),
            block((0.06, 0.05, 0.08), (0, s * 0.17, 0.65), paint.metal),
            block((0.11, 0.09, 0.26), (0.0, s * 0.235, 0.36), paint.light),
            block((0.13, 0.11, 0.07), (0.02, s * 0.235, 0.2), paint.metal),
            block((0.13, 0.11, 0.2), (0, s * 0.1, 0.12), paint.light),
            block((0.24, 0.15, 0.07), (0.04, s * 0.1, 0.035), paint.dark),
        ]
    parts += [
        mark(rectangle(-0.1, 0.585, 0.1, 0.62), 0.126, paint.ink),
        mark(rectangle(-0.13, 0.29, 0.13, 0.46), 0.136, paint.accent),
    ]
    parts += [
        mark(circle(0.027, 6, (y, 0.415)), 0.142, c)
        for y, c in ((-0.075, "#e0252c"), (0.0, "#f2b51d"), (0.075, "#35a34a"))
    ]
    return concatenate([*parts, mark(rectangle(-0.095, 0.32, 0.095, 0.35), 0.142, paint.main)])


@catalogued(
    "toys",
    "toy car",
    "toy automobile",
    "model car",
    "little car",
    colours=(*BRIGHT, "black"),
    places=STANDING,
    size_m=(0.39, 0.82, 0.42),
)
def toy_car(paint: Paint) -> Mesh:
    shell = [
        (-0.4, 0.08),
        (0.4, 0.08),
        (0.4, 0.2),
        (0.36, 0.24),
        (0.2, 0.26),
        (0.1, 0.4),
        (-0.2, 0.42),
        (-0.33, 0.27),
        (-0.4, 0.24),
    ]
    panes = [
        [(-0.17, 0.265), (-0.035, 0.265), (-0.035, 0.385), (-0.14, 0.385)][::1],
        [(-0.005, 0.265), (0.155, 0.265), (0.075, 0.375), (-0.005, 0.385)],
    ]
    glass = paint.other(GLASS, "#33414d", "white", "blue")
    parts = [silhouette(shell, 0.34, paint.main)]
    for pane in panes:
        flat = mark(pane, 0.178, glass)
        parts += [flat, mark([(-y, z) for y, z in reversed(pane)], 0.178, glass).transformed(yaw=pi)]
    for y in (-0.23, 0.23):
        parts += [
            disc(0.095, 0.38, (0, y, 0.095), INK, 12),
            mark(circle(0.05, 8, (y, 0.095)), 0.197, paint.other("#e6e8ea", GOLD, "white")),
        ]
    parts += [ellipsoid((0.05, 0.03, 0.04), (x, 0.39, 0.19), 6, 4, "#fff3b0") for x in (-0.11, 0.11)]
    parts += [mark(rectangle(-0.39, 0.195, 0.39, 0.215), 0.176, paint.accent)]
    return concatenate(parts)


@catalogued(
    "toys",
    "balloons",
    "balloon",
    "bunch of balloons",
    "party balloons",
    colours=BRIGHT,
    places=STANDING,
    size_m=(0.48, 0.78, 1.28),
)
def balloons(paint: Paint) -> Mesh:
    parts = [cylinder(0.07, 0.06, (0, 0, 0), 8, paint.ink)]
    for i, (x, y, z) in enumerate(((0.05, -0.23, 0.94), (-0.05, 0.22, 0.98), (0.1, 0.0, 1.08))):
        shape = ellipsoid((0.165, 0.165, 0.2), (x, y, z), 12, 6, paint.main if i != 1 else paint.light)
        knot = cone(0.04, 0.07, (x, y, z - 0.255), 5, paint.dark)
        string = tube([(0, 0, 0.05), (x * 0.4, y * 0.4, 0.45), (x, y, z - 0.24)], 0.009, 3, paint.ink)
        shine = ellipsoid(
            (0.03, 0.035, 0.05),
            (x + 0.13, y - 0.06, z + 0.08),
            5,
            3,
            "#ffffff" if paint.colour != "white" else "#cfd8e2",
        )
        parts += [shape, knot, string, shine]
    return concatenate(parts)


@catalogued(
    "toys",
    "pinwheel",
    "toy windmill",
    "windmill",
    "paper windmill",
    "whirligig",
    colours=BRIGHT,
    places=STANDING,
    size_m=(0.23, 0.71, 1.07),
)
def pinwheel(paint: Paint) -> Mesh:
    blade = [(0, 0), (0.36, 0.0), (0.36, 0.14), (0.17, 0.25), (0.0, 0.16)]
    fold = [(0, 0), (0.36, 0.0), (0.36, 0.13)]
    vanes = []
    for k in range(4):
        vane = concatenate([silhouette(blade, 0.02, paint.main), mark(fold, 0.016, paint.accent)])
        vanes.append(vane.transformed(roll=k * pi / 2 + 0.2, move=(0.06 + 0.006 * k, 0, 0.72)))
    stick = rod((0, 0, 0), (0, 0, 0.76), 0.022, 6, paint.other(WOOD, CREAM, "orange"))
    foot = cylinder(0.1, 0.05, (0, 0, 0), 10, paint.main)
    return concatenate(
        [
            *vanes,
            stick,
            foot,
            ellipsoid((0.03, 0.045, 0.045), (0.1, 0, 0.72), 8, 4, paint.other(GOLD, "#d3202a", "yellow", "orange")),
        ]
    )
