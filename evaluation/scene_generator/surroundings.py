"""What stands around the target: neighbours, road, trees, cars, lamps, all outside the ring in which the drone laps."""

import math
from typing import NamedTuple

import numpy as np

from contracts.geometry import Point2
from contracts.scene import Building, BuildingKind, Car, Ground, Road, Tree
from evaluation.scene_generator.footprints import Corner, distance_to_outline, points, rotated
from evaluation.scene_generator.scene_plan import SceneSpec
from evaluation.scene_generator.style_families import FAMILIES, dress

CLEAR_RING_M = 15.0
"""From the target's walls: the widest stand-off (12 m) and 3 m beyond it."""
ROAD_AT_M = 18.5
SHRUB_AT_M = 1.3
_CAR_COLOURS = ("#7d8790", "#b8bcc0", "#2f3a46", "#8c3b34", "#e4e4e0", "#3b5a78")


class Around(NamedTuple):
    neighbours: tuple[Building, ...]
    ground: Ground


def surround(spec: SceneSpec, plan: tuple[Corner, ...], rng: np.random.Generator) -> Around:
    """Everything around the target, whose plan (unturned, about the origin) is `plan`."""
    low = (min(x for x, _ in plan), min(y for _, y in plan))
    high = (max(x for x, _ in plan), max(y for _, y in plan))
    blocks = _neighbours(spec, low, high, rng)
    plans = [p for p, _ in blocks]
    wanted = spec.surroundings
    around = spec.rotation
    with_road = wanted.neighbours != "none" or wanted.cars > 0
    road_y = low[1] - ROAD_AT_M
    roads = (
        (Road(start=_point((-110, road_y), around), end=_point((110, road_y), around), width_m=6.0),)
        if with_road
        else ()
    )
    cars = tuple(
        Car(
            position=_point((float(x), road_y + (-1.6 if k % 2 else 1.6)), around),
            yaw=round((math.pi if k % 2 else 0.0) + around, 4),
            colour=str(rng.choice(_CAR_COLOURS)),
        )
        for k, x in enumerate(_spread(wanted.cars, 8.0, 45.0, rng))
    )
    lamps: tuple[Point2, ...] = ()
    if with_road and wanted.lamps:
        lamps = tuple(_point((x, road_y - 4.2), around) for x in (-36.0, -18.0, 0.0, 18.0, 36.0))
    trees = _trees(wanted.trees, plan, plans, road_y if with_road else None, around, rng)
    shrubs = _shrubs(spec, plan, around, rng)
    return Around(
        tuple(b for _, b in blocks),
        Ground(surface=wanted.surface, roads=roads, trees=trees + shrubs, cars=cars, lamps=lamps),
    )


def _neighbours(
    spec: SceneSpec, low: Corner, high: Corner, rng: np.random.Generator
) -> list[tuple[tuple[Corner, ...], Building]]:
    wanted = spec.surroundings
    if wanted.neighbours == "none":
        return []
    gap = wanted.gap_m
    sides = ("south",) if wanted.neighbours == "street" else ("south", "east", "north", "west")
    blocks: list[tuple[tuple[Corner, ...], Building]] = []
    for side in sides:
        depth = float(rng.uniform(10, 13))
        if side in ("south", "north"):
            along = [(low[0] - 8, float(rng.uniform(15, 20))), (low[0] + 14, max(14.0, high[0] - low[0] - 4))]
            for start, length in along:
                y = low[1] - gap - depth if side == "south" else high[1] + gap
                blocks.append(_block(spec, len(blocks), (start, y), (length, depth), rng))
        else:
            x = high[0] + gap if side == "east" else low[0] - gap - depth
            length = max(12.0, min(20.0, high[1] - low[1]))
            blocks.append(_block(spec, len(blocks), (x, low[1]), (depth, length), rng))
    return blocks


def _block(
    spec: SceneSpec, number: int, at: Corner, size: Corner, rng: np.random.Generator
) -> tuple[tuple[Corner, ...], Building]:
    (x, y), (w, d) = at, size
    plan: tuple[Corner, ...] = ((x, y), (x + w, y), (x + w, y + d), (x, y + d))
    kind: BuildingKind = "low_rise"
    if spec.kind == "villa" or (spec.kind == "high_rise" and rng.random() < 0.5):
        kind = spec.kind
    family = FAMILIES[kind][int(rng.integers(3))]
    low, high = {"villa": (2, 3), "low_rise": (3, 6), "high_rise": (8, 13)}[kind]
    floors = int(rng.integers(low, high))
    clothes = dress(kind, family, False, rng)
    building = Building(
        id=f"neighbour-{number + 1}",
        kind=kind,
        footprint=points(plan, spec.rotation),
        floors=floors,
        floor_height_m=clothes.floor_height_m,
        style=clothes.style,
        windows=clothes.windows,
        roof=clothes.roof,
    )
    return plan, building


def _trees(
    count: int,
    plan: tuple[Corner, ...],
    neighbours: list[tuple[Corner, ...]],
    road_y: float | None,
    around: float,
    rng: np.random.Generator,
) -> tuple[Tree, ...]:
    trees: list[Tree] = []
    reach = max(math.hypot(x, y) for x, y in plan) + 45.0
    placed: list[Corner] = []
    for _ in range(count * 40):
        if len(trees) == count:
            break
        at = (float(rng.uniform(-reach, reach)), float(rng.uniform(-reach, reach)))
        conifer = rng.random() < 0.25
        height = float(rng.uniform(5.0, 9.0))
        crown = height * (0.22 if conifer else 0.3)
        free = (
            distance_to_outline(at, plan) >= CLEAR_RING_M + crown + 2.0
            and all(distance_to_outline(at, other) >= crown + 1.0 for other in neighbours)
            and (road_y is None or abs(at[1] - road_y) >= 6.5)
            and all(math.dist(at, other) >= 5.0 for other in placed)
        )
        if free:
            placed.append(at)
            trees.append(
                Tree(
                    position=_point(at, around),
                    height_m=round(height, 2),
                    crown_m=round(crown, 2),
                    kind="conifer" if conifer else "broadleaf",
                )
            )
    return tuple(trees)


def _shrubs(spec: SceneSpec, plan: tuple[Corner, ...], around: float, rng: np.random.Generator) -> tuple[Tree, ...]:
    shrubs: list[Tree] = []
    if not spec.surroundings.shrubs or spec.kind == "cultural":
        return ()
    for _ in range(spec.surroundings.shrubs):
        facade = int(rng.integers(len(plan)))
        a, b = plan[facade], plan[(facade + 1) % len(plan)]
        length = math.dist(a, b)
        ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
        t = float(rng.uniform(0.1, 0.9))
        if facade == spec.start_facade and abs(t - 0.5) * length < 2.5:
            continue
        at = (a[0] + ux * t * length + uy * SHRUB_AT_M, a[1] + uy * t * length - ux * SHRUB_AT_M)
        if distance_to_outline(at, plan) >= SHRUB_AT_M - 0.01:
            shrubs.append(
                Tree(
                    position=_point(at, around),
                    height_m=1.0,
                    crown_m=round(float(rng.uniform(0.4, 0.6)), 2),
                    kind="shrub",
                )
            )
    return tuple(shrubs)


def _spread(count: int, gap_m: float, reach_m: float, rng: np.random.Generator) -> list[float]:
    slots = np.arange(-reach_m, reach_m, gap_m)
    return sorted(float(x) for x in rng.choice(slots, size=min(count, len(slots)), replace=False))


def _point(at: Corner, around: float) -> Point2:
    x, y = rotated(at, around)
    return Point2(x=round(x, 3), y=round(y, 3))
