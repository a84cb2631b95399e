"""Ray-cast worlds for the explorer: six ground plans, none / street / ring of neighbours, trees, poles, balconies."""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evaluation.scene_generator.footprints import distance_to_outline, outline, rotated
from evaluation.scene_generator.scene_plan import FootprintSpec, Shape
from navigation.camera import Camera, DepthView, Pose
from navigation.shortest_path import NoWay, VisibilityGraph
from tests.navigation.raycast_world import HEADINGS, Prism, World, rectangle

Around = Literal["none", "street", "ring"]
SHAPES: tuple[Shape, ...] = ("rectangle", "l", "u", "t", "plus", "octagon")
AROUND: tuple[Around, ...] = ("none", "street", "ring")
FLIGHT_HEIGHT_M = 8.0
SEEN_M, SEEN_DEG = 12.0, 65.0
STOP_M = 2.0
ROUTE_CLEARANCE_M = 0.95

Xy = tuple[float, float]


class Task(NamedTuple):
    """One world with one window to find. `window` lies on the wall, `normal` points out of it. `lap_m`: the shortest
    ways to it on either side of the first facade; `shortest_m` the lesser; both end `STOP_M` before the window."""

    name: str
    shape: Shape
    around: Around
    world: World
    footprint: tuple[Xy, ...]
    start: Pose
    window: Xy
    normal: Xy
    shortest_m: float
    lap_m: tuple[float, float]
    graph: VisibilityGraph
    windows: tuple[tuple[Xy, Xy], ...]
    """All of the target's, each with the normal of its wall."""
    sight: VisibilityGraph
    """Of the buildings' walls alone."""


def make_task(shape: Shape, around: Around, seed: int, balconies: bool = False) -> Task:
    """The task of a seed; walls are upright and higher than the flight, balconies jut out 1.2 m at flight height."""
    rng = np.random.default_rng((seed, SHAPES.index(shape), AROUND.index(around)))
    while True:
        task = _draw(shape, around, seed, balconies, rng)
        if task is not None:
            return task


def _draw(shape: Shape, around: Around, seed: int, balconies: bool, rng: np.random.Generator) -> Task | None:
    footprint = _footprint(shape, rng)
    turn = float(rng.uniform(0, math.tau))
    plan = tuple(rotated(p, turn) for p in outline(footprint))
    blocks = [tuple(rotated(p, turn) for p in b) for b in _neighbours(outline(footprint), around, rng)]
    prisms = [Prism(plan, -1.0, 30.0), *(Prism(b, -1.0, 25.0) for b in blocks)]
    solid = [plan, *blocks]
    for _ in range(int(rng.integers(3, 10))):
        at = (float(rng.uniform(-45, 45)), float(rng.uniform(-45, 45)))
        radius = float(rng.choice((0.15, 1.5, 2.0)))
        if all(distance_to_outline(at, p) > radius + 4.5 for p in solid):
            trunk = rectangle(*at, 2 * radius, 2 * radius)
            prisms.append(Prism(trunk, -1.0, 12.0))
            solid.append(trunk)
    windows = _windows(plan)
    if balconies:
        for window, normal in windows[:: int(rng.integers(2, 4))]:
            prisms.append(Prism(_balcony(window, normal), FLIGHT_HEIGHT_M - 1.6, FLIGHT_HEIGHT_M - 0.3))
    (ax, ay), (bx, by) = plan[0], plan[1]
    length = math.hypot(bx - ax, by - ay)
    out = ((by - ay) / length, (ax - bx) / length)
    away = float(rng.uniform(8, 10))
    start = Pose(
        (ax + bx) / 2 + out[0] * away, (ay + by) / 2 + out[1] * away, FLIGHT_HEIGHT_M, math.atan2(-out[1], -out[0])
    )
    if min(distance_to_outline((start.x, start.y), p) for p in solid) < 4.0:
        return None
    window, normal = windows[int(rng.integers(len(windows)))]
    graph = VisibilityGraph(solid, ROUTE_CLEARANCE_M)
    stop = before(window, normal)
    shortest = graph.route((start.x, start.y), stop)
    if isinstance(shortest, NoWay):
        return None
    sides = []
    for side in (-1.2, 1.2):
        foot = (start.x - out[0] * (away + 0.5) - out[1] * side, start.y - out[1] * (away + 0.5) + out[0] * side)
        bar = _bar(foot, out, 70.0)
        way = VisibilityGraph([*solid, bar], ROUTE_CLEARANCE_M).route((start.x, start.y), stop)
        sides.append(math.inf if isinstance(way, NoWay) else way.length_m)
    if math.inf in sides:
        return None
    world = World(prisms)
    return Task(
        f"{shape}-{around}-{seed}",
        shape,
        around,
        world,
        plan,
        start,
        window,
        normal,
        shortest.length_m,
        (max(sides[0], shortest.length_m), max(sides[1], shortest.length_m)),
        graph,
        tuple(windows),
        VisibilityGraph([plan, *blocks], 0.0),
    )


def before(window: Xy, normal: Xy) -> Xy:
    """The stop in front of a window."""
    return window[0] + normal[0] * STOP_M, window[1] + normal[1] * STOP_M


