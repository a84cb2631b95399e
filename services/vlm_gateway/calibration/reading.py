"""From whatever a model writes about boxes to colours and numbers: JSON in any nesting, InternVL's tags, or prose."""

import json
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from services.vlm_gateway.calibration.picture import COLOURS

MAX_TEXT = 60_000
_NUMBER = r"-?\d+(?:\.\d+)?"
_QUAD = re.compile(rf"[\[(]\s*({_NUMBER})\s*,\s*({_NUMBER})\s*\)?\s*,\s*\(?\s*({_NUMBER})\s*,\s*({_NUMBER})\s*[\])]")
_REASONING = re.compile(r"<(think|thinking|thought|reasoning)>.*?</\1>", re.DOTALL | re.IGNORECASE)
_END = re.compile(r".*</(?:think|thinking|thought|reasoning)>", re.DOTALL | re.IGNORECASE)
_COLOUR = re.compile(r"\b(" + "|".join(COLOURS) + r")\b", re.IGNORECASE)


class Told(NamedTuple):
    """Four numbers that the model gave for the shape of this colour, in its own order and scale."""

    colour: str
    numbers: tuple[float, float, float, float]


def boxes_in(text: str) -> list[Told]:
    """The first box for each colour; colours that are not told, or not with four numbers, are left out."""
    answer = _END.sub("", _REASONING.sub(" ", text[-MAX_TEXT:]), count=1)
    found: dict[str, Told] = {}
    for value in _json_values(answer):
        for told in _inside(value, None):
            found.setdefault(told.colour, told)
    if not found:
        for told in _in_prose(answer):
            found.setdefault(told.colour, told)
    return list(found.values())


def _json_values(text: str) -> Iterator[object]:
    decoder = json.JSONDecoder()
    at = 0
    for _ in range(64):
        starts = [place for place in (text.find("{", at), text.find("[", at)) if place >= 0]
        if not starts:
            return
        at = min(starts)
        try:
            value, at = decoder.raw_decode(text, at)
        except (ValueError, RecursionError):
            at += 1
            continue
        yield value


def _inside(value: object, colour: str | None) -> Iterator[Told]:
    """Boxes in a JSON value; `colour` is what the words round it say."""
    if isinstance(value, dict):
        named = next((c for entry in value.values() if isinstance(entry, str) and (c := _colour_of(entry))), colour)
        numbers = _numbers([entry for entry in value.values() if _is_number(entry)])
        if named and numbers:
            yield Told(named, numbers)
            return
        for key, entry in value.items():
            yield from _inside(entry, named or _colour_of(str(key)))
    elif isinstance(value, list):
        numbers = _numbers(value)
        if colour and numbers:
            yield Told(colour, numbers)
            return
        named = next((c for entry in value if isinstance(entry, str) and (c := _colour_of(entry))), colour)
        for entry in value:
            yield from _inside(entry, named)


def _in_prose(text: str) -> Iterator[Told]:
    """`<ref>red ellipse</ref><box>[[1, 2, 3, 4]]</box>`, `red: (1, 2), (3, 4)`: the colour named last before it."""
    for match in _QUAD.finditer(text):
        before = _COLOUR.findall(text[max(0, match.start() - 120) : match.start()])
        numbers = _numbers([float(number) for number in match.groups()])
        if before and numbers:
            yield Told(before[-1].lower(), numbers)


def _colour_of(words: str) -> str | None:
    match = _COLOUR.search(words[:200])
    return match.group(1).lower() if match else None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _numbers(values: list[object] | list[float]) -> tuple[float, float, float, float] | None:
    numbers = [float(value) for value in values if isinstance(value, (int, float)) and _is_number(value)]
    if len(values) != 4 or len(numbers) != 4 or max(map(abs, numbers)) > 1e6:
        return None
    first, second, third, fourth = numbers
    return first, second, third, fourth
