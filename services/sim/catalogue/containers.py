"""Containers: what holds plants, water, fruit or a journey's things."""

from math import cos, pi, sin

from shapely import LineString, box, unary_union

from services.sim.catalogue.palette import BRIGHT, CREAM, GOLD, INK, Paint
from services.sim.catalogue.parts import arch, mark, rectangle, silhouette, tapered
from services.sim.catalogue.registry import BIG, STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box as block
from services.sim.geometry.solids import cylinder, ellipsoid, lathe
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "containers",
    "flower pot",
    "flowerpot",
    "planter",
    "potted plant",
    "plant pot",
    "pot of flowers",
    "potted flowers",
    "pot plant",
    "pot with flowers",
    "pot of plants",
    "house plant",
    "plant",
    colours=(*BRIGHT, "brown"),
    places=STANDING,
    size_m=(0.56, 0.55, 0.67),
)
def flower_pot(paint: Paint) -> Mesh:
    pot = lathe(
        [(0, 0), (0.16, 0), (0.22, 0.25), (0.26, 0.25), (0.26, 0.33), (0.22, 0.33), (0.2, 0.3), (0, 0.3)],
        14,
        paint.main,
    )
    petal = paint.other("#e8296b", "#ffd21a", "red", "pink", "purple")
    parts = [pot]
    for i in range(9):
        a, reach = i * 2 * pi / 9 + 0.2, 0.2 if i % 2 else 0.13
        tip = (reach * cos(a), reach * sin(a), 0.46 if i % 2 else 0.53)
        parts.append(
            tube(
                [(0.05 * cos(a), 0.05 * sin(a), 0.3), (tip[0] * 0.8, tip[1] * 0.8, 0.42), tip],
                [0.03, 0.055, 0.01],
                4,
                paint.foliage,
            )
        )
        if i % 2 == 0:
            parts.append(ellipsoid((0.055, 0.055, 0.045), (tip[0], tip[1], tip[2] + 0.03), 6, 4, petal))
    return concatenate([*parts, ellipsoid(0.06, (0.02, 0, 0.56), 6, 4, petal)]).transformed(scale=1.08)


@catalogued(
    "containers",
    "bucket",
    "pail",
    "water bucket",
    "plastic bucket",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "black"),
    places=STANDING,
    size_m=(0.47, 0.48, 0.66),
)
def bucket(paint: Paint) -> Mesh:
    body = lathe(
        [(0, 0), (0.15, 0), (0.21, 0.36), (0.235, 0.36), (0.235, 0.4), (0.2, 0.4), (0.19, 0.33)], 14, paint.main
    )
    water = cylinder(0.2, 0.01, (0, 0, 0.33), 14, "#7fc4e8")
    bands = [lathe([(0.153 + z / 6, z), (0.157 + z / 6, z + 0.025)], 14, paint.dark) for z in (0.1, 0.2)]
    ears = [block((0.07, 0.03, 0.07), (0, s * 0.225, 0.35), paint.dark) for s in (-1, 1)]
    bail = arch((0, -0.22, 0.36), (0, 0.22, 0.36), (0, 0, 0.28), 0.014, paint.metal, 10)
    grip = rod((0, -0.07, 0.635), (0, 0.07, 0.635), 0.026, 6, paint.accent)
    return concatenate([body, water, *bands, *ears, bail, grip])


@catalogued(
    "containers",
    "basket",
    "wicker basket",
    "picnic basket",
    "woven basket",
    "hamper",
    colours=("brown", "white", "yellow", "pink", "blue", "green", "red"),
    places=STANDING,
    size_m=(0.41, 0.68, 0.55),
)
def basket(paint: Paint) -> Mesh:
    parts = [tapered((0.3, 0.5), (0.38, 0.64), 0.26, (0, 0, 0), paint.main)]
    for row in range(4):
        z = 0.02 + row * 0.062
        half = 0.245 + 0.07 * z / 0.26
        for i in range(6):
            y = (-0.5 + (i + (row % 2) * 0.5) / 6) * 2 * half + 0.01
            x = 0.152 + 0.04 * (z + 0.02) / 0.26 + 0.006
            parts.append(mark(rectangle(y, z, min(y + half / 6, half), z + 0.045), x, paint.dark))
    cloth = unary_union([box(-0.28, 0.22, 0.28, 0.27), LineString([(-0.2, 0.24), (0, 0.12), (0.2, 0.24)]).convex_hull])
    check = unary_union([box(-0.26 + 0.1 * i, 0.222, -0.22 + 0.1 * i, 0.268) for i in range(6)])
    fabric, spots = (
        paint.other("#fbfbfb", "#d8232a", "white"),
        paint.other("#d8232a", "#fbfbfb", "white", "red", "pink"),
    )
    return concatenate(
        [
            *parts,
            silhouette(cloth, 0.01, fabric, x=0.205),
            mark(check, 0.216, paint.other(spots, "#3567c4", "red", "pink")),
            block((0.34, 0.58, 0.03), (0, 0, 0.275), fabric),
            arch((0, -0.31, 0.24), (0, 0.31, 0.24), (0, 0, 0.28), 0.03, paint.main, 10, 6),
        ]
    )


