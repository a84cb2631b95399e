"""The approach: along the way that depth shows to be free, in legs, each followed by another look.

A candidate becomes confirmed when a look on the way sees it again, surely enough; a confirmed thing is closed in on
until the stop is reached, the last metre with less clearance where a balcony keeps the drone off.
"""

import math
from typing import NamedTuple

from contracts.depth_assist import ApproachAnswer
from contracts.event_data import LostData
from contracts.geometry import Box, Point3
from contracts.sim import SUCCESS_ASIDE_DEG
from mission.looks import Look, Sight
from mission.places import distance_m, point_of, yaw_towards
from mission.sighting import project
from mission.stage_actions.legs import (
    LOOK_AGAIN_M,
    NEAR_ENOUGH_M,
    SEEN_BEST_M,
    Leg,
    LegStage,
    near_enough_m,
    way_before,
    way_to,
)
from mission.stage_actions.looking import AHEAD_DEG, look_aside
from mission.stage_actions.planning import on_target
from mission.stage_actions.searching import Found, looks_again, search
from mission.stages import (
    Approach,
    CheckCandidate,
    ClaimWindow,
    CloseIn,
    FaceCandidate,
    LeaveBlocked,
    LookRound,
    Seen,
    SqueezeIn,
)
from mission.state import Dismissed, LostSighting
from mission.step import Step

MAX_LEGS = 8
SAME_THING_M = 2.0
OTHER_THING_M = 4.0
"""So far from where the thing was seen, it is another one of its kind."""
MAX_ASIDES = 2
"""How often a thing that no way leads to is looked at from another side before the search goes on."""
ASLANT_RAD = math.radians(35.0)
"""From farther aside a thing is placed worse than it has to be to tell the windows beside it apart: before the last leg
it is looked at from straight before it."""
SQUARE_RAD = math.radians(9.0)
"""So far the way a drone is turned at its stop may be from square to the facade as it is seen from there."""
MISPLACED_M = 0.15
"""So far off where it should be, as seen from there, the stop is put right before the claim."""

REFUSED = "the flight guard refused the way there"

AfterLook = LegStage | ClaimWindow | LookRound | LeaveBlocked


async def begin_approach(step: Step, found: Found) -> FaceCandidate | AfterLook:
    """From the look in which the thing was found. Raises PortError."""
    step.enter("approach", f"flying to the {step.state.object} {distance_m(step.pose, found.seen.place):.1f} m away")
    step.update(trail=(point_of(found.look.pose),))
    approach = Approach(first=found.seen, last=found.seen, ever_claimable=found.seen.claimable)
    if not looks_again(step):
        # at first sight means: looks on the way tell better where it is, but not whether
        return await _next_leg(step, approach, CloseIn, found.look, found.sight, found.match.box)
    if distance_m(found.look.pose, found.seen.place) <= LOOK_AGAIN_M + 1.0:
        # one leg would end too close to look again, so the second look is from here, face to face
        step.plan_flight((), yaw_towards(found.look.pose, found.seen.place), "turn to what was seen")
        return FaceCandidate(approach=approach)
    return await _next_leg(step, approach, CheckCandidate, found.look, found.sight, found.match.box)


async def face_candidate(step: Step, approach: Approach) -> FaceCandidate | AfterLook:
    """The second look, from where the first was made. Raises MissionEnd (answer_unreadable), PortError."""
    look = await look_aside(step, AHEAD_DEG)
    if look is None:
        return FaceCandidate(approach=approach)
    again = _same(await search(step, look, "face to face", near=approach.last.place), approach.last)
    if again is None:
        first = approach.first
        if not (first.claimable and first.confidence >= step.settings.sightings.sure_confidence):
            return _give_up(step, approach, "not seen again face to face")
        remembered = _remembered(approach.last, look)
        if remembered is None:
            return _give_up(step, approach, "out of sight face to face")
        return await _next_leg(step, approach, CloseIn, look, *remembered)
    approach = _seen_again(approach, again)
    # what two looks from here leave in doubt, one from straight before it may tell
    leg = CloseIn if approach.ever_claimable else CheckCandidate
    return await _next_leg(step, approach, leg, look, again.sight, again.match.box)


async def check_candidate(step: Step, approach: Approach) -> AfterLook:
    """After a leg to a thing that is not confirmed yet. Raises MissionEnd (answer_unreadable), PortError."""
    if step.state.refusals:
        return _give_up(step, approach, REFUSED, blocked=True)
    looked = await _look_after_leg(step, approach)
    if looked is None:
        return CheckCandidate(approach=approach)
    look, again, _ = looked
    if again is None:
        far = distance_m(look.pose, approach.last.place)
        return _give_up(step, approach, f"not seen again from {far:.1f} m", blocked=approach.goes_aside)
    approach = _seen_again(approach, again)
    if approach.ever_claimable:
        near = distance_m(look.pose, approach.last.place) <= near_enough_m(step, CloseIn)
        go_on = _confirmed if near else _next_leg
        return await go_on(step, approach, CloseIn, look, again.sight, again.match.box)
    if approach.reaches_stop:
        return _give_up(step, approach, f"only {again.seen.confidence:.2f} sure from near")
    return await _next_leg(step, approach, CheckCandidate, look, again.sight, again.match.box)


