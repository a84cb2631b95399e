"""What a customer writes: the request templates, filled with a floor, an object and whatever else a template wants."""

import json
import string
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from contracts.sim import CatalogueEntry

_UNITS = [
    "zero",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
    "thirteen",
    "fourteen",
    "fifteen",
    "sixteen",
    "seventeen",
    "eighteen",
    "nineteen",
]
_TENS = ("", "", "twenty", "thirty", "forty", "fifty", "sixty")
_ORDINALS = {
    "one": "first",
    "two": "second",
    "three": "third",
    "five": "fifth",
    "eight": "eighth",
    "nine": "ninth",
    "twelve": "twelfth",
}
_COUNTABLE = {"bananas": "bunch of bananas", "balloons": "bunch of balloons"}
"""Plural names of single things, as something that takes an article."""

_PARCELS = (
    "parcel",
    "package",
    "birthday cake",
    "letter",
    "pizza",
    "laptop charger",
    "spare key",
    "library book",
    "first-aid kit",
    "phone case",
    "soup",
    "set of batteries",
    "camera",
    "contact lens case",
)


class Template(NamedTuple):
    """One way of putting a request; `text` has slots in braces."""

    id: str
    style: str
    text: str

    @property
    def slots(self) -> frozenset[str]:
        return frozenset(name for _, name, _, _ in string.Formatter().parse(self.text) if name)


class Fill(NamedTuple):
    """What a request talks about; `decoy_floor` differs from `floor`, `decoy` from `thing`."""

    floor: int
    thing: str
    decoy_floor: int
    decoy: str
    parcel: str


@cache
def templates() -> tuple[Template, ...]:
    """The shipped templates, in the file's order."""
    text = files("evaluation.task_set").joinpath("data", "request_templates.jsonl").read_text(encoding="utf-8")
    entries = (json.loads(line) for line in text.splitlines() if line.strip())
    return tuple(Template(entry["id"], entry["style"], entry["template"]) for entry in entries)


def filled(template: Template, fill: Fill) -> str:
    """The request in words. Raises KeyError for a slot that nobody knows."""
    values = {
        "object": fill.thing,
        "a_object": with_article(fill.thing),
        "decoy_object": fill.decoy,
        "a_decoy_object": with_article(fill.decoy),
        "parcel": fill.parcel,
        "a_parcel": fill.parcel if fill.parcel == "soup" else with_article(fill.parcel),
    }
    for prefix, floor in (("", fill.floor), ("decoy_", fill.decoy_floor)):
        values[f"{prefix}floor_number"] = str(floor)
        values[f"{prefix}floor_word"] = in_words(floor)
        values[f"{prefix}floor_ordinal"] = ordinal_digits(floor)
        values[f"{prefix}floor_ordinal_word"] = ordinal(floor)
    return template.text.format_map(values)


def noun_phrase(entry: CatalogueEntry, colour: str) -> str:
    """What people call a thing of that class and colour: no article, colour first."""
    return f"{colour} {plain_name(entry)}"


def plain_name(entry: CatalogueEntry) -> str:
    """The same without the colour."""
    return _COUNTABLE.get(entry.phrase, entry.phrase)


def draw_parcel(rng: np.random.Generator) -> str:
    """What is to be brought."""
    return _PARCELS[int(rng.integers(len(_PARCELS)))]


def in_words(number: int) -> str:
    """1..69 as a word. Raises ValueError for others."""
    if not 1 <= number <= 69:
        raise ValueError(f"floors in words run from 1 to 69, not {number}")
    if number < 20:
        return _UNITS[number]
    return _TENS[number // 10] + (f"-{_UNITS[number % 10]}" if number % 10 else "")


def ordinal(number: int) -> str:
    """1..69 as an ordinal word. Raises ValueError for others."""
    head, dash, last = in_words(number).rpartition("-")
    if last.endswith("y"):
        return f"{head}{dash}{last[:-1]}ieth"
    return f"{head}{dash}{_ORDINALS.get(last, last + 'th')}"


def ordinal_digits(number: int) -> str:
    """1st, 2nd, 3rd, 4th, ..."""
    return f"{number}{_suffix(number)}"


def _suffix(number: int) -> str:
    if number % 100 in (11, 12, 13):
        return "th"
    return {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")


def with_article(noun: str) -> str:
    return f"{'an' if noun[0].lower() in 'aeio' else 'a'} {noun}"
