"""The claim, and what becomes of it."""

from contracts.sim import SUCCESS_ASIDE_DEG, Verdict
from mission.own_request import judged_by_words
from mission.stages import ClaimWindow, Ended
from mission.step import Step

NOT_JUDGED = "stopped in front of the window; nobody judges whether it is the right one"


async def claim_window(step: Step, stage: ClaimWindow) -> Ended:
    """Says that this is the window. Raises PortError."""
    step.enter("claim", "claiming the window")
    name = step.drone.vehicle.name
    verdict = await step.timed("claim", step.context.placement.claim(name, stage.place))
    step.update(claimed=stage.place, verdict=verdict)
    if verdict is None:
        return Ended(outcome="stopped_not_judged", message=NOT_JUDGED)
    if (judged := judged_by_words(verdict, step.state.floor, step.state.object)) is not None:
        step.update(verdict=judged.verdict)
        step.write(judged.message, judged.verdict)
        return Ended(outcome=judged.outcome, message=judged.message)
    step.write(spoken_verdict(verdict), verdict)
    return _judged(verdict)


def _judged(verdict: Verdict) -> Ended:
    """The verdict as the mission's end."""
    said = spoken_verdict(verdict)
    if verdict.collided:
        return Ended(outcome="collision", message="the drone collided on its way")
    if verdict.delivered:
        return Ended(outcome="delivered", message=said)
    if not verdict.judged and verdict.stops_well():
        return Ended(outcome="stopped_not_judged", message=said)
    if verdict.right_window is False:
        return Ended(outcome="wrong_window", message=said)
    return Ended(outcome="not_in_front", message=said)


def spoken_verdict(verdict: Verdict) -> str:
    """The verdict in words."""
    if not verdict.judged:
        place = "in front of a window" if verdict.stops_well() else "in front of no window"
        return f"stopped {place}; the scene names no goal to judge by"
    where = f"{verdict.distance_m:.1f} m from the window's centre" if verdict.distance_m is not None else "off"
    if verdict.delivered:
        return f"in front of the right window, {where}"
    if verdict.right_window is False:
        return f"claimed a window that is not the customer's ({where} of that one)"
    if verdict.nearest_window is False:
        return f"the right window, but the drone stopped nearer to another one, {where}"
    if verdict.aside_deg is not None and SUCCESS_ASIDE_DEG < verdict.aside_deg < 90.0:
        return f"the right window, but seen from {verdict.aside_deg:.0f} degrees aside, {where}"
    sight = "in front of it" if verdict.in_front else "not in front of it"
    clear = "in clear sight" if verdict.line_of_sight else "without a clear line of sight"
    return f"the right window, but {where}, {sight}, {clear}"
