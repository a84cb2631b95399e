"""One question for the object in all views of a look, and what depth says of the answer."""

import math
from collections.abc import Awaitable, Callable
from typing import NamedTuple

from contracts.event_data import JudgedMatch, LookData, LookedView
from contracts.geometry import Point3
from contracts.images import encode_jpeg, jpeg_bytes
from contracts.vlm_gateway import FindObjectAnswer, FindObjectQuestion, Match, View
from mission.annotation import mark_box
from mission.looks import Look, Sight
from mission.model_calls import Answered
from mission.one_thing import clearest, joined
from mission.places import apart_deg, distance_m, looks_towards
from mission.policies.base import Plan
from mission.sighting import Sighting, facade_returns, is_dismissed, locate
from mission.stage_actions.planning import on_target
from mission.stages import Seen
from mission.step import MissionEnd, Step
from mission.wording import counted

ANOTHER_HOUSE = "not on the building searched"
ANOTHER_WINDOW_M = 2.5
"""So far from where the thing was seen, a second one of its kind is at another window."""
CONFIRMED_WITHIN_M = 8.0
"""From farther off nothing is confirmed, however sure the look is."""
ONE_DIRECTION_DEG = 10.0
"""Two sightings of one look that lie in one direction are one thing: overlapping cameras both see it, and depth beside
something thin is that of what stands behind it."""


class Found(NamedTuple):
    """The object in one view, at a place that can be the window asked for."""

    look: Look
    sight: Sight
    match: Match
    seen: Seen


def looks_again(step: Step) -> bool:
    """Is a sighting looked at from nearer before it is claimed?"""
    return step.settings.sightings.policy == "look-again"


async def search(
    step: Step, look: Look, what: str, near: Point3 | None = None, plan: Awaitable[Plan] | None = None
) -> Found | None:
    """Asks for the object in all views at once; `near` prefers the sighting closest to a place, `plan` knows what is on
    the target building. Raises MissionEnd (answer_unreadable), PortError."""
    step.count_stop()
    question = FindObjectQuestion(
        model=step.settings.vision_model,
        object=step.state.object or "",
        views=tuple(View(camera=s.view.camera, image=s.view.image) for s in look.all),
    )
    reply = await step.ask("recognition", step.ports.vision.find_object(question))
    sightings: list[Sighting] = []
    claim = _claim_confidence(step, reply.answer)
    if isinstance(reply, Answered):
        step.update(silent_looks=0)
        sightings = _judged(step, look, reply.answer, claim)
        if plan is not None and any(s.rejected is None for s in sightings):
            sightings = _of_target(sightings, (await plan).on_target)
    else:
        step.update(silent_looks=step.state.silent_looks + 1)
    best = _best(sightings, near)
    _remember_elsewhere(step, sightings, claim)
    sure = [s for s in sightings if s.match.confidence >= claim]
    if best is not None and best.match.confidence >= claim:
        await _remember_another(step, look, best, sure, judged=plan is not None)
    step.write(
        f"{what}: {_said(reply.answer.outcome, sightings, _seen_by(look, best), step.state.object or 'object')}",
        LookData(
            exploration_step=step.state.exploration_steps,
            pose=look.pose,
            object=step.state.object,
            answer=reply.answer,
            views=tuple(
                LookedView(camera=sight.view.camera, picture=sight.name, depth=sight.depth_name) for sight in look.all
            ),
            sightings=tuple(_recorded(s, best is not None and s.place is best.place) for s in sightings),
            returns=tuple(facade_returns(look.across)),
            render_s=look.observation.timings_s.get("render", 0.0),
            seconds=round(reply.seconds, 4),
        ),
        lambda: look.pictures | _boxed(look, best),
    )
    silent = step.state.silent_looks
    if silent > step.settings.max_model_failures:
        said = f"the recognition model gave {silent} answers in a row that say nothing ({reply.answer.outcome})"
        raise MissionEnd("answer_unreadable", said)
    return _found(step, look, best, claim) if best is not None else None


def _remember_elsewhere(step: Step, sightings: list[Sighting], claim: float) -> None:
    """Where such a thing was surely seen that is not where it was asked for, to tell the customer in the end."""
    for sighting in sightings:
        place = sighting.place
        if place is None or sighting.match.confidence < claim or sighting.rejected is None:
            continue
        if sighting.rejected == ANOTHER_HOUSE:
            step.update(elsewhere=step.state.elsewhere | {"neighbour": "on a neighbour's house"})
        elif sighting.rejected.startswith("at height"):
            step.update(elsewhere=step.state.elsewhere | {"floor": f"on another floor, about {place.z:.0f} m high"})


