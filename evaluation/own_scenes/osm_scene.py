"""A scene from a map: the building to deliver to, what stands around it, and what the map does not say."""

import math
import re
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from contracts.errors import first_problem
from contracts.footprint import footprint_problem
from contracts.geometry import Point2, Point3
from contracts.scene import Building, BuildingKind, Ground, Road, Scene, SceneObject, Start, Tree, WindowPlace
from contracts.scene_layout import WindowSlot, facades, floor_outline, window_slots
from evaluation.own_scenes.osm_file import BadMap, LatLon, OsmBuilding, OsmMap, Xy
from evaluation.own_scenes.starts import ROOM_M, walkable_starts
from evaluation.scene_generator.footprints import distance_to_outline, outlines_gap
from evaluation.scene_generator.scenes import START_Z_M
from evaluation.scene_generator.style_families import FAMILIES, dress
from mission.wording import counted

MAX_NEIGHBOURS, MAX_ROADS, MAX_TREES, MAX_CORNERS, MAX_FLOORS = 31, 16, 200, 32, 60
STOREY_M = 3.0
HIGH_FLOORS = 8
BEST_START_M = 9.0
_TOLERANCES_M = (0.1, 0.3, 0.6, 1.0, 1.5, 2.0)
_BEFORE_WINDOW_M = 4.0
_EDGE_M = 25.0
_VILLAS = frozenset({"house", "detached", "villa", "bungalow", "semidetached_house", "cabin", "farm"})
_CULTURAL = frozenset({"temple", "church", "cathedral", "mosque", "shrine", "pagoda", "monastery", "chapel"})
_WIDTHS_M = {"motorway": 14.0, "trunk": 12.0, "primary": 10.0, "secondary": 9.0, "tertiary": 8.0, "service": 4.0}
_FOOTWAYS = frozenset({"footway", "path", "steps", "cycleway", "bridleway", "corridor", "proposed", "construction"})


class Thing(NamedTuple):
    """What marks the customer's window: a class of the catalogue, its colour, and the floor."""

    kind: str
    colour: str
    floor: int


class Wanted(NamedTuple):
    """`target`: a building's id (`way/123`, `relation/45`, or the number alone); else the one nearest to `at`, or to
    the map's middle. `around_m`: how far from it others are taken; `levels`: of a building that says none."""

    name: str
    target: str | None = None
    at: LatLon | None = None
    around_m: float = 60.0
    levels: int = 3
    thing: Thing | None = None
    seed: int = 0


class FromMap(NamedTuple):
    """The scene, and what was taken or assumed, in sentences."""

    scene: Scene
    told: tuple[str, ...]


def scene_of(found: OsmMap, wanted: Wanted) -> FromMap:
    """Raises BadMap where nothing can be delivered to: no such building, no sound outline, no place to start."""
    target = _chosen(found, wanted)
    middle = _centre(target.outline)
    built = _built(target, middle, wanted)
    if isinstance(built, str):
        raise BadMap(f"{target.id}: {built}; choose another building with --target or --at")
    outline = floor_outline(built, 1)
    others: list[tuple[float, Building, OsmBuilding]] = []
    unsound = 0
    for other in found.buildings:
        if other is target or math.dist(_centre(other.outline), middle) > wanted.around_m + 200.0:
            continue
        made = _built(other, middle, wanted)
        if isinstance(made, str):
            unsound += 1
        elif (gap_m := outlines_gap(outline, floor_outline(made, 1))) <= wanted.around_m:
            others.append((gap_m, made, other))
    taken = sorted(others, key=lambda each: each[0])[:MAX_NEIGHBOURS]
    neighbours = [made for _, made, _ in taken]
    buildings = (built, *neighbours)
    reach = max(max(abs(p.x), abs(p.y)) for b in buildings for p in b.footprint) + _EDGE_M
    ground = _ground(found, middle, buildings, min(500.0, max(60.0, reach)))
    scene = _placed(buildings, ground, wanted)
    silent = sum("building:levels" not in b.tags and "height" not in b.tags for b in found.buildings)
    told = [
        f"delivers to {target.id}{_named(target)}: {built.floors} floors, {len(built.footprint)} walls",
        f"{counted(len(neighbours), 'other building')} within {wanted.around_m:g} m, "
        f"{counted(len(ground.roads), 'piece')} of road, {counted(len(ground.trees), 'tree')}",
    ]
    if silent:
        told.append(f"{silent} of the map's {len(found.buildings)} buildings tell no levels: {wanted.levels} are taken")
    if found.cut_off or unsound:
        cut_off = counted(found.cut_off, "building")
        told.append(f"left out: {cut_off} of which the map has a part, {unsound} with an outline that is none")
    if target.courtyards:
        told.append(
            f"{target.id} has {counted(target.courtyards, 'courtyard')}: built over, so no window looks into it"
        )
    if beside := sum(source.courtyards > 0 for _, _, source in taken):
        told.append(f"{counted(beside, 'other building')} with a courtyard, built over as well")
    return FromMap(scene, tuple(told))


