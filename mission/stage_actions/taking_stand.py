"""The beginning of a flight that can be trusted: find the building, stand square before it, neither too near nor too
far, where nothing hangs over the drone. No model is asked; every flight of it is short, seen to be free, and level or
up to the least height."""

import math
from collections.abc import Sequence

from contracts.event_data import NoData
from mission.looks import Look
from mission.places import ahead
from mission.stage_actions.looking import ALL_ROUND_DEG, look_aside
from mission.stages import MeasureStandOff, TakeStand
from mission.step import MissionEnd, Step
from navigation.camera import DepthView, Place, Pose, wrap_radians
from navigation.sensing import read_views
from navigation.stance import StandOff, Wall, free_way_m, wall_ahead, walls_about

MAX_MOVES = 14
SQUARE_RAD = math.radians(10.0)
FAR_AHEAD_M = 20.0
"""A wall ahead so far off may be another house than the one at whose foot the drone stands."""
AT_FOOT_M = 12.0
BESIDE_LENGTH_M = 3.0
"""A tree crown of which only the nearest part is within the sensor's reach looks as flat as a shorter wall."""
BESIDE_RAD = math.radians(75.0)
"""A wall turned farther off the nose is another house, as long as the one ahead or behind may be out of sight."""
NO_BUILDING_RAD = math.radians(50.0)
LEAST_MOVE_M = 0.7
LONGEST_MOVE_M = 8.0
BODY_M = 0.85
SHORT_SIGHT_M = 30.0
ABOVE_LOWEST_M = 0.3
"""Where a drone sinks from move to move, it keeps so much above what the guard still lets happen."""
ONWARD_DEG = (0.0, -15.0, 15.0, -30.0, 30.0)
ASIDE_M = (3.0, 5.0, 7.0)
ASIDE_SLACK_M = 3.0
"""So much farther off than usual is better than under what hangs nearer to the facade."""
UP_SHARE = 0.85
"""A level camera sees up as far as it sees away, at the picture's edge."""


async def take_stand(step: Step, stage: TakeStand) -> TakeStand | MeasureStandOff:
    """One look, and at most one short flight. Raises MissionEnd (no_building) where none is found; PortError."""
    look = await look_aside(step, ALL_ROUND_DEG, asks=False)
    if look is None:
        return stage
    if stage.moves >= MAX_MOVES:
        return _begin(step)
    views, pose = _read(step, look), _pose(look)
    if stage.backs_off_m > 0.0:
        return _back_off(step, stage, views, pose)
    walls = [wall for wall in walls_about(views, pose) if not _is_no_building(step, wall)]
    facing = wall_ahead(walls)
    if stage.moves == 0 and not step.state.no_building:
        step.update(at_foot=facing is not None and facing.nearest_m <= AT_FOOT_M)
    if facing is None and stage.moves == 0:
        _remark(step, "no building stood ahead of the drone where it began, so it looked about for one")
    if facing is None or facing.nearest_m > FAR_AHEAD_M:
        found = _elsewhere(step, stage, walls, facing, pose)
        if found is not None:
            return found
        if facing is None:
            return _nearer(step, stage, views, pose)
    off = wrap_radians(facing.facing_yaw - pose.yaw)
    if abs(off) > SQUARE_RAD:
        # from far off a wall is seen too coarsely to turn by: nearer first, where that is free
        far = facing.nearest_m > AT_FOOT_M
        nearer = _towards(step, stage, views, pose, facing.nearest_m, AT_FOOT_M - 1.0) if far else None
        if nearer is not None:
            return nearer
        step.plan_flight((), facing.facing_yaw, "turn square to the facade")
        return _turned(stage, pose)
    goal_m = _goal_m(step, stage, facing)
    moved = None if goal_m is None else _towards(step, stage, views, pose, facing.distance_m, goal_m)
    return moved or _under_open_sky(step, stage, views, pose, facing)


