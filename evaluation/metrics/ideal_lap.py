"""The ideal lap: a lap with the map known and the target's facade unknown, as an upper bound for a search.

The side is a fair coin's. The lap is the shortest way round the building's footprint, grown by a clearance, until the
window comes into view, and from there to a stop before it. The mean over both sides is the SPL that a search which has
to see the window can reach; it is computed from the scene, without a flight.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Scene
from evaluation.task_set.shortest import goal_slot, obstacles
from evaluation.task_set.task import Task
from navigation.shortest_path import NoWay, VisibilityGraph

Floats = NDArray[np.float64]
Xy = tuple[float, float]

CLEARANCES_M = (1.85, 1.3, 0.8)
"""From the drone's centre: its radius and the search's clearance; less where the building stands too near others."""
IN_VIEW_M, IN_VIEW_DEG = 12.0, 65.0
STOP_M = 2.0
_SAMPLE_M = 1.0
_WALK_M = 0.25


class Window(NamedTuple):
    """A window on the ground plan: its middle, and the unit vector out of its wall; metres, ENU."""

    middle: Xy
    normal: Xy

    @property
    def stop(self) -> Xy:
        """Where a delivery ends: straight before it."""
        return self.middle[0] + STOP_M * self.normal[0], self.middle[1] + STOP_M * self.normal[1]


class Laps(NamedTuple):
    """Metres from the start to the window, setting out with the building on the left (`counterclockwise`, seen from
    above) and on the right; inf where neighbours leave no way."""

    counterclockwise_m: float
    clockwise_m: float


class _Plan(NamedTuple):
    graph: VisibilityGraph
    sight: VisibilityGraph
    window: Window


def ideal_lap_spl(tasks: Iterable[Task]) -> float | None:
    """The mean over the tasks of the mean over both sides of L / max(lap, L), 0..1; null without tasks. Tasks whose
    object is not there are left out."""
    worth = [ideal_worth(task) for task in tasks if not task.absent]
    return sum(worth) / len(worth) if worth else None


def ideal_worth(task: Task) -> float:
    """One task's term of the ideal lap's SPL: L is the task's shortest way, as in SPL."""
    return worth_of(laps_of(task.scene), task.shortest_horizontal_m)


def worth_of(laps: Laps, shortest_m: float) -> float:
    """The mean of both sides; of one where neighbours close the other, which the map shows beforehand."""
    ways = [lap for lap in laps if math.isfinite(lap)]
    return sum(shortest_m / max(lap, shortest_m) if lap > 0 else 1.0 for lap in ways) / len(ways) if ways else 0.0


def laps(
    footprint: Sequence[Xy], neighbours: Sequence[Sequence[Xy]], start: Xy, window: Window, clearance_m: float
) -> Laps:
    """Both ways. footprint: corners, counter-clockwise; `clearance_m` is kept from all walls."""
    solid = [footprint, *neighbours]
    plan = _Plan(VisibilityGraph(solid, clearance_m), VisibilityGraph(solid, 0.0), window)
    here = np.array(start)
    if _in_view(plan, here[None])[0]:
        direct = _rest_m(plan, start)
        return Laps(direct, direct)
    ring = _ring(np.array(footprint, np.float64), clearance_m, plan.graph)
    if not len(ring):
        return Laps(math.inf, math.inf)
    foot = int(np.hypot(*(ring - here).T).argmin())
    onward = np.roll(ring, -foot, axis=0)
    back = np.concatenate((onward[:1], onward[:0:-1]))
    # counter-clockwise along the footprint has the building on the left
    return Laps(_lap_m(plan, here, onward), _lap_m(plan, here, back))


@lru_cache(maxsize=4096)
def laps_of(scene: Scene) -> Laps:
    """Of a scene with a goal at a window, at the height of its floor; with as much clearance as leaves both sides
    open. Raises ValueError where the goal stands at no window."""
    slot = goal_slot(scene)
    footprint, *neighbours = obstacles(scene, slot)
    start = (scene.start.position.x, scene.start.position.y)
    found = Laps(math.inf, math.inf)
    for clearance_m in CLEARANCES_M:
        again = laps(footprint, neighbours, start, Window(slot.centre[:2], slot.normal), clearance_m)
        if sum(map(math.isfinite, again)) > sum(map(math.isfinite, found)):
            found = again
        if all(map(math.isfinite, found)):
            break
    return found


