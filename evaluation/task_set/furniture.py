"""A street that is furnished: shops on the ground floors, hedges and fences, poles with wires, panes that reflect.

What stands on the ground stays outside the ring in which the drone laps, clear of its start and of everything else.
Wires hang along the road, and from it to neighbours: a far start has them between it and its window.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from contracts.geometry import Point2, Point3
from contracts.scene import Building, Road, Scene
from contracts.scene_layout import columns_of, facades, wall_height_m
from contracts.scene_street import (
    LOWEST_AWNING_M,
    VALANCE_M,
    Awning,
    Fence,
    Hedge,
    OverheadWire,
    Pole,
    Sign,
    awning_top_m,
)
from evaluation.scene_generator.footprints import Corner, distance_to_outline
from evaluation.scene_generator.surroundings import CLEAR_RING_M

_SHOPS = (
    "Bäckerei",
    "Café Linde",
    "Apotheke",
    "BOOKS",
    "Florist",
    "Pizzeria",
    "Optik Kern",
    "Kiosk",
    "Barber",
    "Tea & Co",
)
_CLOTH = ("#9c2f2b", "#2e5d4b", "#33557a", "#b9862c", "#6d2f4f", "#5a5f66")
_BOARDS = (("#24303c", "#f4efe2"), ("#f2efe8", "#7a2b22"), ("#5b3a28", "#f0d9a8"), ("#1f4a3a", "#f4efe2"))
_SHOP_SHARE, _AWNING_SHARE, _BLADE_SHARE = 0.6, 0.65, 0.3
_REFLECTING_SHARE = 0.5
_POLES_APART_M, _ALONG_M = 27.0, 45.0
_POLE_M, _DIAMETER_M = (6.8, 8.2), (0.012, 0.025)
_BEHIND_PAVEMENT_M = 0.8
_DROP_M = 30.0
_ENCLOSURES, _TRIES = 4, 40
_FROM_START_M, _FROM_THINGS_M = 4.0, 1.5

Line = tuple[Corner, Corner]


class _Wires(NamedTuple):
    poles: tuple[Pole, ...]
    wires: tuple[OverheadWire, ...]


def furnished(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with all of it, as far as there is room."""
    buildings = tuple(_with_shops(building, rng) for building in scene.buildings)
    enclosures = _enclosures(scene, rng)
    overhead = _along_the_road(scene, scene.ground.roads[0], rng) if scene.ground.roads else _Wires((), ())
    ground = {
        "hedges": tuple(line for line in enclosures if isinstance(line, Hedge)),
        "fences": tuple(line for line in enclosures if isinstance(line, Fence)),
        "poles": overhead.poles,
        "wires": overhead.wires,
    }
    glass = "reflecting" if rng.random() < _REFLECTING_SHARE else "painted"
    return scene.model_copy(
        update={
            "buildings": buildings,
            "ground": scene.ground.model_copy(update=ground),
            "light": scene.light.model_copy(update={"glass": glass}),
        }
    )


def _with_shops(building: Building, rng: np.random.Generator) -> Building:
    if building.kind not in ("low_rise", "high_rise"):
        return building
    grid = building.windows
    top_m = awning_top_m(1, grid.sill_m + grid.height_m, building.floor_height_m)
    awnings: list[Awning] = []
    signs: list[Sign] = []
    for facade in range(len(building.footprint)):
        for column, columns in _runs(columns_of(building, facade), rng):
            place = {"facade": facade, "column": column, "columns": columns}
            cloth, board = (int(rng.integers(len(of))) for of in (_CLOTH, _BOARDS))
            drop_m = min(float(rng.choice((0.0, 0.3, 0.5))), top_m - VALANCE_M - LOWEST_AWNING_M)
            if rng.random() < _AWNING_SHARE and drop_m >= 0.0 and len(awnings) < 12:
                looks = {"colour": _CLOTH[cloth], "stripes": "#f2efe8" if rng.random() < 0.5 else None}
                size = {"depth_m": round(float(rng.uniform(0.8, 1.6)), 2), "drop_m": math.floor(100.0 * drop_m) / 100.0}
                awnings.append(Awning.model_validate(place | looks | size))
            if len(signs) < 12:
                colours = dict(zip(("colour", "letters"), _BOARDS[board], strict=True))
                kind = "projecting" if rng.random() < _BLADE_SHARE else "board"
                text = _SHOPS[int(rng.integers(len(_SHOPS)))]
                signs.append(Sign.model_validate(place | colours | {"kind": kind, "text": text}))
    return building.model_copy(update={"awnings": tuple(awnings), "signs": tuple(signs)})


