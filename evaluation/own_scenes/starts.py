"""Where a drone may start in a scene: on the ground in the open, before a wall of the target, with nothing between."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from contracts.scene import Scene
from contracts.scene_layout import floor_outline
from evaluation.scene_generator.footprints import distance_to_outline

NEAREST_M, FARTHEST_M = 6.0, 14.0
"""Before a wall: nearer, the first look shows too little of it; farther, something may stand between."""
GRID_M = 2.0
ROOM_M = 1.5
"""Kept from walls, and from what stands on the ground."""
CAR_M = 2.4
"""Half of its length."""
_EYE_M = 40.0

Xy = tuple[float, float]


class Start(NamedTuple):
    """A place on the ground (metres, ENU) and the yaw (radians) that faces the target's nearest wall."""

    x: float
    y: float
    yaw: float


class Wall(NamedTuple):
    """What a straight look meets first."""

    building: str
    away_m: float


def walkable_starts(scene: Scene) -> list[Start]:
    """Every place of a grid about the target where a drone may start."""
    target = floor_outline(scene.building(scene.target), 1)
    xs, ys = [x for x, _ in target], [y for _, y in target]
    found = []
    for x in _grid(min(xs), max(xs)):
        for y in _grid(min(ys), max(ys)):
            away_m = distance_to_outline((x, y), target)
            if not NEAREST_M <= away_m <= FARTHEST_M or not _open(scene, (x, y)):
                continue
            foot = _foot((x, y), target)
            yaw = math.atan2(foot[1] - y, foot[0] - x)
            wall = faced_wall(scene, (x, y), yaw)
            if wall is not None and wall.building == scene.target:
                found.append(Start(x, y, yaw))
    return found


def faced_wall(scene: Scene, place: Xy, yaw: float) -> Wall | None:
    """The first wall that a level look from the ground meets; None where none is within 40 m."""
    end = (place[0] + _EYE_M * math.cos(yaw), place[1] + _EYE_M * math.sin(yaw))
    met = [
        Wall(building.id, _EYE_M * share)
        for building in scene.buildings
        for a, b in _sides(floor_outline(building, 1))
        if (share := _share_met(place, end, a, b)) is not None
    ]
    return min(met, key=lambda wall: wall.away_m, default=None)


def _open(scene: Scene, place: Xy) -> bool:
    """In the world, and nothing stands there."""
    ground = scene.ground
    if max(abs(place[0]), abs(place[1])) > ground.half_size_m - ROOM_M:
        return False
    if any(distance_to_outline(place, floor_outline(building, 1)) < ROOM_M for building in scene.buildings):
        return False
    things = [(tree.position, tree.crown_m) for tree in ground.trees]
    things += [(car.position, CAR_M) for car in ground.cars] + [(lamp, 0.2) for lamp in ground.lamps]
    things += [(pole.position, 0.2) for pole in ground.poles]
    if any(math.dist(place, (at.x, at.y)) < radius_m + ROOM_M for at, radius_m in things):
        return False
    lines = [(hedge, hedge.width_m / 2) for hedge in ground.hedges] + [(fence, 0.15) for fence in ground.fences]
    return all(
        math.dist(place, _nearest(place, (line.start.x, line.start.y), (line.end.x, line.end.y))) >= half_m + ROOM_M
        for line, half_m in lines
    )


def _grid(low: float, high: float) -> Iterator[float]:
    first = math.floor((low - FARTHEST_M) / GRID_M)
    for k in range(first, math.ceil((high + FARTHEST_M) / GRID_M) + 1):
        yield k * GRID_M


def _foot(place: Xy, outline: tuple[Xy, ...]) -> Xy:
    """The nearest place of the outline."""
    return min((_nearest(place, a, b) for a, b in _sides(outline)), key=lambda foot: math.dist(foot, place))


def _nearest(p: Xy, a: Xy, b: Xy) -> Xy:
    dx, dy = b[0] - a[0], b[1] - a[1]
    t = max(0.0, min(1.0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy)))
    return a[0] + t * dx, a[1] + t * dy


def _sides(outline: tuple[Xy, ...]) -> Iterator[tuple[Xy, Xy]]:
    return zip(outline, outline[1:] + outline[:1], strict=True)


def _share_met(p: Xy, q: Xy, a: Xy, b: Xy) -> float | None:
    """How far along from p to q (0..1) the side from a to b is met; None where it is not."""
    dx, dy, ex, ey = q[0] - p[0], q[1] - p[1], b[0] - a[0], b[1] - a[1]
    across = dx * ey - dy * ex
    if abs(across) < 1e-12:
        return None
    share = ((a[0] - p[0]) * ey - (a[1] - p[1]) * ex) / across
    side = ((a[0] - p[0]) * dy - (a[1] - p[1]) * dx) / across
    return share if 0.0 <= share <= 1.0 and 0.0 <= side <= 1.0 else None
