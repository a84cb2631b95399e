"""Mends misspelt words before a request is read: "red telphone" is read, and passed on, as "red telephone".

A word that no list of words has may be misspelt, and is mended to the word of customers' requests that it is most
likely a slip of. Names, rare words and other languages' words are in no list either: only a request in which several
words are misspelt for sure is mended.
"""

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from functools import lru_cache
from math import log
from typing import NamedTuple

from rapidfuzz.distance import OSA
from rapidfuzz.process import extract

from services.llm_parser.reader.mentions import ORDINALS, find_mentions, number_of

_WORD = re.compile(r"(?<![\w@/#.'’-])[A-Za-z]{4,}(?![\w'’-])")
_FLOOR = re.compile(r"\s*(?:floor|flor|flr|fl\b|level|lvl|storey|story|stry)", re.IGNORECASE)
_BEGINS = re.compile(r"(?:^|[.!?:;\n(\"*])\W*$")
_SOUNDS = (
    ("ph", "f"), ("ck", "k"), ("wh", "w"), ("qu", "kw"), ("sh", "s"), ("c", "k"), ("y", "i"), ("ea", "e"), ("ie", "i"),
)  # fmt: skip
MOST_CHARACTERS = 2000
"""So many of a request are mended."""
SURE = 2
"""So many words have to be misspelt for sure before any is mended."""
MARGIN = 0.15
_DEAREST_SHORT, _DEAREST = 1.2, 1.7
"""What it may cost to mend a word of up to five letters, and a longer one, in slips of one letter."""


class Mended(NamedTuple):
    """`places`: of each character of `text`, where it stands in the original."""

    text: str
    places: Sequence[int]

    def written(self, original: str, start: int, end: int) -> str:
        """What was written for the characters `start` to `end` (exclusive)."""
        return original[self.places[start] : self.places[end - 1] + 1] if start < end else ""


class _Slip(NamedTuple):
    start: int
    end: int
    word: str
    sure: bool


class Spelling:
    """`counts`: of every known word, how often customers write it; one that they do not write mends none. `more`: words
    that count as known until something in a request is misspelt for sure: a tokenizer knows many a slip."""

    def __init__(self, counts: Mapping[str, int], more: Container[str] = ()) -> None:
        self._counts, self._more = counts, more
        self._common = [word for word, count in counts.items() if count and len(word) > 3]
        self._sounds = [_sound(word) for word in self._common]
        self._meant = lru_cache(maxsize=4096)(self._nearest)

    def mended(self, text: str) -> Mended:
        """The request with its misspelt words mended."""
        read = Mended(text, range(len(text)))
        for strictly in (False, True):
            slips = list(self._slips(read.text, strictly))
            if not strictly and sum(slip.sure for slip in slips) < SURE:
                break
            for slip in reversed(slips):
                read = _replaced(read, slip)
        return read

    def misspelt(self, word: str) -> bool:
        """Is a word in lower case a slip for sure, whether it is in the list or not?"""
        meant = self._meant(word)
        return meant is not None and meant != word and _surely(word, meant)

    def _slips(self, text: str, strictly: bool) -> Iterator[_Slip]:
        letters = [c for c in text if c.isalpha()]
        shouted = sum(c.isupper() for c in letters) > 0.6 * len(letters)
        for found in _WORD.finditer(text, 0, MOST_CHARACTERS):
            word, lower = found.group(), found.group().lower()
            named = word[0].isupper() and not shouted
            mixed = not word.isupper() and not word[1:].islower()
            if mixed or (named and not _BEGINS.search(text[: found.start()])) or self._knows(lower, strictly):
                continue
            nth = _nth(lower) if _FLOOR.match(text, found.end()) else None
            meant = nth or self._meant(lower)
            if meant is not None:
                cased = meant.upper() if word.isupper() else meant.capitalize() if word[0].isupper() else meant
                sure = nth is not None or (_surely(lower, meant) and (not named or len(lower) > 7))
                yield _Slip(found.start(), found.end(), cased, sure)

    def _knows(self, word: str, strictly: bool) -> bool:
        forms = (word, word.removesuffix("s"))
        known = any(f in self._counts or (not strictly and f in self._more) for f in forms)
        return known or any(m.kind != "count" for m in find_mentions(word))

    def _nearest(self, word: str) -> str | None:
        """The word that costs least, where no other costs about as little; a number stays the number that it is read
        as."""
        number, sound, most = number_of(word), _sound(word), 1 if len(word) < 6 else 2
        near = [i for _, _, i in extract(word, self._common, scorer=OSA.distance, score_cutoff=most, limit=None)]
        near += [i for _, _, i in extract(sound, self._sounds, scorer=OSA.distance, score_cutoff=1, limit=None)]
        costs = {}
        for at in set(near):
            other = self._common[at]
            if number_of(other) == number:
                costs[other] = _cost(word, other, sound, self._sounds[at], most) - 0.09 * log(self._counts[other])
        best = min(costs, key=lambda w: (costs[w], w), default=None)
        if best is None or costs[best] > (_DEAREST_SHORT if len(word) < 6 else _DEAREST):
            return None
        near_best = [other for other, cost in costs.items() if cost < costs[best] + MARGIN]
        return best if all(o.startswith(best) or best.startswith(o) for o in near_best) else None


def _cost(word: str, other: str, sound: str, its_sound: str, most: int) -> float:
    """How unlikely `word` is a slip of `other`: letters left out are likelier than letters too many, and letters that
    sound alike are likelier than others."""
    letters = OSA.distance(word, other)
    cost = min(float(letters) if letters <= most else 9.0, OSA.distance(sound, its_sound) + 0.5)
    if word[0] != other[0]:
        cost += 0.7 if sound[0] != its_sound[0] else 0.2
    if len(other) < len(word) and sound != its_sound:
        cost += 0.2
    return cost + (0.25 if len(other) == len(word) and sorted(other) != sorted(word) else 0.0)


def _nth(word: str) -> str | None:
    """The ordinal that a word in front of "floor" is at most two slips of, where no other is as near."""
    near = extract(word, tuple(ORDINALS), scorer=OSA.distance, score_cutoff=2, limit=2)
    return near[0][0] if near and (len(near) == 1 or near[0][1] < near[1][1]) else None


def _surely(word: str, meant: str) -> bool:
    """One slip as it happens to people who know the word: letters exchanged, left out, doubled or not, or a vowel for
    another in a long word. Another letter may as well make another word."""
    if len(word) < 5 or word[0] != meant[0] or OSA.distance(word, meant) > 1:
        return False
    if len(word) < len(meant):
        return len(word) > 5 or set(word) == set(meant)
    vowels = len(word) > 6 and re.sub(r"[aeiou]", "", word) == re.sub(r"[aeiou]", "", meant)
    return vowels or sorted(word) == sorted(meant) or (len(word) > len(meant) and set(word) == set(meant))


def _sound(word: str) -> str:
    for letters, sound in _SOUNDS:
        word = word.replace(letters, sound)
    return re.sub(r"(.)\1", r"\1", word)


def _replaced(read: Mended, slip: _Slip) -> Mended:
    last = slip.end - slip.start - 1
    inside = [read.places[slip.start + min(i, last)] for i in range(len(slip.word) - 1)]
    places = [*read.places[: slip.start], *inside, *read.places[slip.end - 1 :]]
    return Mended(read.text[: slip.start] + slip.word + read.text[slip.end :], places)
