"""The answer put together, with the question to the customer where something is missing: one sentence, answered in a
word or two."""

from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

from contracts.llm_parser import Candidates, Confidence, Evidence, ParseAnswer, Reason, Reasons, Relation

Value = TypeVar("Value")


class Known(NamedTuple, Generic[Value]):
    """A field's value; while that is null, why, and what it may be."""

    value: Value | None
    why: Reason
    candidates: tuple[Value, ...] = ()


def composed(
    floor: Known[int],
    thing: Known[str],
    relation: Relation | None,
    *,
    confidence: Confidence,
    evidence: Evidence,
    language: str | None,
    model: str,
) -> ParseAnswer:
    """What is known beside what has to be asked for; a relation matters only where the window has no mark."""
    relation = relation if thing.value is None else None
    reasons = Reasons(
        floor=floor.why if floor.value is None else None,
        object=None if thing.value is not None else "relation_only" if relation is not None else thing.why,
    )
    candidates = Candidates(
        floors=floor.candidates if floor.value is None else (),
        objects=thing.candidates if thing.value is None else (),
    )
    return ParseAnswer(
        floor=floor.value,
        object=thing.value,
        relation=relation,
        missing=tuple(n for n, known in (("floor", floor), ("object", thing)) if known.value is None),
        reasons=reasons,
        candidates=candidates,
        confidence=confidence,
        question=question_for(reasons, candidates, relation),
        language=language,
        evidence=evidence,
        model=model,
    )


def ordinal(value: int) -> str:
    """4 is "4th"."""
    ending = "th" if value % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(value % 10, "th")
    return f"{value}{ending}"


def question_for(reasons: Reasons, candidates: Candidates, relation: Relation | None) -> str | None:
    """Null where nothing is missing."""
    floor = _floor_question(candidates.floors) if reasons.floor else None
    thing = _object_question(candidates.objects, relation) if reasons.object else None
    if floor is not None and thing is not None:
        return f"{floor} And {thing[0].lower()}{thing[1:]}"
    return floor or thing


def _floor_question(floors: tuple[int, ...]) -> str:
    if not floors:
        return "Which floor is the window on?"
    return f"Is the window on {_either([ordinal(f) for f in floors])} floor (the one at street level is the 1st)?"


def _object_question(objects: tuple[str, ...], relation: Relation | None) -> str:
    if relation is not None:
        where = {"left": "left of", "right": "right of", "above": "above", "below": "below"}[relation.side]
        return f"Your window is {where} the one with the {relation.to}: what can be seen at your own window?"
    if not objects:
        return "What can be seen at your window from outside?"
    return f"Is your window the one with {_either(objects)}?"


def _either(candidates: Sequence[str]) -> str:
    """ "the 3rd, the 4th or the 5th"."""
    *first, last = (f"the {candidate}" for candidate in candidates)
    return f"{', '.join(first)} or {last}" if first else last