async def close_in(step: Step, approach: Approach, leg: type[CloseIn] | type[SqueezeIn]) -> AfterLook:
    """After a leg to a confirmed thing. Raises MissionEnd (answer_unreadable), PortError."""
    if step.state.refusals:
        return _give_up(step, approach, REFUSED, blocked=True)
    looked = await _look_after_leg(step, approach)
    if looked is None:
        return leg(approach=approach)
    look, again, other = looked
    if again is not None:
        approach = _seen_again(approach, again)
        return await _confirmed(step, approach, leg, look, again.sight, again.match.box)
    if other is not None and await _is_another(step, other, approach):
        far = distance_m(other.seen.place, approach.last.place)
        return _give_up(step, approach, f"not seen again, and a surer one {far:.1f} m off")
    # a thing may leave the picture or the model's grasp as it gets near, its place does not
    remembered = _remembered(approach.last, look)
    if remembered is None and approach.reaches_stop:
        return ClaimWindow(place=approach.last.place)
    if remembered is None:
        return _give_up(step, approach, f"leg {approach.legs}: out of sight")
    return await _confirmed(step, _unseen(approach), leg, look, *remembered)


class _Looked(NamedTuple):
    """A look after a leg: what it saw of the thing, else what it saw of the kind."""

    look: Look
    again: Found | None
    other: Found | None


async def _look_after_leg(step: Step, approach: Approach) -> _Looked | None:
    """Null where the drone has to turn for the look first."""
    look = await look_aside(step, AHEAD_DEG)
    if look is None:
        return None
    found = await search(step, look, f"after leg {approach.legs}", near=approach.last.place)
    again = _same(found, approach.last)
    return _Looked(look, again, found if again is None else None)


async def _confirmed(
    step: Step, approach: Approach, leg: type[CloseIn] | type[SqueezeIn], look: Look, sight: Sight, box: Box
) -> AfterLook:
    """At the stop and near enough: claim. Else the next leg; from the stop, with less clearance."""
    if not approach.reaches_stop:
        return await _next_leg(step, approach, leg, look, sight, box)
    far = distance_m(look.pose, approach.last.place)
    if far <= near_enough_m(step, leg):
        return await _claim_from(step, approach, leg, look, sight, box)
    if leg is SqueezeIn:
        why = f"leg {approach.legs}: no way nearer than {far:.1f} m from this side"
        return _give_up(step, approach, why, blocked=True)
    # a balcony or eaves beside the window kept the drone off: in still air less room will do for the last metre
    return await _next_leg(step, approach, SqueezeIn, look, sight, box)


async def _claim_from(step: Step, approach: Approach, leg: Leg, look: Look, sight: Sight, box: Box) -> AfterLook:
    """The claim at the stop, after a last flight to where the stop should be as it shows from there: face to face both
    windows beside a thing on the wall are seen, and flat things are placed better than from aside. Where that is far
    off, the claim waits for another look from there, once: on a balcony two looks may never agree. A stop that turns
    out not to be before the facade is none. Raises PortError."""
    place = approach.last.place
    way = await way_to(step, look, sight, box, distance_m(look.pose, place), leg)
    if not _is_in_front(look, place, way):
        return _give_up(step, approach, "the stop is not before the thing's facade", blocked=True)
    reached = way.stop if way.status == "clear" and way.reached else None
    off_m = distance_m(look.pose, reached) if reached is not None else 0.0
    if off_m > NEAR_ENOUGH_M and not _faces(look, way):
        return ClaimWindow(place=place)
    if off_m > NEAR_ENOUGH_M and not approach.put_right and approach.legs < MAX_LEGS:
        return _fly_leg(step, approach.model_copy(update={"put_right": True}), leg, way)
    if off_m > MISPLACED_M:
        step.plan_flight(way.path, way.facing_yaw, "to where the stop should be, as seen from here")
    return ClaimWindow(place=place)


