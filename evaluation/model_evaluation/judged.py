"""Each answer held against the truth of its look."""

from collections.abc import Mapping
from typing import NamedTuple

from contracts.orchestrator import SightingSettings
from contracts.sim import VisibleObject
from contracts.vlm_gateway import Match
from evaluation.model_evaluation.asking import Answers, Sought
from evaluation.model_evaluation.cases import Case, RenderedLook
from evaluation.model_evaluation.questions import CLEAR_PIXELS, CLEAR_SHARE, Thing, is_clear
from evaluation.subtasks.recognition import meets


class Judged(NamedTuple):
    """One question. `shown`: what was asked for, as far as it shows, the best view first. `claims` may be claimed at
    first sight, `candidates` are worth a nearer look as well; both surest first."""

    case: Case
    look: RenderedLook
    asked: Sought
    shown: tuple[VisibleObject, ...]
    claims: tuple[Match, ...]
    candidates: tuple[Match, ...]

    @property
    def best(self) -> VisibleObject | None:
        """What was asked for, in the view that shows most of it."""
        return self.shown[0] if self.shown else None

    @property
    def clear(self) -> bool:
        return any(is_clear(thing) for thing in self.shown)

    @property
    def found(self) -> bool:
        return any(self.right(match) for match in self.claims)

    @property
    def noticed(self) -> bool:
        return any(self.right(match) for match in self.candidates)

    @property
    def claims_wrongly(self) -> bool:
        """The surest claim, the one a mission would fly to, is something else."""
        return bool(self.claims) and not self.right(self.claims[0])

    def right(self, match: Match) -> bool:
        """The match's middle lies in the box of such a thing, grown by a quarter on each side, in its view."""
        wanted = Thing(self.asked.kind or "", self.asked.colour or "")
        return any(
            view.camera == match.camera and Thing(thing.kind, thing.colour) == wanted and meets(match.box, thing.box)
            for view in self.look.truth
            for thing in view.objects
        )

    @property
    def decoys(self) -> tuple[bool, bool]:
        """Does something else of the class, and does something else of the colour, show clearly in this look?"""
        others = [
            thing
            for view in self.look.truth
            for thing in view.objects
            if thing.pixels >= CLEAR_PIXELS
            and thing.share >= CLEAR_SHARE
            and (thing.kind, thing.colour) != (self.asked.kind, self.asked.colour)
        ]
        return any(t.kind == self.asked.kind for t in others), any(t.colour == self.asked.colour for t in others)


def judged(cases: Mapping[int, Case], answers: Answers, settings: SightingSettings) -> list[Judged]:
    """All questions about objects."""
    held = []
    for asked in answers.sought:
        case = cases[asked.seed]
        look = case.looks[asked.look]
        shown = [
            thing
            for view in look.truth
            for thing in view.objects
            if (thing.kind, thing.colour) == (asked.kind, asked.colour)
        ]
        shown.sort(key=lambda thing: (-is_clear(thing), -thing.pixels))
        claim = settings.claim_confidence if settings.claim_confidence is not None else (asked.claim_confidence or 0.0)
        worth = min(claim, settings.candidate_confidence)
        held.append(
            Judged(
                case,
                look,
                asked,
                tuple(shown),
                tuple(m for m in asked.matches if m.confidence >= claim),
                tuple(m for m in asked.matches if m.confidence >= worth),
            )
        )
    return held
