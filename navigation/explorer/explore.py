"""One step of the search: what the cameras see now goes into the map, and out comes the next stop."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import DepthView, Pose, seen_aside_deg, wrap_radians
from navigation.explorer import facade, frontier, path
from navigation.explorer.facade import Seed
from navigation.explorer.goal import Decision, Goal, Room, choose_goal, next_stop
from navigation.explorer.map import Map, carve, draw_hits, empty_map, middles_of
from navigation.explorer.parameters import ExplorerParameters
from navigation.explorer.scan import Scan, panorama
from navigation.keep_out import Volume, at_height
from navigation.point_cloud import Points, nearby_cloud, thinned

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Cells = NDArray[np.intp]

CUT_OFF, CUT_ON, CUT_LIFTED = 0, 1, 2
_CUT_ASIDE_M = 2.5
_CUT_HALF_WIDTH_M = 1.25
_ARRIVED_M = 1.5
_EDGE_DEG = 5.0
"""What lies so near to the edge of what a look sees is not counted on."""
_BLIND_SHARE = 0.05
"""A panorama of which less is known shows nothing: the drone stays where it is."""
_PATIENCE = 4
_FINE_PX = 600
_MOST_PLANS = 8
_REACH_SHARE = 0.9
_LEAST_PATCH_M = 1.0
_WIDE_BERTH_COST = 6.0


class NoFacade(ValueError):
    """No wall ahead to begin with."""


class Memory(NamedTuple):
    """What one step hands to the next. `cut`: whether the line out of the first facade may be crossed; `relaxed`: how
    often given-up pieces were taken up again; `stuck`: steps in a row without a move; `stop`: where the last step
    sent the drone, None where nowhere."""

    map: Map
    seed: Seed
    cut: int = CUT_OFF
    relaxed: int = 0
    stuck: int = 0
    steps: int = 0
    stop: tuple[float, float] | None = None


class Now(NamedTuple):
    """What this step has: the scan, the target building's cells, the returns about the drone (nose frame), and how far
    to either side of the nose a look sees, degrees. `views`: for the sight along a way. `keep_out`: cells that may not
    be flown into."""

    scan: Scan
    target: Bools
    near: Points
    views: Sequence[DepthView]
    aside_deg: float
    keep_out: Bools


class Step(NamedTuple):
    """`inspected_share`: of the facade known or expected so far. `target`: the target building's cells; `seen`: those
    of them that count as inspected."""

    decision: Decision
    memory: Memory
    inspected_share: float
    target: Bools
    seen: Bools


def explore(
    memory: Memory | None,
    views: Sequence[DepthView],
    pose: Pose,
    settings: ExplorerParameters,
    box_deg: tuple[float, float] = (-25.0, 25.0),
    keep_out: Sequence[Volume] = (),
) -> Step:
    """The next stop. `memory` is None at the first call, `pose` the measured pose the views were taken at; `box_deg`
    are the bearings between which the target lies at the first call. Level views make the map, all of them tell where
    there is room. No way leads into what is to be kept out of (`keep_out`).

    Raises NoFacade where the first call has no wall in front of it.
    """
    views = [thinned(view, _FINE_PX) for view in views]
    settings = _for_sensor(settings, views)
    scan = panorama(views, pose, settings.band_m, settings.body_band_m)
    walls = facade.read_walls(scan, settings)
    if memory is None:
        seed = facade.find_seed(scan, walls, box_deg)
        if seed is None:
            raise NoFacade("no wall within 25 m of the drone: the search starts in front of the building")
        memory = Memory(empty_map(pose.x, pose.y), seed)
    grid = memory.map.copy()
    carve(grid, scan)
    draw_hits(grid, scan, walls.run, walls.normal, walls.good, settings.map_range_m)
    target = facade.target_cells(grid, memory.seed)
    _count_attempts(grid, memory, pose)
    frontier.expect(grid, scan, walls, target, settings)
    memory = memory._replace(map=grid, steps=memory.steps + 1, cut=_cut_now(memory, pose))
    seen = facade.seen_cells(grid, target, settings)
    if scan.known_share < _BLIND_SHARE:
        stay = Decision("turn", "the cameras show nothing", (pose.x, pose.y), 0.0, 0.0, pose.yaw)
        return Step(stay, memory._replace(stop=None), facade.inspected_share(grid, target, seen), target, seen)
    body = settings.drone_radius_m + settings.clearance_m
    near = nearby_cloud(views, settings.l_max_m + body, body, pose.z)
    aside = seen_aside_deg([view.camera for view in views])
    kept_out = path.cells_within(grid, at_height(keep_out, pose.z, body))
    decision, memory = _decide(memory, Now(scan, target, near, views, aside, kept_out), settings)
    return Step(decision, memory, facade.inspected_share(grid, target, seen), target, seen)


def _for_sensor(settings: ExplorerParameters, views: Sequence[DepthView]) -> ExplorerParameters:
    """What the sensor does not reach can't be planned to be seen."""
    reach_m = min((view.reach_m for view in views), default=math.inf)
    return settings._replace(inspect_range_m=min(settings.inspect_range_m, _REACH_SHARE * reach_m))


def _count_attempts(grid: Map, memory: Memory, pose: Pose) -> None:
    """A stop that was reached and did not show what it was flown to for counts against those cells."""
    if memory.stop is not None and math.dist(memory.stop, (pose.x, pose.y)) <= _ARRIVED_M:
        missed = grid.awaited & ~grid.inspected
        grid.attempts[missed] = np.minimum(grid.attempts[missed] + 1, 3)
    grid.awaited[:] = False