async def _next_leg(step: Step, approach: Approach, leg: Leg, look: Look, sight: Sight, box: Box) -> AfterLook:
    """Plans the flight of the next leg from this look. Raises PortError."""
    number = approach.legs + 1
    if number > MAX_LEGS:
        return _give_up(step, approach, f"not there after {MAX_LEGS} legs")
    place = approach.last.place
    far = distance_m(look.pose, place)
    way = await way_to(step, look, sight, box, far, leg)
    if way.status != "clear":
        if leg is not CheckCandidate and far <= near_enough_m(step, leg) and _is_in_front(look, place, way):
            return ClaimWindow(place=place)
        if not way.aside or approach.asides >= MAX_ASIDES:
            why = "no depth in its box" if way.status == "no_depth" else "the way there is not free"
            return _give_up(step, approach, f"leg {number}: {why}", blocked=way.status == "blocked")
        approach = approach.model_copy(update={"asides": approach.asides + 1})
    elif leg is CloseIn and way.reached and far > SEEN_BEST_M and _aside_rad(look, place, way) > ASLANT_RAD:
        before = await way_before(step, look, sight, box)
        way = before if before.status == "clear" and before.path else way
    return _fly_leg(step, approach, leg, way)


def _fly_leg(step: Step, approach: Approach, leg: Leg, way: ApproachAnswer) -> LegStage:
    number = approach.legs + 1
    path = way.path or way.aside
    # until the stop is reached, the front camera keeps the thing in sight
    yaw = way.facing_yaw if way.reached else yaw_towards(path[-1] if path else step.pose, approach.last.place)
    step.plan_flight(path, yaw, f"leg {number} of the approach" + (", to another side of it" if way.aside else ""))
    flown = {"legs": number, "reaches_stop": way.reached, "goes_aside": bool(way.aside)}
    return leg(approach=approach.model_copy(update=flown))


def _faces(look: Look, way: ApproachAnswer) -> bool:
    """Does the drone, which was turned square to the facade at its stop, still stand square to it as seen from there?
    Where it does not, the two looks took the facade for another: a railing, or the wall round a corner."""
    if way.facing_yaw is None:
        return False
    return abs(math.remainder(look.pose.yaw - way.facing_yaw, math.tau)) <= SQUARE_RAD


def _is_in_front(look: Look, place: Point3, way: ApproachAnswer) -> bool:
    """Does the drone stand before the thing's facade, as far as depth shows how that stands?"""
    return _aside_rad(look, place, way) <= math.radians(SUCCESS_ASIDE_DEG)


def _aside_rad(look: Look, place: Point3, way: ApproachAnswer) -> float:
    """How far from straight before the facade the thing is looked at; 0 where depth does not show how that stands."""
    if way.facing_yaw is None:
        return 0.0
    return abs(math.remainder(yaw_towards(look.pose, place) - way.facing_yaw, math.tau))


def _give_up(step: Step, approach: Approach, why: str, *, blocked: bool = False) -> LookRound | LeaveBlocked:
    """Back along the trail to where the search was left: what does not stand up is dismissed, what can't be reached is
    tried from elsewhere."""
    place, first = approach.last.place, approach.first
    step.write(why, LostData(place=place, blocked=blocked))
    back = step.state.trail[-2::-1]
    if back or approach.legs > 0:
        step.plan_flight(back, first.seen_from.yaw, "back to where the search was left")
    step.update(approaches=step.state.approaches + 1, lost=LostSighting(why=why, blocked=blocked))
    if blocked:
        return LeaveBlocked()
    dismissed = Dismissed(place=place, seen_from=first.seen_from, confidence=first.confidence)
    step.update(dismissed=(*step.state.dismissed, dismissed))
    return LookRound()


def _same(found: Found | None, last: Seen) -> Found | None:
    """What was found, if it is the same thing."""
    return found if found is not None and distance_m(found.seen.place, last.place) <= SAME_THING_M else None


def _seen_again(approach: Approach, again: Found) -> Approach:
    claimable = approach.ever_claimable or again.seen.claimable
    return _unseen(approach).model_copy(update={"last": again.seen, "ever_claimable": claimable})


def _unseen(approach: Approach) -> Approach:
    """The same after a look that tells nothing new of the thing."""
    return approach.model_copy(update={"surest": max(approach.surest, approach.last.confidence)})


def _remembered(last: Seen, look: Look) -> tuple[Sight, Box] | None:
    """Where the thing must be in a look that does not show it; null where it lies in no view."""
    return project(last.place, last.extent, look) if last.extent else None


async def _is_another(step: Step, other: Found, approach: Approach) -> bool:
    """Is what was seen from near another thing of the kind, on the building searched, and surer than what brought the
    drone here ever was? At first sight means that no look on the way can drop a thing."""
    surest = max(approach.surest, approach.last.confidence)
    surer = other.seen.claimable and other.seen.confidence > surest
    far = distance_m(other.seen.place, approach.last.place) > OTHER_THING_M
    return looks_again(step) and surer and far and await on_target(step, other.look, other.seen.place)
