"""What depth assistance is asked for on an approach: the way of the next leg, with how much room, and to where."""

from contracts.depth_assist import ApproachAnswer, ApproachQuestion, ApproachSettings
from contracts.event_data import ApproachData
from contracts.geometry import Box
from mission.looks import Look, Sight
from mission.stages import CheckCandidate, CloseIn, SqueezeIn
from mission.step import Step

LOOK_AGAIN_M = 5.0
LONGEST_LEG_M = 8.0
SEEN_BEST_M = 3.2
"""So far before its facade a thing is told best: from nearer a model sees parts of it."""
NEAR_ENOUGH_M = 0.8
STILL_NEAR_M = 1.3
"""So much farther than the stop a claim is still worth making where there is no way nearer."""
TIGHT_CLEARANCE_M = 0.25

LegStage = CheckCandidate | CloseIn | SqueezeIn
Leg = type[CheckCandidate] | type[CloseIn] | type[SqueezeIn]


async def way_to(step: Step, look: Look, sight: Sight, box: Box, far_m: float, leg: Leg) -> ApproachAnswer:
    """The next leg: to where a second look is worth it, and once that confirmed the object, all the way."""
    settings = step.settings.approach
    if leg is CloseIn:
        return await _asked_way(step, look, sight, box, LONGEST_LEG_M, settings, confirmed=True)
    if leg is SqueezeIn:
        tight = settings.model_copy(update={"clearance_m": min(settings.clearance_m, TIGHT_CLEARANCE_M)})
        return await _asked_way(step, look, sight, box, LONGEST_LEG_M, tight, confirmed=True)
    leg_m = min(LONGEST_LEG_M, far_m - LOOK_AGAIN_M)
    leg_m = leg_m if leg_m > 1.0 else LONGEST_LEG_M
    return await _asked_way(step, look, sight, box, leg_m, _seen_best(settings), confirmed=False)


async def way_before(step: Step, look: Look, sight: Sight, box: Box) -> ApproachAnswer:
    """To where a confirmed thing is seen best, straight before its facade; never the stop."""
    best = _seen_best(step.settings.approach)
    way = await _asked_way(step, look, sight, box, LONGEST_LEG_M, best, confirmed=True)
    return way.model_copy(update={"reached": False})


def _seen_best(settings: ApproachSettings) -> ApproachSettings:
    return settings.model_copy(update={"stop_distance_m": max(settings.stop_distance_m, SEEN_BEST_M)})


async def _asked_way(
    step: Step, look: Look, sight: Sight, box: Box, leg_m: float, settings: ApproachSettings, *, confirmed: bool
) -> ApproachAnswer:
    question = ApproachQuestion(
        view=sight.depth_view,
        others=look.depth_beside(sight, reach_deg=90.0),
        box=box,
        pose=sight.pose,
        settings=settings,
        max_leg_m=leg_m,
        keep_out=step.context.limits.keep_out,
    )
    answer = await step.timed("approach", step.ports.depth.approach(question))
    step.write(
        f"way to the window: {answer.status}" + (", up to the stop" if answer.reached else ""),
        ApproachData(answer=answer, max_leg_m=round(question.max_leg_m, 2), confirmed=confirmed),
    )
    return answer


def near_enough_m(step: Step, leg: Leg) -> float:
    """From how far a claim is worth making, where there is no way nearer."""
    return step.settings.approach.stop_distance_m + (STILL_NEAR_M if leg is SqueezeIn else NEAR_ENOUGH_M)