def _cut_now(memory: Memory, pose: Pose) -> int:
    """Once the drone has left the line out of the first facade sideways, it does not come back over it."""
    if memory.cut != CUT_OFF:
        return memory.cut
    dx, dy = pose.x - memory.seed.x, pose.y - memory.seed.y
    aside = abs(dx * memory.seed.normal[1] - dy * memory.seed.normal[0])
    return CUT_ON if aside > _CUT_ASIDE_M else CUT_OFF


def _decide(memory: Memory, now: Now, settings: ExplorerParameters) -> tuple[Decision, Memory]:
    """The goal, and the stop on the way to it. Where nothing useful can be reached, or only by a long way round the
    cut's end, the cut is lifted first; then given-up pieces are taken up again, then the search is done."""
    pose, grid, target = now.scan.pose, memory.map, now.target
    room = Room(now.near, now.views)
    clear, walls = path.clearance_m(grid, now.keep_out), _cut_cells(memory, settings)
    for _ in range(_MOST_PLANS):
        # when all that matters is seen, the little pieces get their look as well
        left = facade.unseen(grid, target, settings, _LEAST_PATCH_M if memory.relaxed else None)
        goal = choose_goal(grid, left, clear, walls, pose, settings) if left.any() else None
        if goal is not None and memory.cut == CUT_ON and goal.way_m > settings.detour_m:
            across = choose_goal(grid, left, clear, np.zeros_like(walls), pose, settings)
            if across is not None and across.way_m < goal.way_m - settings.detour_m:
                goal, memory, walls = across, memory._replace(cut=CUT_LIFTED), np.zeros_like(walls)
        if goal is not None:
            decision = next_stop(grid, goal, clear, walls, pose, room, settings)
            if decision is None:  # something sticks out close by: first away from it, then on
                wide = choose_goal(grid, left, clear, walls, pose, settings, _WIDE_BERTH_COST)
                decision = None if wide is None else next_stop(grid, wide, clear, walls, pose, room, settings)
            if decision is not None:
                return _await(memory, decision, left, now, settings)
            if memory.stuck < _PATIENCE and (turn := _turn(memory, goal, left, now, settings)) is not None:
                return turn
            grid.attempts[left & path.near_cells(goal.way[-1], grid, settings.inspect_range_m)] = settings.attempts
            grid.expected[grid.attempts > 0] = False
            memory = memory._replace(stuck=0)
            continue
        if memory.cut == CUT_ON:
            memory = memory._replace(cut=CUT_LIFTED)
            walls = _cut_cells(memory, settings)
        elif memory.relaxed < settings.relax_rounds:
            grid.attempts[target] = 0
            frontier.expect_openings(grid, target, settings)
            memory = memory._replace(relaxed=memory.relaxed + 1)
        else:
            over = bool((facade.seen_cells(grid, target, settings) == target).all()) and not grid.expected.any()
            why = "all of the facade was inspected" if over else "what is left of the facade can't be reached or seen"
            stay = Decision("done", why, (pose.x, pose.y), 0.0, 0.0, pose.yaw)
            return stay, memory._replace(stop=None)
    around = wrap_radians(pose.yaw + math.pi / 2)
    stay = Decision("turn", "nothing found so far can be reached", (pose.x, pose.y), 0.0, 0.0, around)
    return stay, memory._replace(stop=None)


def _turn(
    memory: Memory, goal: Goal, left: Bools, now: Now, settings: ExplorerParameters
) -> tuple[Decision, Memory] | None:
    """On the spot: towards what can be seen from here, or along the way whose beginning is not seen to be free. None
    where the drone faces that way already."""
    pose = now.scan.pose
    gap = goal.way[-1] - (pose.x, pose.y)
    here = Decision("turn", "the next piece lies behind", (pose.x, pose.y), 0.0, 0.0, pose.yaw, goal.gain_m)
    if np.hypot(*gap) < settings.min_move_m:
        decision, after = _await(memory, here, left, now, settings)
    else:
        yaw = math.atan2(goal.way[0, 1] - pose.y, goal.way[0, 0] - pose.x)
        why = "no free way is seen towards the next piece"
        decision, after = here._replace(yaw=yaw, reason=why), memory._replace(stop=None)
    if abs(wrap_radians(decision.yaw - pose.yaw)) < math.radians(20.0):
        memory.map.awaited[:] = False
        return None
    return decision, after._replace(stuck=memory.stuck + 1)


def _cut_cells(memory: Memory, settings: ExplorerParameters) -> Bools:
    grid, seed = memory.map, memory.seed
    if memory.cut != CUT_ON:
        return np.zeros_like(grid.inspected)
    return path.wall_from(grid, seed.x, seed.y, seed.normal, settings.cut_m, _CUT_HALF_WIDTH_M)


def _await(
    memory: Memory, decision: Decision, left: Bools, now: Now, settings: ExplorerParameters
) -> tuple[Decision, Memory]:
    """Which pieces that stop should show, and the yaw that shows them: towards their middle, else along the way."""
    grid = memory.map
    pieces = np.flatnonzero(left.reshape(-1))
    stop = np.array([decision.place])
    seen = path.sees(grid, stop, pieces, settings.plan_range_m, settings.plan_incidence_deg)[0]
    yaw = decision.yaw
    if seen.any():
        gap = middles_of(grid, pieces[seen]) - stop
        middle = gap.mean(axis=0)
        if np.hypot(*middle) > 0.5:
            yaw = math.atan2(middle[1], middle[0])
        bearing = np.mod(np.arctan2(gap[:, 1], gap[:, 0]) - yaw + math.pi, math.tau) - math.pi
        shown = pieces[seen][np.abs(bearing) < math.radians(now.aside_deg - _EDGE_DEG)]
        grid.awaited.reshape(-1)[shown] = True
    return decision._replace(yaw=yaw), memory._replace(stuck=0, stop=decision.place)
