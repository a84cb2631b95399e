"""The goal of one step, and the stop on the way to it."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation import safe_distance
from navigation.camera import DepthView, Pose
from navigation.explorer import path
from navigation.explorer.map import Cells, Map, cells_of, middles_of
from navigation.explorer.parameters import ExplorerParameters
from navigation.point_cloud import Points
from navigation.sensing import HIDDEN, UNKNOWN, looked_at

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Status = Literal["move", "turn", "done"]

_RINGS_M = (25.0, 60.0, 160.0)
_BEYOND_FIRST_M = 6.0
_MOST_PARTS = 4
_SIGHT_STEP_M = 0.5


class Goal(NamedTuple):
    """`way` (N, 2): ENU plan points to the place that shows `gain_m` of facade, `way_m` of cost away."""

    way: Floats
    gain_m: float
    way_m: float


class Room(NamedTuple):
    """What the views at hand show about the drone: the returns near it (nose frame), and the views themselves."""

    near: Points
    views: Sequence[DepthView]


class Decision(NamedTuple):
    """`move`: fly level to `place`, `distance_m` away at `bearing_deg` (right of the nose), and turn to `yaw`;
    `turn`: only turn to `yaw`; `done`: nothing is left that can be reached and seen. `gain_m`: facade that the place
    the drone is on its way to shows; `way_m`: how far that is, along `way`."""

    status: Status
    reason: str
    place: tuple[float, float]
    bearing_deg: float
    distance_m: float
    yaw: float
    gain_m: float = 0.0
    way_m: float = 0.0
    way: tuple[tuple[float, float], ...] = ()


def choose_goal(
    grid: Map,
    left: Bools,
    clear: Floats,
    walls: Bools,
    pose: Pose,
    settings: ExplorerParameters,
    tight_cost: float = 1.0,
) -> Goal | None:
    """The place with the best gain / (way + bias) of those that see the piece of facade that is reached cheapest:
    nothing is left behind. `tight_cost`: of a metre with little room beside the drone. None where no place that can be
    reached sees anything."""
    here = np.array((pose.x, pose.y))
    room = path.Room(settings.way_clearance_m, settings.tight_way_clearance_m, settings.unknown_cost, tight_cost)
    cost = path.lattice_costs(grid, clear, walls, here, room)
    pieces = np.flatnonzero(left.reshape(-1))
    each = max(1, math.ceil(len(pieces) / path.MAX_PIECES))
    pieces = pieces[::each]
    useful = path.near_nodes(left, settings.plan_range_m)
    start = int(path.nodes_of(grid, here[None])[0])
    for limit in _RINGS_M:
        reach = path.spread(cost, start, limit)
        found = _best_place(grid, reach, useful, pieces, each, clear, here, settings)
        if found is not None:
            return found
        if np.isinf(reach.cost_m).sum() == 0 or not (reach.cost_m[np.isfinite(reach.cost_m)] > limit - 4.0).any():
            return None  # everything that can be reached has been looked at
    return None


def pick(score: Floats, worth: Floats, seen: Bools) -> int:
    """Which place: score (P,) is gain / price, negative where the nearest piece is not seen; `worth` (P,) the same
    whatever is seen, seen (P, U) which pieces. The study of ties puts other choices in its place."""
    return int(score.argmax())


def _best_place(
    grid: Map,
    reach: path.Reach,
    useful: Bools,
    pieces: Cells,
    each: int,
    clear: Floats,
    here: Floats,
    settings: ExplorerParameters,
) -> Goal | None:
    nodes = np.flatnonzero(useful & np.isfinite(reach.cost_m))
    nodes = nodes[np.argsort(reach.cost_m[nodes], kind="stable")]
    kept_nodes: list[Cells] = []
    kept_seen: list[Bools] = []
    first: float | None = None
    for at in range(0, len(nodes), path.MAX_PLACES):
        part = nodes[at : at + path.MAX_PLACES]
        if first is not None:
            part = part[reach.cost_m[part] <= first + _BEYOND_FIRST_M]
            if not len(part):
                break
        places = path.places_of(grid, part)
        seen = path.sees(grid, places, pieces, settings.plan_range_m, settings.plan_incidence_deg)
        any_seen = seen.any(axis=1)
        if any_seen.any():
            if first is None:
                first = float(reach.cost_m[part[any_seen.argmax()]])
            kept_nodes.append(part[any_seen])
            kept_seen.append(seen[any_seen])
        if len(kept_nodes) >= _MOST_PARTS:
            break
    if first is None:
        return None
    place, seen = np.concatenate(kept_nodes), np.concatenate(kept_seen)
    cost = reach.cost_m[place]
    within = cost <= first + _BEYOND_FIRST_M
    place, seen, cost = place[within], seen[within], cost[within]
    gain = np.minimum(seen.sum(axis=1) * 0.5 * each, settings.gain_cap_m)
    worth = gain >= min(settings.min_gain_m, float(gain.max()))
    place, seen, cost, gain = place[worth], seen[worth], cost[worth], gain[worth]
    away = middles_of(grid, pieces[seen[0]]) - path.places_of(grid, place[:1])
    nearest = np.flatnonzero(seen[0])[np.hypot(away[:, 0], away[:, 1]).argmin()]
    off = clear.reshape(-1)[cells_of(grid, path.places_of(grid, place))] - settings.way_clearance_m
    price = cost + settings.stand_off_cost * np.clip(off, 0.0, settings.inspect_range_m) + settings.gain_bias_m
    worth_m = gain / price
    best = pick(np.where(seen[:, nearest], worth_m, -1.0), worth_m, seen)
    way = path.way_to(grid, reach, int(place[best]))
    if not len(way):
        way = path.places_of(grid, place[best : best + 1])
    return Goal(way, float(gain[best]), float(cost[best]))


def next_stop(
    grid: Map, goal: Goal, clear: Floats, walls: Bools, pose: Pose, room: Room, settings: ExplorerParameters
) -> Decision | None:
    """The farthest point of the way that a straight flight through known free cells reaches, and that the views at hand
    show to be free for the whole body, as far as they look there; with less clearance where there is none such."""
    near = room.near
    here = np.array((pose.x, pose.y))
    gap = goal.way - here
    length = np.hypot(gap[:, 0], gap[:, 1])
    body = safe_distance.SafeDistanceParameters(
        variant="corridor",
        l_max_m=settings.l_max_m,
        drone_radius_m=settings.drone_radius_m,
        clearance_m=settings.clearance_m,
        tight_clearance_m=min(0.5, settings.tight_clearance_m),
        sensor_range_m=settings.sensor_range_m,
    )
    radius = safe_distance.body_radius_m(near, body)
    tight = min(radius, settings.drone_radius_m + min(0.85, settings.clearance_m))
    kinds = ((radius, settings.way_clearance_m - 0.35), (tight, settings.tight_way_clearance_m - 0.1))
    for body_m, need_m in kinds:
        for at in range(len(goal.way) - 1, -1, -1):
            if not settings.min_move_m <= length[at] <= settings.l_max_m:
                continue
            end = goal.way[at]
            if not path.is_known_free(grid, clear, walls, here, end, need_m):
                continue
            bearing = math.degrees(pose.yaw - math.atan2(gap[at, 1], gap[at, 0]))
            bearing = math.remainder(bearing, 360.0)
            free = safe_distance.corridor(near, bearing, body_m, settings.l_max_m).distance_m
            if free >= length[at] - 1e-6 and _in_sight(room.views, pose, end):
                return Decision(
                    "move",
                    "towards the best view of uninspected facade",
                    (float(end[0]), float(end[1])),
                    bearing,
                    float(length[at]),
                    math.atan2(gap[at, 1], gap[at, 0]),
                    goal.gain_m,
                    goal.way_m,
                    tuple((float(x), float(y)) for x, y in goal.way),
                )
    return None


def _in_sight(views: Sequence[DepthView], pose: Pose, end: Floats) -> bool:
    """Does no camera that looks along the straight way to `end` find it unknown? Where none looks, the map tells."""
    gap = end - (pose.x, pose.y)
    share = np.linspace(0.0, 1.0, max(2, math.ceil(float(np.hypot(*gap)) / _SIGHT_STEP_M) + 1))[1:]
    places = np.array((pose.x, pose.y, pose.z)) + share[:, None] * np.array((*gap, 0.0))
    found = looked_at(places, views, pose)
    return not ((found == UNKNOWN) | (found == HIDDEN)).any()