def _elsewhere(
    step: Step, stage: TakeStand, walls: Sequence[Wall], facing: Wall | None, pose: Pose
) -> TakeStand | None:
    """Nothing ahead, or only far off: the building may be aside or behind. Null where what is ahead is the best."""
    beside = None if stage.turned_back else next((wall for wall in walls if _is_beside(wall, pose)), None)
    if beside is None and facing is None and _has_looked_about(stage) and _reach_m(step) > SHORT_SIGHT_M:
        beside = next(iter(walls), None)
    if beside is not None and beside is not facing:
        step.plan_flight((), beside.facing_yaw, "turn to the building")
        return _turned(stage, pose)
    ahead_m = facing.nearest_m if facing is not None else None
    if not stage.looked_behind:
        step.plan_flight((), pose.yaw + math.pi, "no building close ahead: look behind")
        return _next(stage, looked_behind=True, first_yaw=pose.yaw, first_m=ahead_m, behind=True)
    if stage.first_yaw is not None and (ahead_m is None or (stage.first_m or math.inf) < ahead_m):
        step.plan_flight((), stage.first_yaw, "nothing nearer behind: back to where the drone looked first")
        return _next(stage, first_yaw=None, first_m=None, behind=False, turned_back=True)
    return None


def _is_no_building(step: Step, wall: Wall) -> bool:
    """Was it counted before, and had no floor?"""
    known = step.state.no_building
    return wall.nearest_m <= AT_FOOT_M and any(
        abs(wrap_radians(wall.facing_yaw - yaw)) <= NO_BUILDING_RAD for yaw in known
    )


def _is_beside(wall: Wall, pose: Pose) -> bool:
    """Does it stand at the drone's side, near enough and long enough for a house at whose foot the drone may be? Past
    the end of one that it is square to already there is nothing to turn to."""
    off_rad = abs(wrap_radians(wall.facing_yaw - pose.yaw))
    return wall.nearest_m <= AT_FOOT_M and wall.length_m >= BESIDE_LENGTH_M and SQUARE_RAD < off_rad <= BESIDE_RAD


def _has_looked_about(stage: TakeStand) -> bool:
    """Behind, and back where the drone looked first."""
    return stage.looked_behind and stage.first_yaw is None


def _nearer(step: Step, stage: TakeStand, views: Sequence[DepthView], pose: Pose) -> TakeStand:
    """Nothing within the sensor's reach: where that is short, on along the nose, or beside where that is not seen to be
    free: a hole in the depth straight ahead hides the whole way. Raises MissionEnd (no_building)."""
    reach_m = _reach_m(step)
    far_m = min(LONGEST_MOVE_M, 0.6 * reach_m)
    ways = [(free_way_m(views, pose.z, bearing_deg, far_m, BODY_M), bearing_deg) for bearing_deg in ONWARD_DEG]
    free_m, bearing_deg = max(ways, key=lambda way: way[0])  # of equals the first, straight on
    if reach_m > SHORT_SIGHT_M or free_m < LEAST_MOVE_M:
        raise MissionEnd("no_building", "no building stands about the drone, as far as its cameras see")
    _fly(step, free_m, bearing_deg, None, "no building within the cameras' reach: on ahead")
    return _next(stage, turned_back=False)


def _goal_m(step: Step, stage: TakeStand, facing: Wall) -> float | None:
    """How far from the facade to fly to; None where the drone stands well, or no nearer than what it has moved away
    from under allows."""
    more_m = ASIDE_SLACK_M if stage.aside else 0.0
    return StandOff.within(_reach_m(step)).goal_m(facing.distance_m, more_m)


def _towards(
    step: Step, stage: TakeStand, views: Sequence[DepthView], pose: Pose, distance_m: float, goal_m: float
) -> TakeStand | None:
    """Nearer to the facade, or away from it; null where the way is not free."""
    if distance_m > StandOff.within(_reach_m(step)).far_m:
        _remark(step, f"the drone began {distance_m:.0f} m from the building, too far off for its sensors")
    if goal_m < distance_m:
        free_m = free_way_m(views, pose.z, 0.0, min(LONGEST_MOVE_M, distance_m - goal_m), BODY_M)
        if free_m < LEAST_MOVE_M:
            return None
        _fly(step, free_m, 0.0, pose.yaw, f"{distance_m:.0f} m is too far from the facade: nearer")
        return _next(stage)
    _remark(step, f"the drone began {distance_m:.1f} m from the building, too near to see its floors")
    step.plan_flight((), pose.yaw + math.pi, f"{distance_m:.1f} m is too near to the facade: look for the way back")
    return _next(stage, backs_off_m=goal_m - distance_m)