@catalogued(
    "containers",
    "crate",
    "wooden crate",
    "fruit crate",
    "slatted box",
    "box of apples",
    colours=("brown", "red", "blue", "green", "yellow", "white"),
    places=STANDING,
    size_m=(0.42, 0.66, 0.47),
)
def crate(paint: Paint) -> Mesh:
    parts = [block((0.36, 0.6, 0.33), (0, 0, 0.17), "#15120f")]
    for i in range(3):
        z = 0.06 + i * 0.13
        parts.append(block((0.4, 0.64, 0.095), (0, 0, z), paint.main))
    parts += [block((0.06, 0.06, 0.37), (sx * 0.18, sy * 0.3, 0.185), paint.dark) for sx in (-1, 1) for sy in (-1, 1)]
    fruit = paint.other("#d3222a", "#8fc62f", "red", "brown")
    parts += [ellipsoid(0.09, (x, y, 0.38), 7, 4, fruit) for x in (-0.09, 0.09) for y in (-0.2, -0.01, 0.19)]
    return concatenate(parts)


@catalogued(
    "containers",
    "barrel",
    "keg",
    "cask",
    "rain barrel",
    "wooden barrel",
    "oil barrel",
    colours=("brown", "red", "blue", "green", "black", "white"),
    places=BIG,
    size_m=(0.79, 0.72, 0.95),
)
def barrel(paint: Paint) -> Mesh:
    radius = [(0.0, 0.27), (0.16, 0.325), (0.32, 0.35), (0.475, 0.36), (0.63, 0.35), (0.79, 0.325), (0.95, 0.27)]
    hull = lathe(
        [(0, 0), *[(r, z) for z, r in radius], (0.25, 0.95), (0.25, 0.92), (0, 0.92)], 16, paint.main, smooth=True
    )
    hoop = paint.other("#3a3c42", "#c9ced4", "black", "blue", "brown")
    hoops = [
        lathe([(r0 + 0.01, z), (r1 + 0.01, z + 0.06)], 16, hoop)
        for z, r0, r1 in ((0.07, 0.296, 0.314), (0.26, 0.341, 0.349), (0.63, 0.35, 0.342), (0.82, 0.316, 0.298))
    ]
    tap = [
        rod((0.34, 0, 0.42), (0.43, 0, 0.42), 0.03, 6, GOLD),
        rod((0.41, 0, 0.36), (0.41, 0, 0.5), 0.022, 6, GOLD),
        rod((0.41, -0.06, 0.5), (0.41, 0.06, 0.5), 0.02, 6, GOLD),
    ]
    return concatenate([hull, *hoops, *tap])


@catalogued(
    "containers",
    "vase",
    "amphora",
    "urn",
    "two-handled vase",
    "ceramic vase",
    colours=("blue", "white", "red", "green", "purple", "black", "orange"),
    places=STANDING,
    size_m=(0.45, 0.58, 0.7),
)
def vase(paint: Paint) -> Mesh:
    profile = [
        (0, 0),
        (0.13, 0),
        (0.1, 0.06),
        (0.2, 0.24),
        (0.21, 0.36),
        (0.15, 0.47),
        (0.075, 0.54),
        (0.075, 0.62),
        (0.14, 0.7),
        (0, 0.68),
    ]
    body = lathe(profile, 14, paint.main, smooth=True)
    bands = [
        lathe([(0.187, 0.205), (0.197, 0.227)], 14, paint.accent),
        lathe([(0.203, 0.385), (0.19, 0.415)], 14, paint.accent),
    ]
    for i in range(7):
        a = i * 2 * pi / 7
        bands.append(
            tube(
                [
                    (0.212 * cos(a), 0.212 * sin(a), 0.25),
                    (0.222 * cos(a + 0.22), 0.222 * sin(a + 0.22), 0.36),
                    (0.212 * cos(a + 0.45), 0.212 * sin(a + 0.45), 0.25),
                ],
                0.012,
                3,
                paint.accent,
            )
        )
    ears = [
        tube([(0, s * 0.09, 0.62), (0, s * 0.22, 0.63), (0, s * 0.27, 0.54), (0, s * 0.19, 0.39)], 0.022, 5, paint.main)
        for s in (-1, 1)
    ]
    return concatenate([body, *bands, *ears])


