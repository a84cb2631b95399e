"""A task's shortest ways: round the footprints on the plan, to the nearest place where the delivery would succeed."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Literal, NamedTuple

from contracts.depth_assist import ApproachSettings
from contracts.geometry import Point3
from contracts.scene import Scene
from contracts.scene_layout import WindowSlot, floor_outline, goal_window, window_slots
from contracts.sim import SUCCESS_RADIUS_M, Flight
from navigation.shortest_path import NoWay, Route, VisibilityGraph

OWN_CLEARANCE_M = Flight().radius_m + ApproachSettings().clearance_m
"""What the drone's centre keeps from a wall on its last metres: nobody flies nearer."""


class Edition(NamedTuple):
    """How a set's ways are measured. `clearances_m`: tried in turn until a flight proves the way free, for balconies
    and eaves jut out of the footprint. `own_window`: a way ends only where no other window is nearer."""

    clearances_m: tuple[float, ...]
    own_window: bool


FIRST = Edition((0.8, 1.3, 1.8, 2.4), own_window=False)
"""Of vld-300, which stays as it is."""
SECOND = Edition((OWN_CLEARANCE_M, 1.3, 1.8, 2.4), own_window=True)
_INSIDE_M = 0.05
_FAN_DEG = range(-60, 61, 5)


class ShortestWay(NamedTuple):
    """`path` from the start (left out) to the stop; lengths in metres. `clearance_m` was kept from every wall on the
    plan. `climb`: evenly all the way, or at the start before anything else, where eaves are in the even climb's way."""

    horizontal_m: float
    spatial_m: float
    path: tuple[Point3, ...]
    clearance_m: float
    climb: Literal["evenly", "first"]


def goal_slot(scene: Scene) -> WindowSlot:
    """The customer's window. Raises ValueError where the goal stands at none."""
    slot = goal_window(scene)
    if slot is None:
        raise ValueError(f"scene {scene.name} has no goal at a window")
    return slot


def ways(scene: Scene, edition: Edition) -> Iterator[ShortestWay]:
    """The shortest way for each of the edition's clearances for which there is one, climbing evenly and climbing first.

    It ends at the height of the window's centre, at most 60 degrees aside of its normal and just inside the radius of
    success.
    """
    slot = goal_slot(scene)
    start = scene.start.position
    outlines = obstacles(scene, slot)
    for clearance in edition.clearances_m:
        stops = stops_before(slot, clearance)
        if edition.own_window:
            stops = tuple(stop for stop in stops if _own(scene, slot, stop))
        graph = VisibilityGraph(outlines, clearance)
        # from the stops to the start: one search for all of them
        found = graph.routes(stops, (start.x, start.y))
        free = [
            (route, stop)
            for route, stop in zip(found, stops, strict=True)
            if not isinstance(route, NoWay) and _ends_straight(route)
        ]
        if free:
            route, _ = min(free, key=lambda pair: pair[0].length_m)
            yield _climbing_evenly(route, start, slot.centre[2], clearance)
            yield _climbing_first(route, start, slot.centre[2], clearance)


def obstacles(scene: Scene, slot: WindowSlot) -> list[tuple[tuple[float, float], ...]]:
    """Ground plans in the drone's way: the target as it is at the goal's floor, and its neighbours."""
    target = scene.building(scene.target)
    others = [b for b in scene.buildings if b.id != scene.target]
    return [floor_outline(target, slot.floor), *(floor_outline(b, 1) for b in others)]


def stops_before(slot: WindowSlot, clearance_m: float) -> tuple[tuple[float, float], ...]:
    """Places at most 60 degrees aside of a window's normal and just inside the radius of success, so far from its
    wall."""
    reach = SUCCESS_RADIUS_M - _INSIDE_M
    stops = []
    for degrees in _FAN_DEG:
        out, aside = reach * math.cos(math.radians(degrees)), reach * math.sin(math.radians(degrees))
        x, y = (slot.centre[i] + slot.normal[i] * out + slot.along[i] * aside for i in (0, 1))
        if out >= clearance_m:
            stops.append((x, y))
    return tuple(stops)


def _own(scene: Scene, slot: WindowSlot, stop: tuple[float, float]) -> bool:
    """No other window's centre is nearer to that place, at the height of this one's."""
    here = (*stop, slot.centre[2])
    own_m = math.dist(here, slot.centre) + _INSIDE_M
    others = (other for building in scene.buildings for other in window_slots(building) if other != slot)
    return all(math.dist(here, other.centre) > own_m for other in others)


def _ends_straight(route: Route) -> bool:
    """The graph steps an end that is shut in away from the wall; such a stop is not free."""
    return len(route.waypoints) < 2 or math.dist(route.waypoints[0], route.waypoints[1]) > 1e-3


def _climbing_evenly(route: Route, start: Point3, z: float, clearance_m: float) -> ShortestWay:
    corners = route.waypoints[::-1]
    path = []
    gone = 0.0
    for before, here in pairwise(corners):
        gone += math.dist(before, here)
        share = gone / route.length_m if route.length_m else 1.0
        path.append(Point3(x=here[0], y=here[1], z=start.z + share * (z - start.z)))
    return ShortestWay(route.length_m, math.hypot(route.length_m, z - start.z), tuple(path), clearance_m, "evenly")


def _climbing_first(route: Route, start: Point3, z: float, clearance_m: float) -> ShortestWay:
    above = Point3(x=start.x, y=start.y, z=z)
    path = (above, *(Point3(x=x, y=y, z=z) for x, y in route.waypoints[::-1][1:]))
    return ShortestWay(route.length_m, abs(z - start.z) + route.length_m, path, clearance_m, "first")
