"""One step of a mission: the flight that the state has planned, then what its stage does there."""

import time
from typing import assert_never

from contracts.orchestrator import OutcomeName
from mission.outages import try_again
from mission.stage_actions.approaching import check_candidate, close_in, face_candidate
from mission.stage_actions.asking import wait_for_answer
from mission.stage_actions.beginning import place_drone, preflight, read_request
from mission.stage_actions.claiming import claim_window
from mission.stage_actions.climbing import check_climb, climb
from mission.stage_actions.confirming import confirm_height
from mission.stage_actions.direct_count import back_off, count_whole, find_top, rise_with_distance
from mission.stage_actions.exploring import leave_blocked, look_round
from mission.stage_actions.floors import box_building, count_band, count_band_from_nearer, measure_stand_off
from mission.stage_actions.taking_stand import take_stand
from mission.stages import (
    BackOff,
    BoxBuilding,
    CheckCandidate,
    CheckClimb,
    ClaimWindow,
    Climb,
    CloseIn,
    ConfirmHeight,
    CountBand,
    CountBandFromNearer,
    CountWhole,
    Ended,
    FaceCandidate,
    FindTop,
    LeaveBlocked,
    LookRound,
    MeasureStandOff,
    NeedsAnswer,
    PlaceDrone,
    Preflight,
    ReadRequest,
    RiseWithDistance,
    SqueezeIn,
    Stage,
    TakeStand,
)
from mission.state import MissionState
from mission.step import MissionContext, MissionEnd, Step

LOST_WAY: frozenset[OutcomeName] = frozenset(
    {"no_building", "floor_not_found", "object_not_found", "blocked", "collision", "stopped_by_guard"}
)
"""Ends to which where the drone began may have led."""


async def advance(state: MissionState, context: MissionContext) -> MissionState:
    """The state after one stop: at most one flight, a look, a question or two. A state that has ended stays.

    The same state may be advanced again, by another process too, where this one died on the way: its flight is the
    same numbered move, its events have the same numbers, its claim is the same claim. Raises PortError.
    """
    return await run(Step(state, await context.with_drone(state)))


async def run(step: Step) -> MissionState:
    """`advance` on a step at hand, whose `state` tells how far it came where this is broken off."""
    started = time.perf_counter()
    try:
        await try_again(step)
        if step.state.flight is not None:
            await step.fly(step.state.flight)
            step.settle()
        if step.state.flight is None:  # else the next flight comes before anything else
            step.update(stage=await _act(step, step.state.stage))
    except MissionEnd as end:
        step.update(stage=_ended(step, end))
    finally:
        step.spend("total", time.perf_counter() - started)
    step.settle()
    return step.state


def _ended(step: Step, end: MissionEnd) -> Ended:
    """Why the mission ended, and what may be the reason: a building left for another, what was amiss at the start."""
    outcome, message = end.outcome, end.message
    if outcome not in LOST_WAY:
        return Ended(outcome=outcome, message=message)
    too_low, remark = step.state.too_low, step.state.start_remark
    if too_low is not None:
        message = f"{too_low}; another building was looked for: {message}"
        outcome = "floor_not_found" if outcome == "no_building" else outcome
    return Ended(outcome=outcome, message=f"{message}; {remark}" if remark is not None else message)


async def _act(step: Step, stage: Stage) -> Stage:
    match stage:
        case ReadRequest():
            return await read_request(step)
        case NeedsAnswer():
            return await wait_for_answer(step, stage)
        case Preflight():
            return await preflight(step)
        case PlaceDrone():
            return await place_drone(step)
        case TakeStand():
            return await take_stand(step, stage)
        case MeasureStandOff():
            return await measure_stand_off(step)
        case Climb():
            return await climb(step, stage)
        case CheckClimb():
            return await check_climb(step, stage)
        case CountBand():
            return await count_band(step, stage)
        case CountBandFromNearer():
            return await count_band_from_nearer(step, stage)
        case BackOff():
            return await back_off(step, stage)
        case RiseWithDistance():
            return await rise_with_distance(step, stage)
        case FindTop():
            return await find_top(step, stage)
        case CountWhole():
            return await count_whole(step, stage)
        case ConfirmHeight():
            return await confirm_height(step, stage)
        case BoxBuilding():
            return await box_building(step)
        case LookRound():
            return await look_round(step)
        case LeaveBlocked():
            return await leave_blocked(step)
        case FaceCandidate():
            return await face_candidate(step, stage.approach)
        case CheckCandidate():
            return await check_candidate(step, stage.approach)
        case CloseIn() | SqueezeIn():
            return await close_in(step, stage.approach, type(stage))
        case ClaimWindow():
            return await claim_window(step, stage)
        case Ended():
            return stage
        case _:
            assert_never(stage)