async def _remember_another(step: Step, look: Look, best: Sighting, sure: list[Sighting], *, judged: bool) -> None:
    """Where a second thing as asked for was surely seen beside the best: then the request fits two windows.
    `judged`: the sightings were held against the building searched. Raises PortError."""
    if best.place is None:
        return
    for other in sure:
        there = other.place
        if other.rejected is not None or there is None or distance_m(there, best.place) <= ANOTHER_WINDOW_M:
            continue
        if apart_deg(look.pose, there, best.place) <= ONE_DIRECTION_DEG:
            continue
        if judged or await on_target(step, look, there):
            step.update(another=there)
            return


def _found(step: Step, look: Look, best: Sighting, claim: float) -> Found | None:
    sight = look.sights.get(best.match.camera)
    if best.place is None or sight is None:
        return None
    confidence = best.match.confidence
    is_near = distance_m(look.pose, best.place) <= CONFIRMED_WITHIN_M or not looks_again(step)
    seen = Seen(
        place=best.place,
        seen_from=look.pose,
        confidence=confidence,
        extent=best.extent,
        claimable=confidence >= claim and is_near,
    )
    return Found(look, sight, best.match, seen)


def _claim_confidence(step: Step, answer: FindObjectAnswer) -> float:
    for confidence in (step.settings.sightings.claim_confidence, answer.claim_confidence):
        if confidence is not None:
            return confidence
    return 0.0


def _judged(step: Step, look: Look, answer: FindObjectAnswer, claim: float) -> list[Sighting]:
    """The things of which the matches are worth a judgement, each held against depth, height, and what was dismissed
    before; the most confident first."""
    worth = min(claim, step.settings.sightings.candidate_confidence) if looks_again(step) else claim
    sightings = []
    for camera in dict.fromkeys(match.camera for match in answer.matches):
        sight = look.sights.get(camera)
        if sight is None:
            continue
        for match in joined((m for m in answer.matches if m.camera == camera and m.confidence >= worth), sight):
            sightings.append(_judge(step, match, sight, claimable=match.confidence >= claim))
    return sorted(sightings, key=lambda s: -s.match.confidence)


def _judge(step: Step, match: Match, sight: Sight, *, claimable: bool) -> Sighting:
    state = step.state
    sighting = locate(match, sight, floor_z=state.final_height_m or 0.0, floor_height_m=state.floor_height_m or 3.0)
    if sighting.rejected is not None or sighting.place is None:
        return sighting
    if is_dismissed(state.dismissed, sighting.place, sight.pose, match.confidence, claimable=claimable):
        return sighting._replace(rejected="looked at from near before")
    return sighting


def _of_target(sightings: list[Sighting], on_target: Callable[[Point3], bool]) -> list[Sighting]:
    """The same, with those rejected that are on another building."""
    return [
        s._replace(rejected=ANOTHER_HOUSE)
        if s.rejected is None and s.place is not None and not on_target(s.place)
        else s
        for s in sightings
    ]


def _best(sightings: list[Sighting], near: Point3 | None) -> Sighting | None:
    """The clearest sighting of the thing seen most surely, or of the one closest to `near`, among those that were not
    rejected."""
    kept = [s for s in sightings if s.rejected is None and s.place is not None]
    if not kept:
        return None
    if near is None:
        return clearest(kept, kept[0])
    return clearest(kept, min(kept, key=lambda s: distance_m(s.place, near) if s.place else math.inf))


def _seen_by(look: Look, best: Sighting | None) -> str | None:
    """Where the best sighting was seen, in words."""
    if best is None:
        return None
    return f"{looks_towards(look.sights[best.match.camera].camera)}, {best.distance_m:.1f} m away"


def _said(outcome: str, sightings: list[Sighting], seen: str | None, thing: str) -> str:
    if outcome != "answered":
        return f"the recognition model's answer was {outcome}"
    if seen is not None:
        return f"{thing} seen {seen}"
    if sightings:
        return f"{counted(len(sightings), 'sighting')} rejected: {sightings[0].rejected}"
    return f"no {thing} in sight"


def _recorded(sighting: Sighting, accepted: bool) -> JudgedMatch:
    return JudgedMatch(
        **dict(sighting.match),
        place=sighting.place,
        distance_m=round(sighting.distance_m, 2) if sighting.distance_m is not None else None,
        accepted=accepted,
        rejected=sighting.rejected,
    )


def _boxed(look: Look, best: Sighting | None) -> dict[str, bytes]:
    """The view of the sighting, with its box drawn."""
    sight = look.sights.get(best.match.camera) if best is not None else None
    if best is None or sight is None:
        return {}
    label = f"{best.match.confidence:.2f}, {best.distance_m:.1f} m" if best.distance_m is not None else ""
    return {"sighting": jpeg_bytes(encode_jpeg(mark_box(sight.rgb, best.match.box, label)))}
