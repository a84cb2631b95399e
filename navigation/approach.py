"""The approach: from a seen box to a safe stop in front of the facade, on a way that depth has shown to be free."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from navigation import corner as corners
from navigation import opening as openings
from navigation import target as targets
from navigation.camera import DepthView, Place, Pose
from navigation.keep_out import Volume, surfaces
from navigation.point_cloud import GROUND_M, Points, cloud, nearest_of_blocks, to_enu
from navigation.railings import carriers, railings_on
from navigation.sensing import FREE, leaves_invalid, looked_at
from navigation.target import Box, Target

_ANOTHER_SIDE_RAD = math.radians(20.0)
_ANOTHER_PLACE_M = 1.0
"""Nearer than this a further look shows what this one has shown."""
_BEFORE_THING_M = 1.5
"""Railings and sills stand so near; they may be looked over from nearer."""


class ApproachParameters(NamedTuple):
    """Free constants of the approach.

    `stop_distance_m`: from the drone's centre to the thing, along the facade's normal; more where a railing juts out,
    so that `clearance_m` beyond the drone's radius stays free. `height_slack_m`: the drone keeps its height while that
    is within so much of the thing's. `max_protrusion_m`: what juts out farther belongs no more to the facade.
    `unseen_m`: so near to the drone the cameras cannot look round; it stands there already, so that is taken as free.
    `slide_offsets_m` and `retreats_m`: where the corner of a two-leg way is tried, sideways from the straight line in
    front of the thing and out from the stop. `aside_turns_deg` and `aside_out_m`: from where the thing is looked at
    anew where no way leads to the stop, by bearing from the facade's normal and distance.
    """

    drone_radius_m: float
    clearance_m: float
    stop_distance_m: float
    height_slack_m: float
    max_protrusion_m: float = 3.0
    unseen_m: float = 1.5
    slide_offsets_m: tuple[float, ...] = (0.0, -1.5, 1.5, -3.0, 3.0, -5.0, 5.0)
    retreats_m: tuple[float, ...] = (2.0, 4.0, 6.0, 9.0, 12.0)
    aside_turns_deg: tuple[float, ...] = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0)
    aside_out_m: tuple[float, ...] = (3.0, 4.5, 6.0)
    target: targets.TargetParameters = targets.TargetParameters()
    corner: corners.CornerParameters = corners.CornerParameters()
    opening: openings.OpeningParameters = openings.OpeningParameters()


class Approach(NamedTuple):
    """`status`: `clear` with a path; `blocked`: no free way was seen; `no_depth`: nothing measurable in the box.

    `path`: waypoints in flying order, without the start; empty where nothing is known to stand in the way but no camera
    looks along it: turn to the facade and look again. `reached`: the path ends at `stop`, not at a cut-off leg.
    `free_distance_m`: how far the straight line towards the stop is free. `aside`: where that is `blocked`, a free way
    to where the thing can be looked at from another side; empty where there is none."""

    status: Literal["clear", "blocked", "no_depth"]
    target: Target | None = None
    stop: Place | None = None
    path: tuple[Place, ...] = ()
    reached: bool = False
    free_distance_m: float | None = None
    aside: tuple[Place, ...] = ()


def plan_approach(
    view: DepthView,
    others: Sequence[DepthView],
    box: Box,
    pose: Pose,
    settings: ApproachParameters,
    max_leg_m: float,
    keep_out: Sequence[Volume] = (),
) -> Approach:
    """The way from `pose` to the stop in front of the thing in `box` of `view`.

    Straight if that is free, else by one corner: sideways or back first, then in. A way is free where a ball of the
    drone's radius + clearance touches neither a return of any view nor a railing that depth may have missed, and every
    part of it lies where some view looked through. Where only the second leg is out of sight, the path ends at the
    corner, for another look from there; not at one where the drone hovers already.
    `others` are further views of the same moment. `max_leg_m` caps the whole flight. `keep_out` is solid, though
    nothing is hidden behind it.
    """
    found = targets.locate(view, box, pose, settings.target)
    if found is None:
        return Approach("no_depth")
    views = (view, *others)
    points = np.concatenate([to_enu(cloud(v, nearest_of_blocks(v)), pose) for v in views])
    points = points[points[:, 2] > GROUND_M]  # the ground is no obstacle of a way above it
    found = corners.at_nearest_wall(found, points, settings.corner)
    shown = points
    if leaves_invalid(views):
        points = np.concatenate([points, railings_on(carriers(points, pose))])
    if keep_out:
        points = np.concatenate([points, surfaces(keep_out, Place(pose.x, pose.y, pose.z))])
    stop = stop_place(found, shown, points, pose, settings)
    start = Place(pose.x, pose.y, pose.z)
    points = _within_reach(points, start, stop, settings)
    free = free_along(points, start, stop, settings)
    halfway: tuple[Place, ...] | None = None
    for way in _ways(start, stop, found, settings):
        if not _is_free(way, points, settings):
            continue
        if _is_seen(way, views, pose, settings):
            path, reached = _cut(way, max_leg_m)
            return Approach("clear", found, stop, path, reached, free)
        elsewhere = len(way) > 2 and math.dist(*way[:2]) >= _ANOTHER_PLACE_M
        if elsewhere and halfway is None and _is_seen(way[:2], views, pose, settings):
            halfway = way[:2]
    if halfway is not None:
        return Approach("clear", found, stop, _cut(halfway, max_leg_m)[0], False, free)
    if free >= math.dist(start, stop) - 1e-6:
        return Approach("clear", found, stop, (), False, free)
    aside = _aside(start, found, points, shown, views, pose, settings)
    return Approach("blocked", found, stop, (), False, free, _cut(aside, max_leg_m)[0] if aside else ())


def stop_place(target: Target, shown: Points, points: Points, pose: Pose, settings: ApproachParameters) -> Place:
    """Where the drone stops: in front of the thing along the facade's normal, clear of what juts out beside it; in an
    inner corner as far aside as keeps it nearer to the thing's own wall than to the other, on the wall between two
    openings a little towards the nearer one.

    shown: (N, 3) ENU, what depth shows of the facade; points: (M, 3) ENU, what to keep clear of, which may be more.
    """
    room = settings.drone_radius_m + settings.clearance_m
    z = min(max(pose.z, target.place.z - settings.height_slack_m), target.place.z + settings.height_slack_m)

    def room_m(thing: Target) -> float:
        return targets.protrusion_m(points, thing, room, settings.max_protrusion_m) + room + 0.05

    aside = corners.stop_beside_corner(target, shown, z, settings.stop_distance_m, room_m, settings.corner)
    if aside is not None:
        return aside
    before = openings.stop_towards_opening(target, shown, pose, settings.opening)
    out = max(settings.stop_distance_m, room_m(target._replace(place=before._replace(z=z))))
    return Place(before.x + target.normal[0] * out, before.y + target.normal[1] * out, z)


def free_along(points: Points, start: Place, end: Place, settings: ApproachParameters) -> float:
    """How far the drone, grown by its clearance, can fly from start towards end; at most their distance.

    points: (N, 3) ENU. What lies within that distance of the start already counts only as far as it comes nearer.
    """
    leg = np.array(end, np.float64) - np.array(start, np.float64)
    length = float(np.linalg.norm(leg))
    if length == 0.0 or not len(points):
        return length
    unit = (leg / length).astype(np.float32)
    gap = points - np.array(start, np.float32)
    squared = np.einsum("ij,ij->i", gap, gap)
    full = settings.drone_radius_m + settings.clearance_m
    radius = min(full, max(settings.drone_radius_m, 0.95 * math.sqrt(float(squared.min()))))
    along = gap @ unit
    aside_squared = squared - along * along
    hit = (along > 0.0) & (aside_squared < radius * radius)
    if not hit.any():
        return length
    stops = along[hit] - np.sqrt(radius * radius - np.maximum(aside_squared[hit], 0.0))
    return min(length, max(0.0, float(stops.min())))


def _ways(start: Place, stop: Place, target: Target, settings: ApproachParameters) -> Iterator[tuple[Place, ...]]:
    """The straight way, then the two-leg ways, shortest first."""
    yield start, stop
    corners = [
        Place(stop.x + out * east - side * north, stop.y + out * north + side * east, z)
        for east, north in (target.normal,)
        for out in settings.retreats_m
        for side in settings.slide_offsets_m
        for z in (start.z, stop.z)
    ]
    ways = {(start, corner, stop) for corner in corners}
    yield from sorted(ways, key=lambda way: (sum(math.dist(a, b) for a, b in pairwise(way)), way))


def _aside(
    start: Place,
    target: Target,
    points: Points,
    shown: Points,
    views: Sequence[DepthView],
    pose: Pose,
    settings: ApproachParameters,
) -> tuple[Place, ...]:
    """The straight way, its start included, to the nearest place that sees the thing from another side and that
    nothing is in the way of; empty where there is none. `shown`: of `points`, those that hide what is behind them.

    The normal may be that of a balcony's side or of the neighbouring wall: from another side, the right one shows.
    """
    facing = math.atan2(target.normal[1], target.normal[0])
    sight = math.atan2(start.y - target.place.y, start.x - target.place.x)
    places = []
    for turn in settings.aside_turns_deg:
        angle = facing + math.radians(turn)
        if abs(math.remainder(angle - sight, math.tau)) < _ANOTHER_SIDE_RAD:
            continue
        for out in settings.aside_out_m:
            places.append(
                Place(target.place.x + out * math.cos(angle), target.place.y + out * math.sin(angle), start.z)
            )
    thin = settings._replace(drone_radius_m=0.1, clearance_m=0.0)
    for place in sorted(places, key=lambda p: math.dist(p, start)):
        way = (start, place)
        before = _towards(target.place, place, _BEFORE_THING_M)
        if (
            _is_free(way, points, settings)
            and _is_seen(way, views, pose, settings)
            and _is_free((place, before), shown, thin)
        ):
            return way
    return ()


def _towards(a: Place, b: Place, by_m: float) -> Place:
    """The point so far from `a` on the straight line to `b`."""
    share = min(1.0, by_m / math.dist(a, b))
    return Place(*(p + (q - p) * share for p, q in zip(a, b, strict=True)))


def _within_reach(points: Points, start: Place, stop: Place, settings: ApproachParameters) -> Points:
    """The points that could touch any of the tried ways."""
    room = settings.drone_radius_m + settings.clearance_m
    reach = room + math.hypot(max(settings.retreats_m), max(abs(side) for side in settings.slide_offsets_m))
    margin = np.array((reach, reach, room))
    low, high = np.minimum(start, stop) - margin, np.maximum(start, stop) + margin
    kept: Points = points[((points >= low) & (points <= high)).all(axis=1)]
    return kept


def _is_free(way: tuple[Place, ...], points: Points, settings: ApproachParameters) -> bool:
    return all(free_along(points, a, b, settings) >= math.dist(a, b) - 1e-6 for a, b in pairwise(way))


def _is_seen(way: tuple[Place, ...], views: Sequence[DepthView], pose: Pose, settings: ApproachParameters) -> bool:
    return all(_looked_through(a, b, views, pose, settings) for a, b in pairwise(way))


def _looked_through(a: Place, b: Place, views: Sequence[DepthView], pose: Pose, settings: ApproachParameters) -> bool:
    """Does some view see past every half metre of the leg, the drone's own surroundings apart?"""
    count = max(2, math.ceil(math.dist(a, b) / 0.5) + 1)
    places = np.linspace(np.array(a), np.array(b), count)
    gap = places - np.array([pose.x, pose.y, pose.z])
    seen = (np.linalg.norm(gap, axis=1) <= settings.unseen_m) | (looked_at(places, views, pose) == FREE)
    return bool(seen.all())


def _cut(way: tuple[Place, ...], max_leg_m: float) -> tuple[tuple[Place, ...], bool]:
    """The way without its start, ended after `max_leg_m`; and whether it still reaches its end."""
    path: list[Place] = []
    left = max_leg_m
    for a, b in pairwise(way):
        length = math.dist(a, b)
        if length > left:
            path.append(_towards(a, b, left))
            return tuple(path), False
        path.append(b)
        left -= length
    return tuple(path), True
