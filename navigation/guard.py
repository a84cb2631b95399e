"""What a flight may do, judged by geometry alone: the space allowed, what depth has shown, where anybody has looked.

It knows no plan, no model and no building: a straight path from where the drone is, and the looks made so far. Heights
are above the ground at the start; all places are ENU. `mission.guard` asks it before every flight.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.airspace import Refusal, Space, outside
from navigation.camera import DepthView, Place, Pose
from navigation.point_cloud import GROUND_M, Points, cloud, nearest_of_blocks, thinned, to_enu
from navigation.railings import carriers, railings_on
from navigation.sensing import FREE, HIDDEN, leaves_invalid, looked_at, read_views

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_STEP_M = 0.25
_KEPT_M = 20.0
"""Returns farther from the drone are looked at again before it gets there."""
_COARSE_PX = 200
_BESIDE_M = 1.5
"""So near to the drone the cameras cannot look round; it hovers there, so that is taken as free, but for upwards."""
_FLOWN_M = 0.4
_STEEP = 0.3
_SEEN_THROUGH_M = 0.5
_LOOKS_PAST_THIN = 3
_COMES_NEARER_M = 1e-3
_OVERHANG_M = 4.0
"""What juts out over a drone is no wider than this to any side: crowns, balconies, awnings."""
_NARROW_M = 2.0
"""Of what stands so near, a canopy or a balcony may reach over the drone and not be seen."""
_OVERHANG_CELL_M = 0.5
_FEW = 6
_NEAR_TOP_M = 14.0
_TOP_SHARE = 1.6
_LIE_M = 1e-6
_NO_POINTS: Points = np.zeros((0, 3), np.float32)


class Look(NamedTuple):
    """What the cameras showed at one moment: coarse views for where nothing is, `points` (N, 3) for what is there.
    `reach_m`: how far the sensor has shown that it reaches, so far. `slabs`: of the points, those on which a railing
    may stand that depth has missed. `misses_thin`: of a sensor that leaves pixels invalid."""

    pose: Pose
    views: tuple[DepthView, ...]
    points: Points
    reach_m: float = 0.0
    slabs: Points = _NO_POINTS
    misses_thin: bool = False


def look_of(views: Sequence[DepthView], pose: Pose, *, shown_m: float = 0.0) -> Look:
    """The look, as it is kept. `views` as the cameras gave them; `shown_m`: the reach shown before."""
    read = read_views(views, shown_m=shown_m)
    blocks = [max(1, view.camera.width // _COARSE_PX) for view in read]
    parts = [
        to_enu(cloud(view, nearest_of_blocks(view, block)), pose) for view, block in zip(read, blocks, strict=True)
    ]
    points = np.concatenate([_NO_POINTS, *parts])
    near = np.hypot(points[:, 0] - pose.x, points[:, 1] - pose.y) <= _KEPT_M
    kept = points[near & (points[:, 2] > GROUND_M)]
    misses_thin = leaves_invalid(views)
    slabs = carriers(kept, pose) if misses_thin else _NO_POINTS
    return Look(pose, tuple(thinned(view, _COARSE_PX) for view in read), kept, shown_m, slabs, misses_thin)


def check(path: Sequence[Place], looks: Sequence[Look], flown: Floats, pose: Pose, space: Space) -> Refusal | None:
    """None where the straight legs from `pose` along `path` may be flown. `looks`: oldest first; `flown` (M, 3): places
    the drone has been at, in order."""
    corners = [Place(pose.x, pose.y, pose.z), *path]
    for a, b in pairwise(corners):
        refusal = outside(a, b, space)
        if refusal is not None:
            return refusal
    way = np.concatenate([flown, [corners[0]]])
    for number, (a, b) in enumerate(pairwise(corners)):
        if math.dist(a, b) < _LIE_M:
            continue
        refusal = (
            _touches(a, b, looks, space.radius_m)
            or _grazes(a, b, looks, way, space.radius_m)
            or _unseen(a, b, looks, way, first=number == 0)
        )
        if refusal is not None:
            return refusal
        way = np.concatenate([way, [b]])
    return None


def top_beside_m(look: Look) -> float | None:
    """How high reaches what stands beside the drone, above ground: the highest returns about as far off as the nearest
    wall; None where nothing stands near."""
    away = np.hypot(look.points[:, 0] - look.pose.x, look.points[:, 1] - look.pose.y)
    if len(away) <= _FEW:
        return None
    nearest = float(np.partition(away, _FEW)[_FEW])
    heights = look.points[away <= max(_NEAR_TOP_M, _TOP_SHARE * nearest), 2]
    return float(np.partition(heights, -_FEW)[-_FEW]) if len(heights) > _FEW else None


def column_is_open(place: Place, to_m: float, looks: Sequence[Look]) -> bool:
    """May the drone climb from `place` to `to_m`, as far as these looks show? Either a camera that looks up sees the
    column free, or nothing hangs over the place: things in the air hold on to something, and what juts out over a drone
    shows its edge to level cameras unless it ends close by; so nothing may stand close by either."""
    samples = np.array([(place.x, place.y, z) for z in np.arange(place.z + _STEP_M, to_m + _STEP_M, _STEP_M)])
    if not len(samples):
        return True
    if (_best(samples, looks) == FREE).all():
        return True
    about = [look for look in looks if math.hypot(look.pose.x - place.x, look.pose.y - place.y) <= _BESIDE_M]
    if not about:
        return False
    points = np.concatenate([look.points for look in about])
    away = np.hypot(points[:, 0] - place.x, points[:, 1] - place.y)
    beside = (away <= _NARROW_M) & (points[:, 2] > place.z - 0.6) & (points[:, 2] < to_m + 1.0)
    if np.count_nonzero(beside) > _FEW:
        return False
    return not overhangs(points[away <= _OVERHANG_M + 1.0], place, to_m)


def column_looks_open(place: Place, to_m: float, looks: Sequence[Look]) -> bool:
    """Is the column over a place elsewhere seen to be free up to that height, and does nothing near jut out over it?"""
    samples = np.array([(place.x, place.y, z) for z in np.arange(place.z, to_m, _STEP_M)]).reshape(-1, 3)
    if not (_best(samples, looks) == FREE).all():
        return False
    points = np.concatenate([_NO_POINTS, *(look.points for look in looks)])
    away = np.hypot(points[:, 0] - place.x, points[:, 1] - place.y)
    beside = (away <= _NARROW_M) & (points[:, 2] > place.z - 0.6) & (points[:, 2] < to_m + 1.0)
    return bool(beside.sum() <= _FEW) and not overhangs(points[away <= _OVERHANG_M + 1.0], place, to_m)


def overhangs(points: Points, place: Place, to_m: float) -> bool:
    """Do points (N, 3) show something about `place` and above it that does not stand on what is below? A wall, a trunk
    or a pole does."""
    high = (points[:, 2] > place.z + 0.5) & (points[:, 2] < to_m + 1.0)
    inner = np.hypot(points[:, 0] - place.x, points[:, 1] - place.y) <= _OVERHANG_M
    level = np.abs(points[:, 2] - place.z) <= 0.6
    below = {(int(x), int(y)) for x, y in np.floor(points[level, :2] / _OVERHANG_CELL_M)}
    stands = {(x + dx, y + dy) for x, y in below for dx in (-1, 0, 1) for dy in (-1, 0, 1)}
    above = [(int(x), int(y)) for x, y in np.floor(points[high & inner, :2] / _OVERHANG_CELL_M)]
    return sum(cell not in stands for cell in above) > _FEW


def _touches(a: Place, b: Place, looks: Sequence[Look], radius_m: float) -> Refusal | None:
    """Something that was shown lies within the radius of the leg, or a railing on a slab that the last look shows, or
    the last one with all cameras, and the leg comes nearer to it."""
    low, high = np.minimum(a, b) - radius_m, np.maximum(a, b) + radius_m
    for number, look in enumerate(looks):
        points = look.points[_inside(look.points, low, high)].astype(np.float64)
        hits = points[_nears(points, a, b, radius_m)]
        hits = hits[~_seen_through(hits, looks[number + 1 :])]
        if len(hits):
            return _too_near("something stands", hits[0], radius_m)
    all_cameras = max((len(look.views) for look in looks), default=0)
    whole = [look for look in looks if len(look.views) == all_cameras][-1:]
    in_part = [look for look in looks[-1:] if len(look.views) < all_cameras]
    for look in [*whole, *in_part]:
        railings = railings_on(look.slabs).astype(np.float64)
        railings = railings[_nears(railings, a, b, radius_m)]
        if len(railings):
            return _too_near("a railing that depth has missed may stand", railings[0], radius_m)
    return None


def _inside(points: Points, low: Floats, high: Floats) -> Bools:
    """(N,) of points (N, 3), those in the box."""
    return np.asarray(((points >= low) & (points <= high)).all(axis=1))


def _nears(points: Floats, a: Place, b: Place, radius_m: float) -> Bools:
    """(N,) of points (N, 3), those within the radius of the leg to which it comes nearer."""
    leg = np.subtract(b, a)
    gap = points - np.array(a)
    along = np.clip(gap @ leg / float(leg @ leg), 0.0, 1.0)
    nearest = np.linalg.norm(gap - along[:, None] * leg, axis=1)
    return np.asarray((nearest < radius_m) & (nearest < np.linalg.norm(gap, axis=1) - _COMES_NEARER_M))


def _too_near(what: str, at: Floats, radius_m: float) -> Refusal:
    said = f"{what} at ({at[0]:.1f}, {at[1]:.1f}, {at[2]:.1f}), nearer than {radius_m:.2f} m to the way"
    return Refusal("clearance", said, Place(*map(float, at)))


def _seen_through(points: Floats, later: Sequence[Look]) -> Bools:
    """(N,) what was there once, and a later look sees past: it has moved, or never was. A sensor that misses thin
    things misses a wire in every second look, so that several must see past."""
    seen_past = np.zeros(len(points), np.intp)
    for look in later:
        if not len(points):
            break
        eye = np.array((look.pose.x, look.pose.y, look.pose.z))
        ray = points - eye
        length = np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), _LIE_M)
        seen_past += looked_at(points + ray / length * _SEEN_THROUGH_M, look.views, look.pose) == FREE
    return np.asarray(seen_past >= (_LOOKS_PAST_THIN if any(look.misses_thin for look in later) else 1))


def _grazes(a: Place, b: Place, looks: Sequence[Look], flown: Floats, radius_m: float) -> Refusal | None:
    """A return hides the side of the drone's way: something reaches into it between the points that are kept."""
    leg = np.subtract(b, a)
    length = float(np.linalg.norm(leg))
    places = np.linspace(np.array(a), np.array(b), max(2, math.ceil(length / _STEP_M) + 1))
    places = places[np.linalg.norm(places - places[0], axis=1) > _BESIDE_M]
    places = places[~_near_flown(places, flown)]
    if not len(places):
        return None
    level = np.array((-leg[1], leg[0], 0.0)) / max(math.hypot(leg[0], leg[1]), _LIE_M)
    aside = level if math.hypot(leg[0], leg[1]) > _LIE_M else np.array((1.0, 0.0, 0.0))
    over = np.cross(leg / length, aside)
    for side in (aside, -aside, over, -over):
        beside = places + side * radius_m
        hidden = (_best(beside, looks) == HIDDEN) & (beside[:, 2] > GROUND_M)
        if hidden.any():
            at = beside[int(hidden.argmax())]
            said = f"something reaches into the way at ({at[0]:.1f}, {at[1]:.1f}, {at[2]:.1f})"
            return Refusal("clearance", said, Place(*map(float, at)))
    return None