def views(task: Task, pose: Pose, camera: Camera, rng: np.random.Generator, noise: float) -> dict[int, DepthView]:
    """The five views, range noise relative to the range."""
    seen = {}
    for heading in HEADINGS:
        turned = camera._replace(heading_deg=heading)
        depth = task.world.depth(pose, turned)
        scale = 1.0 + noise * rng.standard_normal(depth.shape[1])
        seen[heading] = DepthView(turned, (depth * scale).astype(np.float32))
    return seen


def sees_window(task: Task, pose: Pose) -> bool:
    """Would a perfect recogniser find the window from here, in one of the five views?"""
    dx, dy = task.window[0] - pose.x, task.window[1] - pose.y
    away = math.hypot(dx, dy)
    facing = -(dx * task.normal[0] + dy * task.normal[1])
    bearing = abs(math.remainder(pose.yaw - math.atan2(dy, dx), math.tau))
    if away > SEEN_M or facing < away * math.cos(math.radians(SEEN_DEG)) or bearing > math.radians(135.0):
        return False
    share = np.linspace(0.0, 1.0, 200)[:-1]
    end = (task.window[0] + 0.05 * task.normal[0], task.window[1] + 0.05 * task.normal[1])
    line = np.stack(
        (pose.x + share * (end[0] - pose.x), pose.y + share * (end[1] - pose.y), np.full_like(share, pose.z)), axis=1
    )
    return bool((task.world.gap_m(line) > 0.0).all())


def ideal_share(task: Task) -> float:
    """SPL of somebody who knows the map but not the window, and guesses the side by a coin."""
    if sees_window(task, task.start):
        return 1.0
    return sum(task.shortest_m / lap for lap in task.lap_m) / 2


def _footprint(shape: Shape, rng: np.random.Generator) -> FootprintSpec:
    if shape == "octagon":
        return FootprintSpec(shape=shape, width_m=round(float(rng.uniform(15, 26)), 1))
    arm = round(float(rng.uniform(8, 11)), 1)
    if shape == "rectangle":
        return FootprintSpec(width_m=round(float(rng.uniform(12, 34)), 1), depth_m=round(float(rng.uniform(10, 20)), 1))
    if shape == "u":
        return FootprintSpec(shape=shape, width_m=36.0, depth_m=round(float(rng.uniform(17, 24)), 1), arm_m=10.0)
    width = round(float(rng.uniform(24, 34)), 1)
    return FootprintSpec(shape=shape, width_m=width, depth_m=arm + round(float(rng.uniform(7, 12)), 1), arm_m=arm)


def _neighbours(plan: tuple[Xy, ...], around: Around, rng: np.random.Generator) -> list[tuple[Xy, ...]]:
    xs, ys = [p[0] for p in plan], [p[1] for p in plan]
    low, high = (min(xs), min(ys)), (max(xs), max(ys))
    sides = {"none": (), "street": ("south",), "ring": ("south", "east", "north", "west")}[around]
    blocks = []
    for side in sides:
        gap, depth = float(rng.uniform(13, 24)), float(rng.uniform(8, 14))
        middle = float(rng.uniform(-6, 6))
        wide = float(rng.uniform(18, 40))
        if side in ("south", "north"):
            y = low[1] - gap - depth / 2 if side == "south" else high[1] + gap + depth / 2
            blocks.append(rectangle((low[0] + high[0]) / 2 + middle, y, wide, depth))
        else:
            x = low[0] - gap - depth / 2 if side == "west" else high[0] + gap + depth / 2
            blocks.append(rectangle(x, (low[1] + high[1]) / 2 + middle, depth, min(wide, high[1] - low[1] + 10)))
    return blocks


def _windows(plan: tuple[Xy, ...]) -> list[tuple[Xy, Xy]]:
    found = []
    for k, a in enumerate(plan):
        b = plan[(k + 1) % len(plan)]
        length = math.dist(a, b)
        along = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
        count = max(1, int((length - 2.0) // 3.0))
        for column in range(count):
            t = length / 2 + (column - (count - 1) / 2) * 3.0
            found.append(((a[0] + along[0] * t, a[1] + along[1] * t), (along[1], -along[0])))
    return found


def _balcony(window: Xy, normal: Xy) -> tuple[Xy, ...]:
    along = (-normal[1], normal[0])
    corners = ((-1.2, 0.0), (-1.2, 1.2), (1.2, 1.2), (1.2, 0.0))
    return tuple(
        (window[0] + s * along[0] + o * normal[0], window[1] + s * along[1] + o * normal[1]) for s, o in corners
    )[::-1]


def _bar(foot: Xy, out: Xy, length_m: float) -> tuple[Xy, ...]:
    half = (-out[1] * 0.02, out[0] * 0.02)
    end = (foot[0] + out[0] * length_m, foot[1] + out[1] * length_m)
    return (
        (foot[0] - half[0], foot[1] - half[1]),
        (foot[0] + half[0], foot[1] + half[1]),
        (end[0] + half[0], end[1] + half[1]),
        (end[0] - half[0], end[1] - half[1]),
    )


def nearest_m(task: Task, way: NDArray[np.float64]) -> float:
    """The least distance of a straight flight (2, 3) to anything solid."""
    share = np.linspace(0.0, 1.0, 60)[:, None]
    return float(task.world.gap_m(way[0] + share * (way[1] - way[0])).min())
