"""What somebody most likely meant by a word that there is not: "did you mean"."""

from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import get_args

from contracts.base import Wire

NEAR = 0.65
"""The least likeness (0..1, `difflib`) of what is offered: "yew" and "yaw" have 0.67, "flor" and "colour" 0.6."""


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """ " (did you mean 'colour'?)" of the nearest of the words; empty where none is near."""
    close = get_close_matches(word, list(words), n=1, cutoff=NEAR)
    return f" (did you mean {close[0]!r}?)" if close else ""


def fields_beside(message: str, place: Sequence[int | str]) -> set[str]:
    """The fields that there are where the last part of `place` is not, in the message of that class name; empty where
    that can't be told."""
    there = {kind for kind in _derived(Wire) if kind.__name__ == message}
    for part in place[:-1]:
        if isinstance(part, str):
            there = _within(there, part)
    return {field.alias or name for kind in there for name, field in kind.model_fields.items()}


def _within(kinds: set[type[Wire]], part: str) -> set[type[Wire]]:
    """The messages under that field. A part that is no field is the library's name for one of several forms, or a key:
    it leaves the forms that it names, or all."""
    fields = [field for kind in kinds if (field := kind.model_fields.get(part)) is not None]
    if fields:
        return {kind for field in fields for kind in _messages(field.annotation)}
    named = {
        kind
        for kind in kinds
        if kind.__name__ == part or any(part in get_args(field.annotation) for field in kind.model_fields.values())
    }
    return named or kinds


def _messages(annotation: object) -> Iterator[type[Wire]]:
    if isinstance(annotation, type) and issubclass(annotation, Wire):
        yield annotation
    for inner in get_args(annotation):
        yield from _messages(inner)


def _derived(kind: type[Wire]) -> Iterator[type[Wire]]:
    yield kind
    for derived in kind.__subclasses__():
        yield from _derived(derived)
