"""Household things: what stands about in a home, dries at its window or hangs on its wall."""

from math import pi

import numpy as np
from shapely import LineString, Polygon

from services.sim.catalogue.palette import BRIGHT, CREAM, GOLD, INK, WOOD, Paint
from services.sim.catalogue.parts import (
    bent,
    circle,
    disc,
    mark,
    on_ball,
    rectangle,
    ring,
    silhouette,
    star,
    tinted,
    to_front,
)
from services.sim.catalogue.registry import BIG, HANGING, SMALL, STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box as block
from services.sim.geometry.solids import cylinder, ellipsoid, extruded, frustum, lathe
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "household",
    "teapot",
    "tea pot",
    "tea kettle",
    "kettle",
    colours=BRIGHT,
    places=SMALL,
    size_m=(0.41, 0.76, 0.46),
)
def teapot(paint: Paint) -> Mesh:
    body = ellipsoid((0.2, 0.21, 0.17), (0, 0, 0.19), 14, 7, paint.main)
    lid = lathe([(0.12, 0.335), (0.06, 0.385), (0, 0.395)], 12, paint.dark)
    spout = tube(
        bent([(0, 0.17, 0.12), (0, 0.28, 0.2), (0, 0.31, 0.3), (0, 0.39, 0.36)], 2),
        [0.065, 0.055, 0.045, 0.038, 0.033, 0.028, 0.03],
        7,
        paint.main,
    )
    loop = tube(
        bent([(0, -0.16, 0.29), (0, -0.3, 0.3), (0, -0.33, 0.2), (0, -0.24, 0.12), (0, -0.17, 0.12)], 2),
        0.026,
        6,
        paint.main,
    )
    places = ((0.0, 0.45), (0.55, 0.05), (-0.55, 0.05), (0.0, -0.35), (1.1, 0.4), (-1.1, 0.4))
    spots = [on_ball(mark(circle(0.04, 8), 0.0, paint.accent), (0.2, 0.21, 0.17), 0.19, *at) for at in places]
    return concatenate(
        [
            body,
            lid,
            spout,
            loop,
            *spots,
            ellipsoid(0.036, (0, 0, 0.42), 6, 4, paint.accent),
            cylinder(0.12, 0.04, (0, 0, 0), 12, paint.dark),
        ]
    )


@catalogued(
    "household",
    "table lamp",
    "lamp",
    "desk lamp",
    "bedside lamp",
    "reading lamp",
    "lamp with a shade",
    colours=BRIGHT,
    places=SMALL,
    size_m=(0.49, 0.47, 0.71),
)
def lamp(paint: Paint) -> Mesh:
    shade = frustum(0.24, 0.13, 0.3, (0, 0, 0.38), 14, paint.main)
    trim = [
        lathe([(0.243, 0.38), (0.23, 0.415)], 14, paint.accent),
        lathe([(0.146, 0.66), (0.136, 0.682)], 14, paint.accent),
    ]
    stand = lathe(
        [(0, 0), (0.14, 0), (0.14, 0.03), (0.03, 0.07), (0.085, 0.18), (0.02, 0.3), (0.02, 0.38)],
        12,
        paint.accent,
        smooth=True,
    )
    return concatenate([shade, *trim, stand, ellipsoid(0.02, (0, 0, 0.69), 6, 4, GOLD)])


@catalogued(
    "household",
    "alarm clock",
    "clock",
    "twin-bell clock",
    "bedside clock",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "black"),
    places=SMALL,
    size_m=(0.22, 0.55, 0.72),
)
def alarm_clock(paint: Paint) -> Mesh:
    parts = [
        disc(0.24, 0.18, (0, 0, 0.28), paint.main, 18),
        mark(circle(0.165, 16, (0, 0.28)), 0.095, "#fbfaf4"),
        mark(LineString([(0, 0.28), (0, 0.41)]).buffer(0.017, cap_style=2), 0.105, INK),
        mark(LineString([(-0.015, 0.28), (0.09, 0.23)]).buffer(0.02, cap_style=2), 0.105, INK),
    ]
    parts += [
        mark(rectangle(y - 0.014, z - 0.014, y + 0.014, z + 0.014), 0.1, INK)
        for y, z in ((0, 0.425), (0.145, 0.28), (0, 0.135), (-0.145, 0.28))
    ]
    for s in (-1, 1):
        parts.append(
            ellipsoid((0.1, 0.11, 0.065), (0, 0, 0), 10, 5, paint.main).transformed(
                roll=-s * 0.6, move=(0, s * 0.15, 0.52)
            )
        )
        parts.append(rod((0, s * 0.12, 0.1), (0, s * 0.2, 0), 0.03, 6, paint.dark))
    parts += [rod((0, 0, 0.5), (0, 0, 0.58), 0.012, 5, paint.metal), ellipsoid(0.035, (0, 0, 0.59), 6, 4, paint.metal)]
    return concatenate(parts).transformed(scale=1.12)


