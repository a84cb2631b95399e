"""Recognition alone: is the customer's thing found where it shows, and claimed where it does not?

A look is five views of one moment, as a mission asks. By its goal a look is one of:

shown    some view has at least 40 % of the goal and 80 pixels of it, within 25 m: recall counts these
covered  80 pixels show, but less than 40 % of the goal: apart, in recall by visible share only
faint    fewer pixels than that: counts nowhere, nobody could say what is right
absent   no pixel of it in any view: false claims count these
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

from contracts.geometry import Box
from contracts.orchestrator import SightingSettings
from contracts.sim import TruthView, VisibleObject
from contracts.vlm_gateway import FindObjectAnswer, Match
from evaluation.subtasks.figures import Figures, bin_of, by_group, rate

MIN_SHARE = 0.4
MIN_PIXELS = 80
MAX_DISTANCE_M = 25.0
DISTANCES = {"< 5 m": 5.0, "5-10 m": 10.0, "10-15 m": 15.0, "15-25 m": 25.0}
SIZES = {"< 200 px": 200.0, "200-800 px": 800.0, "800-3200 px": 3200.0, "> 3200 px": float("inf")}
SHARES = {"< 40 %": 0.4, "40-70 %": 0.7, "70-95 %": 0.95, "> 95 %": float("inf")}
DECOYS = ("same thing", "same class", "same colour", "neither")

Shows = Literal["shown", "covered", "faint", "absent"]


class JudgedLook(NamedTuple):
    """One question: what the goal is, what the views show, what the model claims to see (null: no readable answer)."""

    kind: str
    colour: str
    views: tuple[TruthView, ...]
    matches: tuple[Match, ...] | None


def claimed(answer: FindObjectAnswer, settings: SightingSettings) -> tuple[Match, ...]:
    """The matches that may be claimed at first sight; candidates aren't."""
    wanted = settings.claim_confidence if settings.claim_confidence is not None else answer.claim_confidence
    return tuple(match for match in answer.matches if match.confidence >= (wanted or 0.0))


def score(looks: Sequence[JudgedLook]) -> Figures:
    """`recall`: the goal is among the matches; `recall_first`: it is the most confident one; `false_claim`: anything
    is claimed though the goal is absent. Without looks every rate is 0 of 0.

    False claims by decoy: "same thing" looks have the goal's class in its colour elsewhere in view and count nowhere
    else; "same class" and "same colour" looks may be both.
    """
    shown = [look for look in looks if shows(look) == "shown"]
    visible = [look for look in looks if shows(look) in ("shown", "covered")]
    absent = [look for look in looks if shows(look) == "absent"]
    return Figures(
        rates={
            "recall": rate(found(look) for look in shown),
            "recall_first": rate(found(look, first=True) for look in shown),
            "false_claim": rate(bool(look.matches) for look in absent),
        },
        values={},
        groups={
            "recall by distance": by_group(
                ((bin_of(_best(look).distance_m, DISTANCES), found(look)) for look in shown), list(DISTANCES)
            ),
            "recall by size": by_group(
                ((bin_of(_best(look).pixels, SIZES), found(look)) for look in shown), list(SIZES)
            ),
            "recall by visible share": by_group(
                ((bin_of(_best(look).share, SHARES), found(look)) for look in visible), list(SHARES)
            ),
            "false claims by decoy in view": by_group(
                ((decoy, bool(look.matches)) for look in absent for decoy in decoys(look)), DECOYS
            ),
        },
    )


def shows(look: JudgedLook) -> Shows:
    """How the goal shows in a look; see the module's table."""
    goals = _goals(look)
    if not goals:
        return "absent"
    near = [goal for goal in goals if goal.pixels >= MIN_PIXELS and goal.distance_m <= MAX_DISTANCE_M]
    if not near:
        return "faint"
    return "shown" if any(goal.share >= MIN_SHARE for goal in near) else "covered"


def found(look: JudgedLook, *, first: bool = False) -> bool:
    """Some match (or the first) has its middle in the goal's box, grown by a quarter on each side, in its view."""
    boxes = {view.camera: thing.box for view in look.views for thing in view.objects if thing.goal}
    matches = list(look.matches or ())[: 1 if first else None]
    return any(match.camera in boxes and meets(match.box, boxes[match.camera]) for match in matches)


def decoys(look: JudgedLook) -> list[str]:
    """Which of DECOYS a look counts as, by what else shows clearly in it."""
    others = {
        (thing.kind, thing.colour)
        for view in look.views
        for thing in view.objects
        if not thing.goal and thing.pixels >= MIN_PIXELS and thing.share >= MIN_SHARE
    }
    if (look.kind, look.colour) in others:
        return ["same thing"]
    like = [kind == look.kind for kind, _ in others], [colour == look.colour for _, colour in others]
    return [name for name, flags in zip(("same class", "same colour"), like, strict=True) if any(flags)] or ["neither"]


def _goals(look: JudgedLook) -> list[VisibleObject]:
    return [thing for view in look.views for thing in view.objects if thing.goal]


def _best(look: JudgedLook) -> VisibleObject:
    """The goal in the view that shows most of it."""
    return max(_goals(look), key=lambda goal: (goal.share >= MIN_SHARE, goal.pixels))


def meets(claimed: Box, thing: Box) -> bool:
    """The claim's middle lies in the thing's box, grown by a quarter on each side."""
    x, y = (claimed.x_min + claimed.x_max) / 2, (claimed.y_min + claimed.y_max) / 2
    w, h = (thing.x_max - thing.x_min) / 4, (thing.y_max - thing.y_min) / 4
    return thing.x_min - w <= x <= thing.x_max + w and thing.y_min - h <= y <= thing.y_max + h
