"""Arithmetic of floors: all readings of a request's mentions, each with the floor that it comes to.

The network scores readings; here it is only worked out what each would mean.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

from services.llm_parser.reader.mentions import HIGHEST_FLOOR, Mention

_ONE: Mapping[str, Callable[[int], int]] = {
    "itself": lambda a: a,
    "plus_1": lambda a: a + 1,
    "minus_1": lambda a: a - 1,
    "plus_2": lambda a: a + 2,
    "minus_2": lambda a: a - 2,
    "plus_3": lambda a: a + 3,
    "hundreds": lambda a: a // 100,
}
_PAIR: Mapping[str, Callable[[int, int], int]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "from_top": lambda a, b: a - b + 1,
    "add_1": lambda a, b: a + b + 1,
    "times": lambda a, b: a * b,
    "subtract_1": lambda a, b: a - b - 1,
}
ONE_OPERATIONS, PAIR_OPERATIONS = tuple(_ONE), tuple(_PAIR)
"""Of one mention and of two, as the network's outputs stand. `from_top`: the b-th of a floors from the top; `add_1`,
`subtract_1`: one more, one less than sum, difference."""
_COMMUTE = frozenset(["add", "times", "add_1"])

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
        if mention.kind != "top":
            found += [Reading(one(mention.value), n, at) for n, one in enumerate(_ONE.values())]
    paired = [at for at, m in enumerate(mentions) if m.kind not in ("top", "sound") and m.value <= HIGHEST_FLOOR]
    for first, second in permutations(paired[:MOST_PAIRED], 2):
        a, b = mentions[first], mentions[second]
        if a.kind != "one":
            found += [
                Reading(pair(a.value, b.value), n, first, second)
                for n, (name, pair) in enumerate(_PAIR.items())
                if first < second or b.kind == "one" or name not in _COMMUTE
            ]
    return [reading for reading in found if 1 <= reading.floor <= HIGHEST_FLOOR]