def _ring(outline: Floats, clearance_m: float, graph: VisibilityGraph) -> Floats:
    """(N, 2) the outline of the grown footprint, counter-clockwise, a place every metre; without those that lie too
    near another wall."""
    places: list[Floats] = []
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    grown = clearance_m + 1e-4
    for a, b, c in zip(before, outline, after, strict=True):
        first = math.atan2(*(b - a)[::-1]) - math.pi / 2
        turn = math.remainder(math.atan2(*(c - b)[::-1]) - math.pi / 2 - first, math.tau)
        if turn > 0:
            angles = first + np.linspace(0.0, turn, max(2, math.ceil(turn / math.radians(15.0))) + 1)
            # the chords of an arc cut in; a little more room keeps them outside
            reach = grown / math.cos(math.radians(7.5))
            places.append(b + reach * np.stack((np.cos(angles), np.sin(angles)), axis=1))
        along = c - b
        length = float(np.hypot(*along))
        out = np.array((along[1], -along[0])) / length
        share = np.linspace(0.0, 1.0, max(2, math.ceil(length / _SAMPLE_M)) + 1)[:, None]
        places.append(b + share * along + grown * out)
    ring = np.concatenate(places)
    return ring[graph.clear_places(ring)]


def _lap_m(plan: _Plan, here: Floats, ring: Floats) -> float:
    """From `here` along the ring, in its order, until the window comes into view, and to it."""
    seen = _in_view(plan, ring)
    last = int(seen.argmax()) if seen.any() else _nearest(ring, np.array(plan.window.middle))
    way = _taut(plan.graph, here, ring, last)
    if way is None:
        return math.inf
    flown = 0.0
    for a, b in pairwise(way):
        length = float(np.hypot(*(b - a)))
        share = np.linspace(0.0, 1.0, max(1, math.ceil(length / _WALK_M)) + 1)
        places = a + share[:, None] * (b - a)
        in_view = _in_view(plan, places)
        if in_view.any():
            at = int(in_view.argmax())
            place = (float(places[at, 0]), float(places[at, 1]))
            return flown + float(share[at]) * length + _rest_m(plan, place)
        flown += length
    return flown + _rest_m(plan, (float(way[-1][0]), float(way[-1][1])))


def _taut(graph: VisibilityGraph, here: Floats, ring: Floats, last: int) -> list[Floats] | None:
    """The shortest way from `here` past the ring's places in their order to its place `last`. No leg spans more than
    half the ring, so that none goes round the other way; None where the ring is cut."""
    places = np.concatenate((here[None], ring[: last + 1]))
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))))
    round_m = float(gone[-1]) + math.dist(ring[-1], ring[0])
    along = np.concatenate(([0.0], gone[: last + 1]))
    i, j = np.triu_indices(len(places), 1)
    short = along[j] - along[i] <= round_m / 2
    i, j = i[short], j[short]
    clear = graph.clear_legs(places[i], places[j])
    i, j = i[clear], j[clear]
    length = np.hypot(*(places[j] - places[i]).T)
    best = np.full(len(places), np.inf)
    best[0] = 0.0
    before = np.full(len(places), -1)
    for k in range(1, len(places)):
        mine = np.flatnonzero(j == k)
        if not len(mine):
            continue
        total = best[i[mine]] + length[mine]
        at = int(total.argmin())
        best[k], before[k] = total[at], i[mine][at]
    if not np.isfinite(best[-1]):
        return None
    order = [len(places) - 1]
    while order[-1] != 0:
        order.append(int(before[order[-1]]))
    return [places[k] for k in reversed(order)]


def _rest_m(plan: _Plan, place: Xy) -> float:
    """The shortest way from a place to the stop before the window."""
    found = plan.graph.route(place, plan.window.stop)
    return math.inf if isinstance(found, NoWay) else found.length_m


def _in_view(plan: _Plan, places: Floats) -> NDArray[np.bool_]:
    """(N,) is the window near enough, not too slantwise, and nothing before it?"""
    normal = np.array(plan.window.normal)
    pane = np.array(plan.window.middle) + 0.05 * normal
    gap = places - pane
    away = np.hypot(gap[:, 0], gap[:, 1])
    good: NDArray[np.bool_] = (away <= IN_VIEW_M) & (gap @ normal > away * math.cos(math.radians(IN_VIEW_DEG)))
    at = np.flatnonzero(good)
    good[at] = plan.sight.clear_legs(places[at], np.broadcast_to(pane, (len(at), 2)))
    return good


def _nearest(ring: Floats, place: Floats) -> int:
    return int(np.hypot(*(ring - place).T).argmin())
