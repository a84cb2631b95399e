"""The claim, and what becomes of it."""

from contracts.geometry import Point3
from contracts.sim import SUCCESS_ASIDE_DEG, Verdict
from mission.own_request import judged_by_words
from mission.places import distance_m
from mission.stage_actions.searching import ANOTHER_WINDOW_M, looks_again
from mission.stages import ClaimWindow, Ended
from mission.step import MissionEnd, Step

NOT_JUDGED = "stopped in front of the window; nobody judges whether it is the right one"


async def claim_window(step: Step, stage: ClaimWindow) -> Ended:
    """Says that this is the window. Raises MissionEnd (request_incomplete) where the request fits a second one that was
    seen; PortError."""
    apart_m = _second_window_m(step, stage.place)
    if apart_m is not None:
        raise MissionEnd(
            "request_incomplete",
            f"two windows on floor {step.state.floor} have {step.thing}, {apart_m:.0f} m apart: "
            "the request does not say which of them is meant",
        )
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


def _second_window_m(step: Step, place: Point3) -> float | None:
    """How far off a second window is that the request fits; null where none was seen that stood up to a nearer look."""
    another = step.state.another
    if another is None or not looks_again(step):
        return None
    dismissed = any(distance_m(another, gone.place) <= ANOTHER_WINDOW_M for gone in step.state.dismissed)
    apart_m = distance_m(place, another)
    return apart_m if apart_m > ANOTHER_WINDOW_M and not dismissed else None


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
