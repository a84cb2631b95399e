"""One count of all floors in one picture, and how the `direct-count` ablation comes to see them: away from the facade
until its top is in sight."""

import math

from contracts.depth_assist import SafeDistanceSettings, SafeDistancesQuestion
from contracts.geometry import Point3
from mission.places import ahead, distance_m, point_of
from mission.stage_actions.climbing import look_elsewhere, may_look_elsewhere, not_here
from mission.stage_actions.floor_counts import (
    FACADE,
    count_floors,
    eq3_settings,
    not_there,
    turn_a_little,
    useless,
    write_count,
)
from mission.stages import (
    BackOff,
    BoxBuilding,
    Climb,
    CountWhole,
    FindTop,
    RiseWithDistance,
    TakeStand,
    WholeBuilding,
)
from mission.step import Step
from navigation import facade
from navigation.floor_localization import FloorNotFound, direct_count

STEP_BACK = SafeDistanceSettings(l_max_m=12.0)
LEAST_STEP_BACK_M = 1.0
STEPS_BACK = 3
LEFT_HOME_M = 0.05


def leave_facade(step: Step, stand_off_m: float) -> BackOff:
    """From the place where the stand-off was measured."""
    step.update(trail=())
    return _turn_round(step, WholeBuilding(stand_off_m=stand_off_m, home=step.pose))


def _turn_round(step: Step, stage: WholeBuilding) -> BackOff:
    step.plan_flight((), stage.home.yaw + math.pi, "turn round")
    return BackOff(stand_off_m=stage.stand_off_m, home=stage.home, retreats=stage.retreats + 1)


async def back_off(step: Step, stage: BackOff) -> RiseWithDistance:
    """Looks how far the way is free, and flies it, turning back to the building. Raises PortError."""
    front = step.drone.front
    behind = await step.look(step.drone.within(45.0))
    sight = behind.sights[front]
    question = SafeDistancesQuestion(
        view=sight.depth_view,
        others=behind.depth_beside(sight),
        height_m=max(0.0, behind.pose.z),
        settings=STEP_BACK,
    )
    safe = await step.timed("safe_distances", step.ports.depth.safe_distances(question))
    free = next((p.distance_m for p in safe.points if p.label == "c"), 0.0)
    path = (ahead(step.pose, 0.0, free),) if free >= LEAST_STEP_BACK_M else ()
    step.plan_flight(path, stage.home.yaw, f"{free:.1f} m away from the building")
    return RiseWithDistance(stand_off_m=stage.stand_off_m, home=stage.home, retreats=stage.retreats)


async def rise_with_distance(step: Step, stage: RiseWithDistance) -> Climb:
    then = FindTop(stand_off_m=stage.stand_off_m, home=stage.home, retreats=stage.retreats)
    return Climb(to_m=_away_m(step, stage), why="to see the whole building", then=then)


async def find_top(step: Step, stage: FindTop) -> BackOff | CountWhole:
    """Raises PortError."""
    sight, away = await step.look_ahead(), _away_m(step, stage)
    top = facade.facade_top_m(sight.seen, away, sight.eye_z, FACADE)
    if top is None and stage.retreats < STEPS_BACK:
        return _turn_round(step, stage)
    return CountWhole(
        stand_off_m=stage.stand_off_m,
        home=stage.home,
        retreats=stage.retreats,
        top_m=top if top is not None else sight.eye_z + away,
        top_seen=top is not None,
    )


async def count_whole(step: Step, stage: CountWhole) -> CountWhole | Climb | TakeStand:
    """Raises MissionEnd: floor_not_found, answer_unreadable; PortError."""
    sight = await step.look_ahead()
    count = await count_floors(step, sight)
    decision = direct_count(count.floors, stage.top_m, step.state.floor or 1, eq3_settings(step))
    write_count(step, sight, count, None, stage.top_m if stage.top_seen else None, decision)
    if isinstance(decision, FloorNotFound):
        return no_such_floor(step, decision)
    if decision is None:
        silent = stage.silent + 1
        if silent > step.settings.max_model_failures:
            raise useless(silent, count)
        turn_a_little(step, stage.silent)
        return stage.model_copy(update={"silent": silent})
    # what lies beneath or between is not known: back the way it came, which was free
    step.plan_flight(_retraced(step, stage), stage.home.yaw, "back to the facade")
    step.update(final_height_m=decision.height_m, floor_height_m=decision.floor_height_m)
    return Climb(to_m=decision.height_m, why=f"to floor {step.state.floor}", then=BoxBuilding())


def no_such_floor(step: Step, end: FloorNotFound) -> TakeStand:
    """On to another building where this may not be the customer's. Raises MissionEnd (floor_not_found)."""
    if end.floors_counted == 0 and step.settings.floors == "stepwise" and may_look_elsewhere(step):
        return look_elsewhere(step)
    return not_here(step, not_there(step, end))


def _away_m(step: Step, stage: WholeBuilding) -> float:
    """How far the facade is: the stand-off, and how far the drone has left it since."""
    return stage.stand_off_m + math.hypot(step.pose.x - stage.home.x, step.pose.y - stage.home.y)


def _retraced(step: Step, stage: WholeBuilding) -> tuple[Point3, ...]:
    """From here back along the trail, to where it left the column over home."""
    trail = [point_of(stage.home), *step.state.trail]
    apart = [distance_m(place, trail[0].model_copy(update={"z": place.z})) > LEFT_HOME_M for place in trail]
    last_home = apart.index(True) - 1 if any(apart) else len(trail) - 1
    return tuple(dict.fromkeys(reversed(trail[last_home:-1])))
