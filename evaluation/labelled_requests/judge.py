"""How an answer to a labelled request ends: right, asked for, or silently wrong.

A request is right when floor and object are, null included where the label is null. A wrong answer that leaves floor or
object open asks: nothing flies. A wrong answer that is complete is silently wrong: a drone flies to another window.
"""

import re
from typing import Literal, NamedTuple

from evaluation.labelled_requests.read import LabelledRequest

Outcome = Literal["right", "asks", "silently_wrong"]

SAME_FROM_F1 = 0.7
"""Two phrases are the same thing from this share of common content words (F1) on."""

_ARTICLES = frozenset({"a", "an", "the", "my", "our"})
_POSSESSIVES = frozenset({"your", "his", "her", "its", "their"})
_DETERMINERS = frozenset({"this", "that", "one", "some"})
_CONNECTING = frozenset(
    {"with", "of", "in", "on", "at", "by", "and", "or", "like", "which", "is", "are", "for", "from"}
)
_FUNCTION_WORDS = _ARTICLES | _POSSESSIVES | _DETERMINERS | _CONNECTING | {"made", "shaped"}


class Reading(NamedTuple):
    """What a parser read from a request; `readable` is false where a model's answer was unreadable or declined."""

    floor: int | None
    object: str | None
    readable: bool = True


class Judged(NamedTuple):
    """An answer held against its label; `object_exact`: word for word, but for case, articles, plurals."""

    outcome: Outcome
    floor: bool
    object: bool
    object_exact: bool


def judge(request: LabelledRequest, reading: Reading) -> Judged:
    """An unreadable answer is never right, not even where there was nothing to read."""
    if not reading.readable:
        return Judged("asks", floor=False, object=False, object_exact=False)
    floor, same, exact = reading.floor == request.floor, is_object(request, reading.object), False
    if same:
        exact = request.object is None or is_exactly(request, reading.object or "")
    if floor and same:
        return Judged("right", floor, same, exact)
    complete = reading.floor is not None and bool(reading.object)
    return Judged("silently_wrong" if complete else "asks", floor, same, exact)


def is_object(request: LabelledRequest, answer: str | None) -> bool:
    """The labelled thing in other words: as many content words in common as `SAME_FROM_F1`, or between a short form and
    all that the request says of it."""
    if request.object is None or not answer:
        return request.object is None and not answer
    said = content_words(answer)
    forms = [content_words(form) for form in (request.object, *request.also_ok)]
    whole = frozenset().union(*forms, *(content_words(text) for text in request.object_text))
    between = said <= whole and any(form <= said for form in forms)
    return between or is_exactly(request, answer) or max(_f1(said, form) for form in forms) >= SAME_FROM_F1


def is_exactly(request: LabelledRequest, answer: str) -> bool:
    """One of the labelled forms, but for case, articles, punctuation and plurals."""
    wanted = [_without_articles(form) for form in (request.object or "", *request.also_ok)]
    return _without_articles(answer) in wanted


def content_words(phrase: str) -> frozenset[str]:
    """The words of a phrase in the singular, without those that only connect."""
    return frozenset(_words(phrase)) - _FUNCTION_WORDS


def _words(phrase: str) -> list[str]:
    text = phrase.lower().replace("’", "'").replace("w/", " with ").replace("&", " and ")
    text = re.sub(r"'s\b", "", text)
    words = re.findall(r"\w+", text)
    return ["with" if word == "w" else _singular(word) for word in words]


def _singular(word: str) -> str:
    return word[:-1] if len(word) > 3 and word.endswith("s") and not word.endswith("ss") else word


def _without_articles(phrase: str) -> list[str]:
    return [word for word in _words(phrase) if word not in _ARTICLES]


def _f1(one: frozenset[str], other: frozenset[str]) -> float:
    common = len(one & other)
    return 2 * common / (len(one) + len(other)) if common else 0.0