def _unseen(a: Place, b: Place, looks: Sequence[Look], flown: Floats, *, first: bool) -> Refusal | None:
    """The leg leads where no look saw that it is free, and where the drone has not been."""
    count = max(2, math.ceil(math.dist(a, b) / _STEP_M) + 1)
    places = np.linspace(np.array(a), np.array(b), count)
    climbs = b.z - a.z > _STEEP and math.hypot(b.x - a.x, b.y - a.y) < _STEEP * (b.z - a.z)
    known = _near_flown(places, flown)
    if first and not climbs:
        known |= np.linalg.norm(places - places[0], axis=1) <= _BESIDE_M
    if not known.all():
        known[~known] = _best(places[~known], looks) == FREE
    if known.all():
        return None
    at = Place(*map(float, places[int(known.argmin())]))
    if climbs and column_is_open(at, b.z, looks):
        return None
    said = f"nobody has seen that ({at.x:.1f}, {at.y:.1f}, {at.z:.1f}) is free"
    return Refusal("unseen", f"something may hang over the drone: {said}" if climbs else said, at)


def _best(places: Floats, looks: Sequence[Look]) -> NDArray[np.int8]:
    """(N,) the best that any of the looks says."""
    found = np.zeros(len(places), np.int8)
    for look in reversed(looks):
        left = found < FREE
        if not left.any():
            break
        found[left] = np.maximum(found[left], looked_at(places[left], look.views, look.pose))
    return found


def _near_flown(places: Floats, flown: Floats) -> Bools:
    """(N,) within a hand's breadth of the way flown, a polyline."""
    near = np.zeros(len(places), bool)
    for a, b in pairwise(flown):
        leg = b - a
        along = np.clip((places - a) @ leg / max(float(leg @ leg), _LIE_M), 0.0, 1.0)
        near |= np.linalg.norm(places - a - along[:, None] * leg, axis=1) <= _FLOWN_M
    return near
