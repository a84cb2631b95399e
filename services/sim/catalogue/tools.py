"""Tools: what one works with in the house and the garden."""

from math import pi

from shapely import LineString, Point, box, unary_union
from shapely.affinity import rotate, translate

from services.sim.catalogue.palette import INK, WOOD, Paint
from services.sim.catalogue.parts import arch, circle, disc, mark, rectangle, silhouette, tapered
from services.sim.catalogue.registry import BIG, STANDING, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box as block
from services.sim.geometry.solids import frustum, lathe
from services.sim.geometry.tubes import rod, tube


@catalogued(
    "tools",
    "watering can",
    "watering pot",
    "sprinkling can",
    "garden watering can",
    colours=("red", "yellow", "green", "blue", "purple", "pink"),
    places=STANDING,
    size_m=(0.31, 0.85, 0.48),
)
def watering_can(paint: Paint) -> Mesh:
    body = lathe([(0, 0), (0.15, 0), (0.15, 0.26), (0.1, 0.31), (0, 0.31)], 14, paint.main)
    spout = tube([(0, 0.1, 0.07), (0, 0.42, 0.36)], [0.05, 0.03], 8, paint.main)
    rose = frustum(0.03, 0.085, 0.1, segments=10, colour=paint.accent).transformed(roll=-pi / 4.2, move=(0, 0.41, 0.35))
    loop = tube(
        [(0, 0.06, 0.29), (0, 0.0, 0.43), (0, -0.15, 0.45), (0, -0.29, 0.33), (0, -0.29, 0.2), (0, -0.13, 0.08)],
        0.026,
        6,
        paint.main,
    )
    bands = [lathe([(0.154, z), (0.154, z + 0.03)], 14, paint.accent) for z in (0.03, 0.22)]
    return concatenate([body, spout, rose, loop, *bands])


@catalogued(
    "tools",
    "toolbox",
    "tool box",
    "tool chest",
    "tool case",
    "workman's box",
    colours=("red", "blue", "green", "yellow", "orange", "black"),
    places=STANDING,
    size_m=(0.3, 0.68, 0.46),
)
def toolbox(paint: Paint) -> Mesh:
    lid = [(-0.34, 0.21), (0.34, 0.21), (0.26, 0.33), (-0.26, 0.33)]
    hammer = unary_union([box(-0.17, 0.09, 0.13, 0.125), box(0.1, 0.035, 0.18, 0.18)])
    return concatenate(
        [
            block((0.26, 0.66, 0.2), (0, 0, 0.1), paint.main),
            silhouette(lid, 0.28, paint.main),
            mark(rectangle(-0.33, 0.195, 0.33, 0.212), 0.142, paint.ink),
            arch((0, -0.14, 0.32), (0, 0.14, 0.32), (0, 0, 0.12), 0.022, paint.ink),
            *[block((0.03, 0.06, 0.1), (0.14, y, 0.2), paint.metal) for y in (-0.24, 0.24)],
            mark(rotate(hammer, 25, origin="centroid"), 0.136, paint.accent),
        ]
    )


@catalogued(
    "tools",
    "ladder",
    "stepladder",
    "step ladder",
    "folding ladder",
    colours=("orange", "red", "yellow", "blue", "white", "green"),
    places=BIG,
    size_m=(0.8, 0.62, 1.47),
)
def ladder(paint: Paint) -> Mesh:
    def post(y0: float, y1: float, x: float) -> Mesh:
        return rod((x, y0, 0), (0, y1, 1.42), 0.042, 4, paint.main)

    steps = []
    for i in range(1, 5):
        t = i * 0.28 / 1.42
        steps.append(block((0.13, 0.56 - 0.12 * t, 0.06), (0.38 * (1 - t), 0, i * 0.28), paint.light))
    brace = rod((-0.22, -0.25, 0.6), (-0.22, 0.25, 0.6), 0.02, 4, paint.dark)
    posts = [post(s * 0.27, s * 0.2, x) for s in (-1, 1) for x in (0.36, -0.36)]
    return concatenate([*posts, *steps, brace, block((0.3, 0.5, 0.06), (0.02, 0, 1.43), paint.main)])


@catalogued(
    "tools",
    "broom",
    "besom",
    "sweeping brush",
    "broomstick",
    colours=("red", "blue", "green", "yellow", "purple", "brown"),
    places=BIG,
    size_m=(0.15, 0.5, 1.45),
)
def broom(paint: Paint) -> Mesh:
    fan = [(-0.25, 0), (0.25, 0), (0.1, 0.46), (-0.1, 0.46)]
    parts = [silhouette(fan, 0.14, paint.main), rod((0, 0, 0.44), (0, 0, 1.45), 0.032, 6, paint.main)]
    parts += [
        silhouette([(-w, z), (w, z), (w - 0.014, z + 0.045), (-w + 0.014, z + 0.045)], 0.15, paint.accent)
        for w, z in ((0.165, 0.27), (0.135, 0.37))
    ]
    straws = [LineString([(-0.2 + 0.1 * i, 0), (-0.1 + 0.05 * i, 0.26)]).buffer(0.009, cap_style=2) for i in range(5)]
    parts.append(mark(unary_union(straws), 0.076, paint.dark))
    return concatenate(parts)


