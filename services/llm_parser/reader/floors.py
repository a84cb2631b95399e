"""Arithmetic of floors: all readings of a request's mentions, each with the floor that it comes to.

The network scores readings; here it is only worked out what each would mean.
"""

from collections.abc import Sequence
from typing import NamedTuple

from services.llm_parser.reader.mentions import HIGHEST_FLOOR, Mention

ONE_OPERATIONS = ("itself", "plus_1", "minus_1", "plus_2", "minus_2", "plus_3", "hundreds")
PAIR_OPERATIONS = ("add", "subtract", "from_top", "add_1", "times", "subtract_1")
"""`from_top`: the b-th of a floors from the top; `add_1`, `subtract_1`: one more, one less than sum, difference."""

MOST_PAIRED = 10


class Reading(NamedTuple):
    """`operation` is an index into ONE_OPERATIONS (with `second` null) or PAIR_OPERATIONS; `first` and `second` are
    indices of mentions."""

    floor: int
    operation: int
    first: int
    second: int | None = None


def readings(mentions: Sequence[Mention]) -> list[Reading]:
    """All that come to a floor from 1 to `HIGHEST_FLOOR`."""
    found: list[Reading] = []
    for at, mention in enumerate(mentions):
        if mention.kind == "top":
            continue
        for operation, name in enumerate(ONE_OPERATIONS):
            floor = _one(name, mention.value)
            if floor is not None and 1 <= floor <= HIGHEST_FLOOR:
                found.append(Reading(floor, operation, at))
    paired = [at for at, m in enumerate(mentions) if m.kind not in ("top", "sound") and m.value <= HIGHEST_FLOOR][
        :MOST_PAIRED
    ]
    for first in paired:
        for second in paired:
            if first == second or mentions[first].kind == "one":
                continue
            for operation, name in enumerate(PAIR_OPERATIONS):
                if name in ("add", "times", "add_1") and second < first and mentions[second].kind != "one":
                    continue  # it commutes
                floor = _pair(name, mentions[first].value, mentions[second].value)
                if 1 <= floor <= HIGHEST_FLOOR:
                    found.append(Reading(floor, operation, first, second))
    return found


def _one(name: str, value: int) -> int | None:
    if name == "hundreds":
        return value // 100 if value >= 100 else None
    return value + {"itself": 0, "plus_1": 1, "minus_1": -1, "plus_2": 2, "minus_2": -2, "plus_3": 3}[name]


def _pair(name: str, a: int, b: int) -> int:
    match name:
        case "add":
            return a + b
        case "subtract":
            return a - b
        case "from_top":
            return a - b + 1
        case "add_1":
            return a + b + 1
        case "times":
            return a * b
        case _:
            return a - b - 1
