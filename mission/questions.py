"""What a request leaves open, in words: why it can't be flown, and the question that would mend it."""

from contracts.llm_parser import ParseAnswer, Reason, Relation
from mission.wording import with_article

_LEFT_OPEN: dict[Reason, str] = {
    "not_said": "names no {}",
    "open": "leaves the {} open",
    "unsure": "does not say the {} clearly enough",
    "relation_only": "marks the window only by a neighbouring one",
    "other_language": "is not in English",
    "too_long": "is too long to read the {} from it",
}
_FIELDS = {"floor": "floor", "object": "object at the window"}
_QUESTIONS = {"floor": "Which floor is the window on?", "object": "What can be seen at your window from outside?"}
_SIDES = {"left": "left of", "right": "right of", "above": "above", "below": "below"}


def missing_fields(answer: ParseAnswer) -> tuple[str, ...]:
    """`floor` and `object`, as far as they are null."""
    return tuple(name for name, value in (("floor", answer.floor), ("object", answer.object)) if value is None)


def left_open(answer: ParseAnswer) -> str:
    """Why the request can't be flown yet: "the request names no floor"."""
    reasons = {"floor": answer.reasons.floor, "object": answer.reasons.object}
    said = [_LEFT_OPEN[reasons[name] or "not_said"].format(_FIELDS[name]) for name in missing_fields(answer)]
    return f"the request {' and '.join(dict.fromkeys(said))}"


def question_of(answer: ParseAnswer) -> str:
    """The parser's own question; where it has none, one for each missing field."""
    if answer.question:
        return answer.question
    asked = [
        _by_neighbour(answer.relation) if name == "object" and answer.relation is not None else _QUESTIONS[name]
        for name in missing_fields(answer)
    ]
    return " ".join(asked)


def about_unknown(thing: str) -> str:
    """What is asked where the vision model has never learnt to see the thing (a noun phrase without article)."""
    return f"I have never learnt to recognise {with_article(thing)}. Is there something else at your window?"


def _by_neighbour(relation: Relation) -> str:
    return f"Your window is {_SIDES[relation.side]} the one with the {relation.to}: what can be seen at your own?"