def _chosen(found: OsmMap, wanted: Wanted) -> OsmBuilding:
    if not found.buildings:
        raise BadMap("the map has no buildings (closed ways tagged `building`): take an extract of a built-up street")
    if wanted.target is not None:
        asked = wanted.target if "/" in wanted.target else f"way/{wanted.target}"
        for building in found.buildings:
            if building.id in (asked, f"relation/{wanted.target}"):
                return building
        some = ", ".join(building.id for building in found.buildings[:5])
        raise BadMap(f"the map has no building {asked}; it has {some}{', ...' if len(found.buildings) > 5 else ''}")
    at = (0.0, 0.0) if wanted.at is None else found.place(wanted.at)
    return min(found.buildings, key=lambda building: math.dist(_centre(building.outline), at))


def _built(source: OsmBuilding, middle: Xy, wanted: Wanted) -> Building | str:
    """As the scene document has it, or what is wrong with its outline."""
    outline = _sound([(x - middle[0], y - middle[1]) for x, y in source.outline])
    if isinstance(outline, str):
        return outline
    floors = _floors(source.tags, wanted.levels)
    kind = _kind(source.tags, floors)
    chance = np.random.default_rng((wanted.seed, zlib.crc32(source.id.encode())))
    families = FAMILIES[kind]
    clothes = dress(kind, families[int(chance.integers(len(families)))], False, chance)
    colour = source.tags.get("building:colour", "").lower()
    style = clothes.style
    if re.fullmatch("#[0-9a-f]{6}", colour):
        style = style.model_copy(update={"wall_colour": colour})
    try:
        return Building(
            id=source.id.replace("/", "-"),
            kind=kind,
            footprint=tuple(Point2(x=round(x, 2), y=round(y, 2)) for x, y in outline),
            floors=floors,
            floor_height_m=clothes.floor_height_m,
            style=style,
            windows=clothes.windows,
            roof="flat",
        )
    except ValidationError as error:
        return first_problem(error)


def _sound(outline: Sequence[Xy]) -> list[Xy] | str:
    """Counter-clockwise, with as little left out as makes a plan of it, or what is wrong with it."""
    from shapely import Polygon  # heavy, and only needed here

    drawn = Polygon(outline)
    problem: str | None = "its outline crosses itself"
    if drawn.is_valid and drawn.area > 0.0:
        for tolerance_m in _TOLERANCES_M:
            corners = list(drawn.simplify(tolerance_m).exterior.coords)[:-1]
            if sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)) < 0.0:
                corners.reverse()
            problem = footprint_problem(corners)
            if len(corners) > MAX_CORNERS:
                problem = f"it has {len(corners)} corners; at most {MAX_CORNERS} are built"
            if problem is None:
                return [(float(x), float(y)) for x, y in corners]
    return str(problem)


def _floors(tags: dict[str, str], usual: int) -> int:
    levels = _number(tags.get("building:levels"))
    height_m = _number(tags.get("height"))
    floors = levels if levels is not None else None if height_m is None else height_m / STOREY_M
    return min(MAX_FLOORS, max(1, round(floors if floors is not None else usual)))


def _number(text: str | None) -> float | None:
    """The first number of `12`, `12.5 m`, `3;4`; feet as metres."""
    found = re.match(r"\s*(\d+(?:\.\d+)?)\s*(ft|')?", text or "")
    if found is None:
        return None
    return float(found.group(1)) * (0.3048 if found.group(2) else 1.0)


def _kind(tags: dict[str, str], floors: int) -> BuildingKind:
    if tags["building"] in _CULTURAL:
        return "cultural"
    if floors >= HIGH_FLOORS:
        return "high_rise"
    return "villa" if tags["building"] in _VILLAS and floors <= 3 else "low_rise"


