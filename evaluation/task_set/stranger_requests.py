"""Requests by strangers: templates that no parser of this project was trained on or tuned to, filled."""

import json
import re
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from contracts.sim import CatalogueEntry
from evaluation.task_set.requests import in_words, noun_phrase, ordinal, ordinal_digits, plain_name, with_article

_SLOT = re.compile(r"\{([A-Z_]+)(?::([a-z]+))?\}")


class StrangerTemplate(NamedTuple):
    """`id` counts from s001; `style` is its first tag."""

    id: str
    style: str
    text: str

    @property
    def splits(self) -> bool:
        """Colour and thing stand apart."""
        return "{COLOUR}" in self.text


class Wanted(NamedTuple):
    """What a request talks about; `other_floor` differs from `floor`, `decoy` from the thing."""

    floor: int
    entry: CatalogueEntry
    colour: str
    other_floor: int
    decoy: str


@cache
def stranger_templates() -> tuple[StrangerTemplate, ...]:
    """The shipped ones, in the file's order."""
    text = files("evaluation.task_set").joinpath("data", "request_templates_strangers.jsonl").read_text("utf-8")
    entries = [json.loads(line) for line in text.splitlines() if line.strip()]
    return tuple(
        StrangerTemplate(f"s{number:03d}", (entry["tags"] or ["plain"])[0], entry["text"])
        for number, entry in enumerate(entries, start=1)
    )


def fits(template: StrangerTemplate, wanted: Wanted) -> bool:
    """A thing whose name holds its colour can't be told apart from it."""
    return not (template.splits and wanted.colour in plain_name(wanted.entry).split())


def filled_by_stranger(template: StrangerTemplate, wanted: Wanted) -> str:
    """The request in words. Raises KeyError for a slot that nobody knows."""
    whole, thing = noun_phrase(wanted.entry, wanted.colour), plain_name(wanted.entry)
    words = {
        "OBJECT": whole,
        "A_OBJECT": with_article(whole),
        "COLOUR": wanted.colour,
        "THING": thing,
        "A_THING": with_article(thing),
        "DECOY": wanted.decoy,
        "A_DECOY": with_article(wanted.decoy),
    }

    def put(slot: re.Match[str]) -> str:
        name, form = slot.group(1), slot.group(2)
        if form is None:
            return words[name]
        return _floor({"FLOOR": wanted.floor, "OTHER_FLOOR": wanted.other_floor}[name], form)

    return _SLOT.sub(put, template.text)


def _floor(number: int, form: str) -> str:
    ways: dict[str, Callable[[int], str]] = {
        "ordinal": ordinal,
        "digits": str,
        "nth": ordinal_digits,
        "word": in_words,
    }
    return ways[form](number)
