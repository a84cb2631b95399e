"""Are these words the request's own? A model may shorten and reorder, not invent."""

import re
from typing import NamedTuple

from rapidfuzz.distance import OSA

_WORD = re.compile(r"[^\W_]+")
_LINK_WORDS = "a an the of with and in on at by to for its his her my our from or"
_LINKS = frozenset(_LINK_WORDS.split())


class Span(NamedTuple):
    """Characters `start` to `end` (exclusive) of the request."""

    start: int
    end: int


def object_span(name: str, request: str) -> Span | None:
    """The shortest stretch of `request` that holds all words of `name` that carry meaning, or None where one is
    missing. Plural and singular count as the same word, and so do words of five letters or more one slip apart."""
    wanted = [w for w in _WORD.findall(name.lower()) if w not in _LINKS]
    if not wanted:
        return None
    places: list[tuple[int, int, int]] = []
    for match in _WORD.finditer(request.lower()):
        for index, word in enumerate(wanted):
            if _same(word, match.group()):
                places.append((index, match.start(), match.end()))
    if {index for index, _, _ in places} != set(range(len(wanted))):
        return None
    return _shortest(places, len(wanted))


def _same(wanted: str, said: str) -> bool:
    if wanted == said or wanted.rstrip("s") == said.rstrip("s"):
        return True
    return min(len(wanted), len(said)) >= 5 and OSA.distance(wanted, said, score_cutoff=1) <= 1


def _shortest(places: list[tuple[int, int, int]], kinds: int) -> Span:
    best: Span | None = None
    counts: dict[int, int] = {}
    left = 0
    for index, _, end in places:
        counts[index] = counts.get(index, 0) + 1
        while len(counts) == kinds:
            first, start, _ = places[left]
            if best is None or end - start < best.end - best.start:
                best = Span(start, end)
            counts[first] -= 1
            if not counts[first]:
                del counts[first]
            left += 1
    assert best is not None
    return best