@catalogued(
    "household",
    "umbrella",
    "brolly",
    "rain umbrella",
    "open umbrella",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "black"),
    places=BIG,
    size_m=(1.22, 1.03, 1.08),
)
def umbrella(paint: Paint) -> Mesh:
    profile = [(0.6, 0.0), (0.52, 0.17), (0.34, 0.3), (0.0, 0.38)]
    outside = lathe(profile, 8, paint.main)
    panels = tinted(outside, lambda i: paint.main if (i // 2 if i < 32 else i - 32) % 2 else paint.light)
    inside = lathe(profile, 8, paint.main).flipped()
    rim = tube(
        [(0.6 * np.cos(a), 0.6 * np.sin(a), 0.0) for a in np.linspace(0, 2 * pi, 9)[:-1]],
        0.014,
        4,
        paint.accent,
        closed=True,
    )
    pole = rod((0, 0, -0.5), (0, 0, 0.5), 0.02, 6, paint.metal)
    hook = tube(
        bent([(0, 0, -0.45), (0, 0, -0.6), (0, 0.05, -0.68), (0, 0.12, -0.66), (0, 0.13, -0.58)], 2),
        0.033,
        6,
        paint.other(WOOD, CREAM, "orange", "black"),
    )
    return concatenate([panels, inside, rim, pole, hook]).transformed(roll=-0.6, pitch=0.12)


@catalogued(
    "household",
    "fan",
    "electric fan",
    "desk fan",
    "table fan",
    "ventilator",
    colours=("white", "blue", "green", "red", "black", "yellow", "pink"),
    places=STANDING,
    size_m=(0.4, 0.56, 0.8),
)
def fan(paint: Paint) -> Mesh:
    c = (0, 0, 0.52)
    blade = Polygon([(0.03, 0), (0.06, 0.17), (-0.02, 0.235), (-0.14, 0.19), (-0.13, 0.1), (-0.03, 0.0)])
    blades = [
        silhouette(blade, 0.03, paint.main).transformed(roll=k * 2 * pi / 3, move=(0.02, 0, 0.52)) for k in range(3)
    ]
    cage = [ring(0.255, 0.026, c, paint.main, 18, 6, "x"), ring(0.14, 0.007, (0.08, 0, 0.52), paint.metal, 12, 3, "x")]
    wires = [
        rod(
            (0.07, 0.04 * np.cos(a), 0.52 + 0.04 * np.sin(a)),
            (0.03, 0.25 * np.cos(a), 0.52 + 0.25 * np.sin(a)),
            0.006,
            3,
            paint.metal,
        )
        for a in np.arange(8) * pi / 4
    ]
    hub = [disc(0.055, 0.09, (0.06, 0, 0.52), paint.accent, 10), disc(0.07, 0.16, (-0.1, 0, 0.52), paint.dark, 10)]
    stand = [
        rod((-0.08, 0, 0.03), (-0.08, 0, 0.48), 0.035, 8, paint.main),
        frustum(0.2, 0.15, 0.05, (-0.04, 0, 0), 14, paint.main),
    ]
    return concatenate([*blades, *cage, *wires, *hub, *stand])


@catalogued(
    "household",
    "radio",
    "boombox",
    "portable radio",
    "stereo",
    "cassette player",
    colours=("red", "blue", "yellow", "pink", "black", "white", "green"),
    places=SMALL,
    size_m=(0.22, 0.7, 0.68),
)
def radio(paint: Paint) -> Mesh:
    parts = [block((0.2, 0.7, 0.36), (0, 0, 0.18), paint.main)]
    for s in (-1, 1):
        parts += [
            disc(0.115, 0.03, (0.1, s * 0.21, 0.15), paint.ink, 14),
            mark(circle(0.05, 10, (s * 0.21, 0.15)), 0.12, paint.metal),
        ]
    parts += [
        mark(rectangle(-0.28, 0.285, 0.28, 0.335), 0.106, paint.accent),
        mark(rectangle(0.1, 0.285, 0.12, 0.335), 0.112, paint.other("#d8232a", "#2b62c9", "red", "pink")),
        mark(rectangle(-0.07, 0.06, 0.07, 0.2), 0.106, paint.accent),
        *[mark(rectangle(y - 0.016, 0.1, y + 0.016, 0.16), 0.112, paint.main) for y in (-0.04, 0.04)],
        block((0.05, 0.05, 0.1), (0, -0.29, 0.39), paint.main),
        block((0.05, 0.05, 0.1), (0, 0.29, 0.39), paint.main),
        block((0.06, 0.63, 0.05), (0, 0, 0.455), paint.main),
        rod((-0.07, 0.27, 0.35), (-0.07, 0.33, 0.68), 0.012, 4, paint.metal),
    ]
    return concatenate(parts)


@catalogued(
    "household",
    "T-shirt",
    "tee shirt",
    "shirt",
    "tshirt",
    "t shirt",
    colours=(*BRIGHT, "black"),
    places=HANGING,
    size_m=(0.04, 0.93, 0.89),
)
def t_shirt(paint: Paint) -> Mesh:
    half = [
        (0.0, 0.0),
        (0.26, 0.0),
        (0.27, 0.44),
        (0.4, 0.33),
        (0.46, 0.46),
        (0.3, 0.66),
        (0.12, 0.72),
        (0.07, 0.66),
        (0, 0.64),
    ]
    cloth = Polygon(half + [(-y, z) for y, z in reversed(half[1:-1])])
    hook = tube(
        bent([(0, 0, 0.68), (0, 0, 0.78), (0, 0.04, 0.83), (0, 0, 0.88), (0, -0.04, 0.85)], 2), 0.014, 5, paint.metal
    )
    bars = [rod((0, 0, 0.74), (0, s * 0.16, 0.68), 0.012, 4, paint.metal) for s in (-1, 1)]
    cuffs = [LineString([(s * 0.395, 0.34), (s * 0.45, 0.455)]).buffer(0.018, cap_style=2) for s in (-1, 1)]
    collar = LineString([(-0.12, 0.71), (-0.07, 0.65), (0, 0.63), (0.07, 0.65), (0.12, 0.71)]).buffer(
        0.018, cap_style=2
    )
    return concatenate(
        [
            silhouette(cloth, 0.03, paint.main),
            hook,
            *bars,
            *[mark(c, 0.021, paint.accent) for c in (*cuffs, collar)],
            mark(star(5, 0.13, 0.055, (0, 0.38)), 0.021, paint.accent),
        ]
    )


@catalogued(
    "household",
    "satellite dish",
    "dish antenna",
    "parabolic antenna",
    "TV dish",
    colours=("white", "black", "red", "blue", "brown"),
    places=("wall",),
    size_m=(0.77, 0.86, 0.84),
)
def satellite_dish(paint: Paint) -> Mesh:
    profile = [(0.0, 0.0), (0.2, 0.03), (0.33, 0.09), (0.42, 0.16)]
    bowl = concatenate(
        [
            lathe(profile, 18, paint.dark),
            lathe(profile, 18, paint.main, smooth=True).flipped(),
            ring(0.42, 0.016, (0, 0, 0.16), paint.dark, 18, 4),
        ]
    )
    arm = [
        rod((-0.4, 0, 0.13), (-0.1, 0, 0.52), 0.022, 5, paint.metal),
        rod((0, 0, 0.42), (-0.14, 0, 0.56), 0.06, 8, paint.ink),
    ]
    arm += [rod((0.13, s * 0.34, 0.12), (-0.08, 0, 0.5), 0.012, 4, paint.metal) for s in (-1, 1)]
    dish = to_front(concatenate([bowl, *arm])).transformed(pitch=-0.25, move=(0.2, 0, 0))
    foot = [
        rod((0, 0, -0.06), (0.24, 0, -0.02), 0.045, 6, paint.metal),
        block((0.03, 0.2, 0.3), (0.0, 0, -0.06), paint.metal),
    ]
    return concatenate([dish, *foot])


@catalogued(
    "household",
    "mailbox",
    "letter box",
    "letterbox",
    "post box",
    "postbox",
    colours=("red", "blue", "green", "yellow", "black", "white"),
    places=BIG,
    size_m=(0.44, 0.63, 1.15),
)
def mailbox(paint: Paint) -> Mesh:
    arc = [(0.2 * np.cos(a), 0.2 + 0.18 * np.sin(a)) for a in np.linspace(0, pi, 9)]
    tunnel = extruded([(-0.2, 0), (0.2, 0), *arc], 0.62, paint.main).transformed(yaw=pi / 2, move=(0, 0, 0.66))
    door = extruded([(-0.205, 0.0), (0.205, 0.0), *[(y * 1.03, z) for y, z in arc]], 0.03, paint.dark).transformed(
        yaw=pi / 2, move=(0, 0.31, 0.66)
    )
    flag_colour = paint.other("#e02128", GOLD, "red")
    flag = [
        block((0.02, 0.03, 0.32), (0.22, 0.05, 0.98), flag_colour),
        block((0.02, 0.17, 0.11), (0.22, 0.12, 1.1), flag_colour),
    ]
    letter = mark(rectangle(-0.22, 0.74, 0.0, 0.87), 0.206, paint.accent)
    fold = mark(LineString([(-0.21, 0.86), (-0.11, 0.8), (-0.01, 0.86)]).buffer(0.01, cap_style=2), 0.212, paint.main)
    post = [
        block((0.1, 0.1, 0.66), (0, 0, 0.33), paint.other(WOOD, CREAM, "yellow")),
        block((0.3, 0.56, 0.04), (0, 0, 0.65), paint.other(WOOD, CREAM, "yellow")),
    ]
    return concatenate([tunnel, door, *flag, letter, fold, *post])
