"""Straight up or down along the facade: no higher than what stands there has shown itself to be, and once more from a
little farther off where that way is not free."""

import math
from itertools import pairwise

from contracts.geometry import Point3
from contracts.vehicle import MAX_PATH_POINTS
from mission.places import above, ahead
from mission.stage_actions.floor_counts import eq3_settings
from mission.stages import (
    AfterClimb,
    BoxBuilding,
    CheckClimb,
    Climb,
    ConfirmHeight,
    CountBand,
    CountWhole,
    TakeStand,
)
from mission.step import MissionEnd, Step
from navigation.camera import wrap_radians

BACK_OFF_M = 1.0
CLOSE_ENOUGH_M = 0.05
BELOW_CEILING_M = 0.1
SAME_COLUMN_M = 0.3
SAME_WAY_RAD = math.radians(50.0)
MAX_NO_BUILDINGS = 2
"""How often a drone that stood before no building, or before one too low, looks elsewhere."""


async def climb(step: Step, stage: Climb) -> CheckClimb | Climb | AfterClimb | TakeStand:
    """Plans the flight, the nose kept; up to the height that is allowed as yet. Raises MissionEnd (floor_not_found)
    where the building ends far below."""
    pose = step.pose
    if abs(pose.z - stage.to_m) < CLOSE_ENOUGH_M:
        return stage.then
    to_m = stage.to_m
    if to_m > pose.z:
        to_m = min(to_m, step.drone.vehicle.ceiling_m - BELOW_CEILING_M)
        if to_m < stage.to_m and to_m < max(pose.z, stage.seen_m or pose.z) + CLOSE_ENOUGH_M:
            return _over_the_roof(step, stage)
    seen_m = to_m if to_m != stage.to_m else None
    why = stage.why if seen_m is None else f"{stage.why}, as far as seen"
    step.plan_flight((above(pose, to_m),) if to_m > pose.z else way_down(step, to_m), pose.yaw, why)
    return CheckClimb.model_validate(stage.model_dump(exclude={"at"}) | {"seen_m": seen_m})


async def check_climb(step: Step, stage: CheckClimb) -> Climb | AfterClimb:
    """Raises MissionEnd (blocked) where neither attempt came through; PortError."""
    pose = step.pose
    if step.state.arrived:
        # a drone rests where it can, half a metre beside perhaps: what led all the way is not flown again
        if stage.seen_m is None or stage.to_m - pose.z < CLOSE_ENOUGH_M:
            return stage.then
        await step.look_ahead()  # what is seen from here may let it go on
        return Climb.model_validate(stage.model_dump(exclude={"at"}))
    if stage.attempt == "from_farther_off":
        raise MissionEnd("blocked", f"the way to {stage.to_m:.1f} m height is not free above {pose.z:.1f} m")
    step.plan_flight((ahead(pose, 180.0, BACK_OFF_M),), pose.yaw, "a little farther off the facade")
    return Climb(to_m=stage.to_m, why=stage.why, then=stage.then, attempt="from_farther_off")


def way_down(step: Step, to_m: float) -> tuple[Point3, ...]:
    """Straight down where the drone came up; else back to there first, for no level camera sees what is beneath it."""
    pose, path = step.pose, list[Point3]()
    flown = step.state.guard.flown if step.state.guard is not None else ()
    for upper, lower in pairwise(reversed(flown)):
        if lower.z <= to_m <= upper.z and upper.z - lower.z > CLOSE_ENOUGH_M:
            share = (upper.z - to_m) / (upper.z - lower.z)
            x, y = (a + (b - a) * share for a, b in ((upper.x, lower.x), (upper.y, lower.y)))
            if math.hypot(x - pose.x, y - pose.y) > SAME_COLUMN_M:
                return (*path, Point3(x=x, y=y, z=to_m))[-MAX_PATH_POINTS:]
            break
        path.append(lower)
    return (above(pose, to_m),)


def may_look_elsewhere(step: Step) -> bool:
    return len(step.state.no_building) < MAX_NO_BUILDINGS


def look_elsewhere(step: Step, why: str = "that is no building: look elsewhere") -> TakeStand:
    """What has no floor, however high it is, is no building that anybody lives in on this side but a tree, a hedge or
    a bare wall: down again, turned to where the drone looked when it began, or where that is the same way, round."""
    pose, home = step.pose, step.state.guard.home if step.state.guard is not None else step.pose
    step.update(no_building=(*step.state.no_building, pose.yaw))
    path = way_down(step, home.z) if home.z < pose.z else ()
    same_way = abs(wrap_radians(home.yaw - pose.yaw)) <= SAME_WAY_RAD
    step.plan_flight(path, pose.yaw + math.pi if same_way else home.yaw, why)
    return TakeStand(looked_behind=True)


def not_here(step: Step, end: MissionEnd) -> TakeStand:
    """This building has no such floor. Where none stood near ahead of the drone when it began, another may be the
    customer's: one other. Raises `end` where there is nowhere else to look."""
    if step.state.at_foot or step.state.too_low is not None or not may_look_elsewhere(step):
        raise end
    step.update(too_low=end.message)
    return look_elsewhere(step, f"this building has no floor {step.state.floor}: look for another")


def once_more_from_below(step: Step, stand_off_m: float, top_m: float, *, top_seen: bool) -> Climb:
    """Before a customer hears that there is no such floor: a picture taken level with the roof cuts off what is low and
    near; from half the height it shows the whole of a facade that ends in the first band."""
    step.update(trail=())
    whole = CountWhole(stand_off_m=stand_off_m, home=step.pose, top_m=top_m, top_seen=top_seen)
    half_m = max(top_m / 2.0 - step.drone.front_up_m, eq3_settings(step).min_height_m)
    return Climb(to_m=half_m, why="to count once more from half the facade's height", then=whole)


def _over_the_roof(step: Step, stage: Climb) -> Climb | AfterClimb | TakeStand:
    """As high as is allowed over what stands here: what is to be seen from higher up can't be of this building; unless
    it is the operator's limit that is reached, which says nothing of the building. Raises MissionEnd
    (floor_not_found)."""
    floor, vehicle, then = step.state.floor, step.drone.vehicle, stage.then
    most_m = vehicle.limits.max_height_m
    limited = vehicle.ceiling_m >= most_m
    top_m = vehicle.ceiling_m - vehicle.limits.roof_margin_m
    high = f"no higher than {most_m:g} m may be flown" if limited else f"nothing here is higher than {top_m:.1f} m"
    first = isinstance(then, ConfirmHeight) and then.counted_m is None
    if first or isinstance(then, BoxBuilding):
        said = f"floor {floor} would be" if limited else f"there is no floor {floor}"
        return _not_up_there(step, f"{high}: {said} at {stage.to_m:.1f} m", limited=limited)
    if not isinstance(then, CountBand):
        return then
    below = step.pose.z < then.band.lower_m
    if not limited and then.floors_below == 0 and below and may_look_elsewhere(step):
        return look_elsewhere(step)
    if not limited and then.floors_below > 0 and top_m <= then.band.upper_m - then.band.lower_m:
        return once_more_from_below(step, then.stand_off_m, top_m, top_seen=False)
    if below:
        return _not_up_there(step, f"{high}, and no floor {floor} was found up to there", limited=limited)
    return then


def _not_up_there(step: Step, said: str, *, limited: bool) -> TakeStand:
    """Raises MissionEnd (floor_not_found) where no other building may be meant, or could be flown up."""
    end = MissionEnd("floor_not_found", said)
    if limited:
        raise end
    return not_here(step, end)
