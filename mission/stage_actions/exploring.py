"""Object exploration: look round with all cameras; where the object is not in sight, on to the policy's next stop."""

import asyncio

from contracts.geometry import Point3
from mission.places import point_of
from mission.policies.base import NextStop, NothingLeft, Plan
from mission.stage_actions.approaching import begin_approach
from mission.stage_actions.looking import ALL_ROUND_DEG, look_aside
from mission.stage_actions.over_heads import rises_over_heads
from mission.stage_actions.planning import memory_of, plan_onward
from mission.stage_actions.searching import search
from mission.stages import LeaveBlocked, LookRound, Stage
from mission.step import MissionEnd, Step
from mission.wording import counted

MAX_APPROACHES = 8


async def look_round(step: Step) -> Stage:
    """One exploration step. Raises MissionEnd: object_not_found after the last one or where nothing is left to inspect,
    answer_unreadable after too many useless answers in a row; PortError."""
    _enter_search(step)
    last = step.settings.max_exploration_steps
    if step.state.exploration_steps >= last:
        raise _not_found(step, f"no window with {step.thing} was found {_looked(step)}")
    if rises_over_heads(step):
        return LookRound()
    look = await look_aside(step, ALL_ROUND_DEG)
    if look is None:
        return LookRound()
    step.update(exploration_steps=step.state.exploration_steps + 1)
    # the way on is worked out while the model looks; mostly it is needed
    plan = asyncio.create_task(plan_onward(step, look))
    try:
        found = await search(step, look, f"step {step.state.exploration_steps}", plan=plan)
        if found is not None:
            return await begin_approach(step, found)
        if step.state.exploration_steps < last:
            await _go_on(step, await plan)
        return LookRound()
    finally:
        plan.cancel()
        await asyncio.gather(plan, return_exceptions=True)


async def leave_blocked(step: Step) -> LookRound | LeaveBlocked:
    """On to the policy's next stop without another question for the object. Raises as `look_round`."""
    _enter_search(step)
    if step.state.exploration_steps < step.settings.max_exploration_steps:
        if rises_over_heads(step):
            return LeaveBlocked()
        look = await look_aside(step, ALL_ROUND_DEG)
        if look is None:
            return LeaveBlocked()
        await _go_on(step, await plan_onward(step, look))
    return LookRound()


def _enter_search(step: Step) -> None:
    """Back in the search, unless too many sightings did not stand up."""
    if step.state.approaches >= MAX_APPROACHES:
        raise _not_found(step, f"{MAX_APPROACHES} sightings did not stand up to a nearer look")
    if step.state.phase != "explore":
        step.enter("explore", f"looking for {step.thing} on floor {step.state.floor}")


async def _go_on(step: Step, plan: Plan) -> None:
    """Takes the plan's way. Raises MissionEnd (object_not_found) where nothing is left; PortError."""
    onward = await plan.onward()
    step.update(memory=onward.memory.model_dump(mode="json"))
    if onward.told is not None:
        step.write(*onward.told)
    if isinstance(onward.stop, NothingLeft):
        raise _not_found(step, f"no window with {step.thing} was found; {_searched(step, onward.stop.why)}")
    step.plan_flight(*_no_farther(step, onward.stop))


def _no_farther(step: Step, stop: NextStop) -> NextStop:
    """After a way that the guard refused half of the next one, after two a quarter: what reaches into it may stand at
    its end, and from nearer another way shows."""
    if not step.state.refusals or not stop.path:
        return stop
    here, there, share = point_of(step.pose), stop.path[0], 0.5**step.state.refusals
    between = Point3(**{axis: a + share * (b - a) for (axis, a), (_, b) in zip(here, there, strict=True)})
    return NextStop((between,), stop.yaw, f"{stop.why}; {share:.0%} of the way there, after a refusal")


def _searched(step: Step, why: str) -> str:
    """What was searched: nothing is said of a floor whose height was not confirmed."""
    if step.state.height_confirmed is not False:
        return why
    at = f"at {step.state.final_height_m or 0.0:.1f} m"
    return (
        f"the search {at} is over, but no row of windows confirmed that this is the height of floor {step.state.floor}"
    )


def _not_found(step: Step, message: str) -> MissionEnd:
    """A sighting that could not be reached and never came back into sight is the better reason."""
    lost = step.state.lost
    if lost is not None and lost.blocked:
        return MissionEnd("blocked", f"the object was seen, but the way to its window is not free ({lost.why})")
    if step.state.elsewhere:
        message += f"; such a thing was seen {' and '.join(step.state.elsewhere.values())}"
    return MissionEnd("object_not_found", message)


def _looked(step: Step) -> str:
    """How far the search came, for a person."""
    looked = f"after {counted(step.state.exploration_steps, 'exploration step')}"
    share = memory_of(step).inspected_share
    if share is not None:
        looked += f", with {100 * share:.0f} % of the known facade inspected"
    if step.state.dismissed:
        looked += f"; {counted(len(step.state.dismissed), 'sighting')} did not stand up to a nearer look"
    return looked