@catalogued(
    "containers",
    "jerrycan",
    "jerry can",
    "fuel can",
    "petrol can",
    "gas can",
    "canister",
    colours=("green", "red", "blue", "yellow", "black", "white"),
    places=STANDING,
    size_m=(0.23, 0.54, 0.63),
)
def jerrycan(paint: Paint) -> Mesh:
    shell = [
        (-0.25, 0.03),
        (-0.22, 0),
        (0.22, 0),
        (0.25, 0.03),
        (0.25, 0.42),
        (0.13, 0.53),
        (-0.22, 0.53),
        (-0.25, 0.5),
    ]
    cross = [LineString([(-0.18, z), (0.17, 0.5 - z)]).buffer(0.028, cap_style=2) for z in (0.08, 0.42)]
    cap = rod((0, 0.18, 0.46), (0, 0.25, 0.54), 0.055, 8, paint.accent)
    rails = [rod((x, -0.19, 0.61), (x, 0.09, 0.61), 0.024, 5, paint.main) for x in (-0.07, 0, 0.07)]
    posts = [block((0.17, 0.05, 0.1), (0, y, 0.57), paint.main) for y in (-0.18, 0.07)]
    return concatenate(
        [
            silhouette(shell, 0.22, paint.main),
            *[silhouette(bar, 0.01, paint.accent, x=0.112 + 0.002 * i) for i, bar in enumerate(cross)],
            cap,
            *rails,
            *posts,
        ]
    )


@catalogued(
    "containers",
    "suitcase",
    "trolley case",
    "luggage",
    "travel case",
    "rolling suitcase",
    colours=("red", "orange", "yellow", "green", "blue", "purple", "pink", "black"),
    places=BIG,
    size_m=(0.31, 0.61, 1.12),
)
def suitcase(paint: Paint) -> Mesh:
    ribs = [block((0.03, 0.05, 0.6), (0.145, y, 0.42), paint.dark) for y in (-0.18, -0.06, 0.06, 0.18)]
    corners = [block((0.3, 0.1, 0.1), (0.01, sy * 0.255, z), paint.accent) for sy in (-1, 1) for z in (0.11, 0.73)]
    wheels = [
        cylinder(0.055, 0.05, segments=8, colour=INK).transformed(roll=pi / 2, move=(x, y, 0.055))
        for x in (-0.1, 0.1)
        for y in (-0.2, 0.25)
    ]
    bars = [rod((-0.06, y, 0.76), (-0.06, y, 1.1), 0.016, 5, paint.metal) for y in (-0.13, 0.13)]
    return concatenate(
        [
            block((0.28, 0.6, 0.7), (0, 0, 0.42), paint.main),
            *ribs,
            *corners,
            *wheels,
            *bars,
            rod((-0.06, -0.17, 1.09), (-0.06, 0.17, 1.09), 0.03, 6, paint.ink),
            arch((0.02, -0.1, 0.77), (0.02, 0.1, 0.77), (0, 0, 0.08), 0.02, paint.ink, 5),
        ]
    )


@catalogued(
    "containers",
    "gift box",
    "giftbox",
    "present box",
    "gift package",
    "wrapped box",
    "box with a bow",
    "box with a ribbon",
    colours=BRIGHT,
    places=STANDING,
    size_m=(0.51, 0.51, 0.65),
)
def gift_box(paint: Paint) -> Mesh:
    ribbon = paint.other(paint.other(GOLD, "#d3202a", "yellow", "orange", "white", "green"), CREAM, "red", "blue")
    loops = []
    for s in (-1, 1):
        loops.append(
            tube(
                [(0, 0, 0.49), (0.02, s * 0.1, 0.62), (0.02, s * 0.2, 0.6), (0.02, s * 0.17, 0.51), (0, 0, 0.5)],
                [0.02, 0.035, 0.04, 0.035, 0.02],
                5,
                ribbon,
            )
        )
    return concatenate(
        [
            block((0.46, 0.46, 0.4), (0, 0, 0.2), paint.main),
            block((0.5, 0.5, 0.11), (0, 0, 0.435), paint.light),
            block((0.51, 0.09, 0.5), (0, 0, 0.25), ribbon, without=("-z",)),
            block((0.09, 0.51, 0.5), (0, 0, 0.25), ribbon, without=("-z",)),
            *loops,
            ellipsoid(0.05, (0.02, 0, 0.52), 6, 4, ribbon),
        ]
    )