@catalogued(
    "tools",
    "shovel",
    "spade",
    "garden spade",
    "digging spade",
    colours=("red", "blue", "green", "orange", "yellow", "black"),
    places=BIG,
    size_m=(0.06, 0.36, 1.2),
)
def shovel(paint: Paint) -> Mesh:
    blade = [(0, 0), (0.13, 0.1), (0.18, 0.26), (0.18, 0.5), (-0.18, 0.5), (-0.18, 0.26), (-0.13, 0.1)]
    grip = LineString([(0, 0.98), (-0.12, 1.08), (-0.12, 1.17), (0.12, 1.17), (0.12, 1.08), (0, 0.98)])
    left = LineString(list(grip.coords)[:4]).buffer(0.03, join_style=2, cap_style=2)
    right = LineString(list(grip.coords)[3:]).buffer(0.03, join_style=2, cap_style=2)
    return concatenate(
        [
            silhouette(blade, 0.05, paint.main),
            mark(box(-0.02, 0.12, 0.02, 0.46), 0.03, paint.dark),
            rod((0, 0, 0.4), (0, 0, 1.0), 0.03, 6, paint.other(WOOD, "#d8b27a", "orange")),
            silhouette(left, 0.06, paint.main),
            silhouette(right, 0.06, paint.main),
        ]
    )


@catalogued(
    "tools",
    "wheelbarrow",
    "barrow",
    "garden cart",
    "pushcart",
    colours=("red", "green", "blue", "orange", "yellow", "purple"),
    places=BIG,
    size_m=(0.62, 1.58, 0.69),
)
def wheelbarrow(paint: Paint) -> Mesh:
    tub = tapered((0.36, 0.42), (0.62, 0.95), 0.36, (0, 0.08, 0.27), paint.main, shift=(0, 0.06))
    soil = block((0.5, 0.8, 0.06), (0, 0.14, 0.64), "#4a3423")
    rails = [
        tube([(s * 0.1, 0.62, 0.17), (s * 0.2, 0, 0.26), (s * 0.26, -0.76, 0.5)], 0.025, 5, paint.dark) for s in (-1, 1)
    ]
    grips = [rod((s * 0.235, -0.6, 0.447), (s * 0.268, -0.78, 0.508), 0.037, 6, INK) for s in (-1, 1)]
    legs = [
        tube([(s * 0.2, -0.05, 0.27), (s * 0.22, -0.22, 0.0), (s * 0.22, -0.3, 0.28)], 0.024, 5, paint.dark)
        for s in (-1, 1)
    ]
    wheel = [
        disc(0.17, 0.1, (0, 0, 0), INK, 14),
        mark(circle(0.09, 10), 0.056, paint.accent),
        mark(circle(0.09, 10), 0.056, paint.accent).transformed(yaw=pi),
    ]
    return concatenate([tub, soil, *rails, *grips, *legs, concatenate(wheel).transformed(move=(0, 0.62, 0.17))])


@catalogued(
    "tools",
    "wrench",
    "spanner",
    "giant spanner",
    "monkey wrench",
    colours=("red", "blue", "yellow", "black", "green", "orange"),
    places=("wall",),
    size_m=(0.08, 0.75, 0.75),
)
def wrench(paint: Paint) -> Mesh:
    def head(r: float, jaw: float) -> object:
        return (
            Point(0, 0)
            .buffer(r, quad_segs=4)
            .difference(box(-jaw, 0.0, jaw, 1.0).union(Point(0, 0).buffer(jaw, quad_segs=2)))
        )

    top = translate(rotate(head(0.16, 0.07), -15, origin=(0, 0)), 0, 0.33)
    low = translate(rotate(head(0.13, 0.055), 165, origin=(0, 0)), 0, -0.33)
    bar = box(-0.065, -0.24, 0.065, 0.22)
    whole = rotate(unary_union([top, low, bar]).simplify(0.004), -45, origin=(0, 0))
    slot = rotate(box(-0.025, -0.17, 0.025, 0.17), -45, origin=(0, 0))
    return concatenate([silhouette(whole, 0.07, paint.main), mark(slot, 0.04, paint.accent)])


@catalogued(
    "tools",
    "traffic cone",
    "road cone",
    "cone",
    "safety cone",
    "traffic pylon",
    colours=("orange", "red", "yellow", "blue", "green"),
    places=STANDING,
    size_m=(0.5, 0.5, 0.72),
)
def traffic_cone(paint: Paint) -> Mesh:
    def band(z0: float, z1: float) -> Mesh:
        return lathe([(0.2 - 0.22 * z0, z0), (0.2 - 0.22 * z1, z1)], 14, paint.other("#fbfbfb", INK, "yellow"))

    hull = frustum(0.18, 0.035, 0.66, (0, 0, 0.06), 14, paint.main)
    return concatenate([block((0.5, 0.5, 0.06), (0, 0, 0.03), paint.main), hull, band(0.26, 0.36), band(0.48, 0.55)])