def _runs(columns: int, rng: np.random.Generator) -> Iterator[tuple[int, int]]:
    """Neighbouring windows that belong to one shop, and how many."""
    column = 0
    while column < columns:
        wide = min(int(rng.integers(1, 4)), columns - column)
        if rng.random() < _SHOP_SHARE:
            yield column, wide
        column += wide + int(rng.integers(0, 2))


def _enclosures(scene: Scene, rng: np.random.Generator) -> list[Hedge | Fence]:
    """Along the sides of the plot about the target, in pieces."""
    target = _plan(scene.building(scene.target))
    middle = (sum(x for x, _ in target) / len(target), sum(y for _, y in target) / len(target))
    reach_m = max(math.dist(corner, middle) for corner in target) + CLEAR_RING_M
    found: list[Hedge | Fence] = []
    for _ in range(_TRIES):
        if len(found) == _ENCLOSURES:
            break
        wall = facades(scene.building(scene.target))[int(rng.integers(len(target)))]
        off_m, aside_m = float(rng.uniform(CLEAR_RING_M, reach_m)), float(rng.uniform(-reach_m, reach_m))
        half_m = float(rng.uniform(3.0, 9.0))
        x, y = (middle[i] + wall.normal[i] * off_m + wall.along[i] * aside_m for i in (0, 1))
        start, end = (
            (round(x + way * half_m * wall.along[0], 2), round(y + way * half_m * wall.along[1], 2))
            for way in (-1.0, 1.0)
        )
        if not _is_free((start, end), scene, found):
            continue
        line = {"start": {"x": start[0], "y": start[1]}, "end": {"x": end[0], "y": end[1]}}
        if rng.random() < 0.5:
            found.append(Hedge.model_validate(line | {"height_m": round(float(rng.uniform(0.8, 2.0)), 2)}))
        else:
            kind = ("wall", "pickets", "bars")[int(rng.integers(3))]
            height_m = round(float(rng.uniform(0.8, 1.6)), 2)
            colour = "#a8694e" if kind == "wall" else "#e4e0d4"
            found.append(Fence.model_validate(line | {"kind": kind, "height_m": height_m, "colour": colour}))
    return found


def _is_free(line: Line, scene: Scene, others: Sequence[Hedge | Fence]) -> bool:
    """Is it outside the target's ring, off the roads, and clear of all that stands there and of the start?"""
    (ax, ay), (bx, by) = line
    places = [(ax + (bx - ax) * k / 12, ay + (by - ay) * k / 12) for k in range(13)]
    start = scene.start.position
    ground = scene.ground
    things = [((t.position.x, t.position.y), t.crown_m) for t in ground.trees]
    things += [((car.position.x, car.position.y), 2.4) for car in ground.cars]
    things += [((lamp.x, lamp.y), 0.2) for lamp in ground.lamps]
    things += [((end.x, end.y), 0.0) for other in others for end in (other.start, other.end)]
    for x, y in places:
        if max(abs(x), abs(y)) > ground.half_size_m - 2.0 or math.dist((x, y), (start.x, start.y)) < _FROM_START_M:
            return False
        for building in scene.buildings:
            needed_m = CLEAR_RING_M if building.id == scene.target else _FROM_THINGS_M
            if distance_to_outline((x, y), _plan(building)) < needed_m:
                return False
        if any(math.dist((x, y), at) < radius_m + _FROM_THINGS_M for at, radius_m in things):
            return False
        if any(_off_road_m((x, y), road) < 0.5 for road in ground.roads):
            return False
    return True