def _ground(found: OsmMap, middle: Xy, buildings: Sequence[Building], half_m: float) -> Ground:
    def moved(point: Xy) -> Xy:
        return round(point[0] - middle[0], 2), round(point[1] - middle[1], 2)

    def inside(point: Xy) -> bool:
        return max(abs(point[0]), abs(point[1])) <= half_m

    pieces = []
    for road in found.roads:
        kind = road.tags["highway"]
        if kind in _FOOTWAYS:
            continue
        width_m = _number(road.tags.get("width")) or _WIDTHS_M.get(kind, 6.0)
        for a, b in zip(road.points, road.points[1:], strict=False):
            start, end = moved(a), moved(b)
            if inside(start) and inside(end) and math.dist(start, end) > 2.0:
                pieces.append((start, end, min(40.0, max(2.0, width_m)), 0.0 if kind == "service" else 2.0))
    pieces.sort(key=lambda piece: -math.dist(piece[0], piece[1]))
    plans = [floor_outline(building, 1) for building in buildings]
    trees = [
        at
        for tree in found.trees
        if inside(at := moved(tree)) and min(distance_to_outline(at, plan) for plan in plans) > ROOM_M + 1.0
    ]
    return Ground(
        surface="paving" if len(buildings) > 8 else "grass",
        half_size_m=half_m,
        roads=tuple(
            Road(start=Point2(x=a[0], y=a[1]), end=Point2(x=b[0], y=b[1]), width_m=width_m, pavement_m=pavement_m)
            for a, b, width_m, pavement_m in pieces[:MAX_ROADS]
        ),
        trees=tuple(Tree(position=Point2(x=x, y=y), height_m=7.0, crown_m=1.6) for x, y in trees[:MAX_TREES]),
    )


def _placed(buildings: tuple[Building, ...], ground: Ground, wanted: Wanted) -> Scene:
    """With a start before the target, and the thing at one of its windows. Raises BadMap."""
    anywhere = Start(position=Point3(x=0.0, y=0.0, z=START_Z_M), yaw=0.0)
    target = buildings[0]
    try:
        bare = Scene(
            name=wanted.name, seed=wanted.seed, buildings=buildings, target=target.id, ground=ground, start=anywhere
        )
    except ValidationError as error:
        raise BadMap(f"the map makes no scene: {first_problem(error)}") from None
    starts = walkable_starts(bare)
    if not starts:
        raise BadMap(
            f"{target.id}: nowhere about it may a drone start in the open, facing it from 6 to 14 m; choose another "
            "building with --target or --at"
        )
    walls = facades(target)
    longest_m = max(wall.length_m for wall in walls)
    stands = [
        [w.start[i] + w.along[i] * w.length_m / 2 + w.normal[i] * BEST_START_M for i in (0, 1)]
        for w in walls
        if w.length_m > longest_m / 2
    ]
    # before the middle of a wall, as near to the usual distance as the open ground allows
    best = min(starts, key=lambda s: min(math.dist((s.x, s.y), stand) for stand in stands))
    start = Start(position=Point3(x=best.x, y=best.y, z=START_Z_M), yaw=round(best.yaw, 6))
    placed = bare.model_copy(update={"start": start})
    if wanted.thing is None:
        return placed
    thing = _at_window(placed, wanted.thing, wanted.seed)
    return placed.model_copy(update={"objects": (thing,), "goal": thing.id})


def _at_window(scene: Scene, thing: Thing, seed: int) -> SceneObject:
    """On the sill of a window of that floor with room before it. Raises BadMap."""
    target = scene.building(scene.target)
    if thing.floor > target.floors:
        raise BadMap(f"--floor: {target.id} has {target.floors} floors; there is no {thing.floor}")
    free = [s for s in window_slots(target) if s.floor == thing.floor and _has_room(scene, s)]
    if not free:
        raise BadMap(f"{target.id} has no window on floor {thing.floor} with {_BEFORE_WINDOW_M:g} m of room before it")
    slot = free[int(np.random.default_rng(seed).integers(len(free)))]
    place = WindowPlace(building=target.id, facade=slot.facade, floor=slot.floor, column=slot.column)
    return SceneObject(id="goal", kind=thing.kind, colour=thing.colour, place=place)


def _has_room(scene: Scene, slot: WindowSlot) -> bool:
    """No building stands before the window, as one does where houses share a wall."""
    x, y = (slot.centre[i] + slot.normal[i] * _BEFORE_WINDOW_M for i in (0, 1))
    return all(distance_to_outline((x, y), floor_outline(b, 1)) > 2.0 for b in scene.buildings)


def _centre(outline: Sequence[Xy]) -> Xy:
    return sum(x for x, _ in outline) / len(outline), sum(y for _, y in outline) / len(outline)


def _named(building: OsmBuilding) -> str:
    tags = building.tags
    street = " ".join(tags[key] for key in ("addr:street", "addr:housenumber") if key in tags)
    name = tags.get("name") or street
    return f" ({name})" if name else ""