def _back_off(step: Step, stage: TakeStand, views: Sequence[DepthView], pose: Pose) -> TakeStand:
    """Turned away from the facade: as far as the way is free, and turned back to it."""
    free_m = free_way_m(views, pose.z, 0.0, stage.backs_off_m, min(BODY_M, 0.7))
    if free_m < LEAST_MOVE_M:
        step.plan_flight((), pose.yaw + math.pi, "the way back is not free")
        return _next(stage, backs_off_m=0.0, moves=MAX_MOVES)
    _fly(step, free_m, 0.0, pose.yaw + math.pi, f"{free_m:.1f} m away from the facade")
    return _next(stage, backs_off_m=0.0)


def _under_open_sky(
    step: Step, stage: TakeStand, views: Sequence[DepthView], pose: Pose, facing: Wall
) -> TakeStand | MeasureStandOff:
    """On to the climb, or first to a place beside it over which nothing hangs."""
    vehicle = step.drone.vehicle
    to_m = min(pose.z + facing.distance_m, vehicle.ceiling_m)
    if vehicle.column_is_open(Place(pose.x, pose.y, pose.z), to_m):
        return _begin(step)
    for away_m in ASIDE_M:
        for bearing_deg in (-90.0, 90.0, -60.0, 60.0, -120.0, 120.0, -30.0, 30.0):
            if free_way_m(views, pose.z, bearing_deg, away_m, BODY_M) < away_m - 1e-6:
                continue
            place = ahead(step.pose, bearing_deg, away_m)
            over_m = min(to_m, pose.z + UP_SHARE * away_m)
            if vehicle.column_looks_open(Place(place.x, place.y, place.z), over_m):
                _fly(step, away_m, bearing_deg, pose.yaw, "something hangs over the drone: aside")
                return _next(stage, aside=True)
    return _begin(step, "something hangs over the drone, and nowhere beside it is the sky seen to be open")


def _begin(step: Step, remark: str | None = None) -> MeasureStandOff:
    if remark is not None:
        step.write(remark, NoData())
    return MeasureStandOff()


def _remark(step: Step, said: str) -> None:
    """What is amiss where the drone begins, once, for the customer."""
    if step.state.start_remark is None:
        step.update(start_remark=said)
        step.write(said, NoData())


def _fly(step: Step, length_m: float, bearing_deg: float, yaw: float | None, why: str) -> None:
    place = ahead(step.pose, bearing_deg, length_m)
    lowest_m = step.drone.vehicle.limits.min_height_m + ABOVE_LOWEST_M
    path = (place if place.z >= lowest_m else place.model_copy(update={"z": lowest_m}),)
    step.plan_flight(path, yaw if yaw is not None else step.pose.yaw, why)


def _turned(stage: TakeStand, pose: Pose) -> TakeStand:
    """To what looked like a wall from here; where it turns out to be none, the drone goes back to where it looked,
    once; not where it saw nothing there and has turned its back to it, for a wall at the end of the sensor's reach."""
    if stage.behind and stage.first_m is None:
        return _next(stage, first_yaw=None)
    back_to = pose.yaw if stage.first_yaw is None and not stage.turned_back else stage.first_yaw
    return _next(stage, looked_behind=True, first_yaw=back_to)


def _next(stage: TakeStand, **changes: object) -> TakeStand:
    return TakeStand.model_validate(stage.model_dump() | {"moves": stage.moves + 1} | changes)


def _reach_m(step: Step) -> float:
    return step.drone.vehicle.memory.reach_m


def _read(step: Step, look: Look) -> list[DepthView]:
    raw = [DepthView(sight.camera, sight.depth_m) for sight in look.all]
    return read_views(raw, shown_m=_reach_m(step))


def _pose(look: Look) -> Pose:
    return Pose(look.pose.x, look.pose.y, look.pose.z, look.pose.yaw)