def _along_the_road(scene: Scene, road: Road, rng: np.random.Generator) -> _Wires:
    """Behind the pavement across the road from the target: two wires from pole to pole, some to neighbours' walls."""
    (ax, ay), (bx, by) = (road.start.x, road.start.y), (road.end.x, road.end.y)
    length_m = math.hypot(bx - ax, by - ay)
    along = ((bx - ax) / length_m, (by - ay) / length_m)
    target = scene.building(scene.target).footprint[0]
    side = -math.copysign(1.0, along[0] * (target.y - ay) - along[1] * (target.x - ax))
    off_m = side * (road.width_m / 2 + road.pavement_m + _BEHIND_PAVEMENT_M)
    middle = (target.x - ax) * along[0] + (target.y - ay) * along[1]
    height_m = round(float(rng.uniform(*_POLE_M)), 1)
    spots = []
    for at in np.arange(middle - _ALONG_M, middle + _ALONG_M + 1.0, _POLES_APART_M):
        x, y = ax + along[0] * at - along[1] * off_m, ay + along[1] * at + along[0] * off_m
        if _is_free(((x, y), (x + 0.01, y)), scene, ()):
            spots.append((round(float(x), 2), round(float(y), 2)))
    poles = tuple(Pole(position=Point2(x=x, y=y), height_m=height_m) for x, y in spots)
    thick_m = round(float(rng.uniform(*_DIAMETER_M)), 3)
    wires = [
        _wire((*a, height_m - below), (*b, height_m - below), 0.5, thick_m)
        for a, b in pairwise(spots)
        for below in (0.2, 0.7)
    ]
    drops = [_to_a_wall((*spot, height_m - 0.5), scene, thick_m) for spot in spots]
    return _Wires(poles, (*wires, *[drop for drop in drops if drop is not None][:2]))


def _to_a_wall(start: tuple[float, float, float], scene: Scene, thick_m: float) -> OverheadWire | None:
    """From a pole to the middle of the neighbours' nearest wall that looks at it."""
    ends = []
    for building in scene.buildings:
        if building.id == scene.target or building.id.startswith("row-"):
            continue
        for wall in facades(building):
            foot = [wall.start[i] + wall.along[i] * wall.length_m / 2 + wall.normal[i] * 0.02 for i in (0, 1)]
            if (start[0] - foot[0]) * wall.normal[0] + (start[1] - foot[1]) * wall.normal[1] > 1.0:
                ends.append((math.dist(foot, start[:2]), foot[0], foot[1], wall_height_m(building) - 0.6))
    if not ends or min(ends)[0] > _DROP_M:
        return None
    _, x, y, top_m = min(ends)
    return _wire(start, (x, y, min(top_m, start[2])), 0.3, thick_m)


def _wire(
    start: tuple[float, float, float], end: tuple[float, float, float], sag_m: float, thick_m: float
) -> OverheadWire:
    ends = [
        Point3(**{axis: round(value, 2) for axis, value in zip("xyz", place, strict=True)}) for place in (start, end)
    ]
    return OverheadWire(start=ends[0], end=ends[1], sag_m=sag_m, diameter_m=thick_m)


def _off_road_m(place: Corner, road: Road) -> float:
    """Metres from a place to the edge of the road's pavement; negative on it."""
    (ax, ay), (bx, by) = (road.start.x, road.start.y), (road.end.x, road.end.y)
    length_m = math.hypot(bx - ax, by - ay)
    across = abs((bx - ax) * (place[1] - ay) - (by - ay) * (place[0] - ax)) / length_m
    return across - road.width_m / 2 - road.pavement_m


def _plan(building: Building) -> tuple[Corner, ...]:
    return tuple((p.x, p.y) for p in building.footprint)
