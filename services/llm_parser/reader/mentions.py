"""Every number, or word that counts, that a floor could be read from: where it stands and what it is worth.

The finder is generous: whether a mention is a floor, a price or a house number is learned, not decided here.
"""

import re
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from rapidfuzz.distance import OSA

HIGHEST_FLOOR = 200
MOST_MENTIONS = 24

_TABLES = tomllib.loads(Path(__file__).with_name("numbers.toml").read_text(encoding="utf-8"))


def _values(table: str) -> dict[str, int]:
    return {word: int(value) for value, words in _TABLES[table].items() for word in words.split()}


_VALUES = (*range(1, 20), *range(20, 100, 10))
CARDINALS: dict[str, int] = {**dict(zip(_TABLES["cardinals"].split(), _VALUES, strict=True)), "fourty": 40, "zero": 0}
ORDINALS: dict[str, int] = dict(zip(_TABLES["ordinals"].split(), _VALUES, strict=True))
_ROMAN: dict[str, int] = {word: value for value, word in enumerate(_TABLES["roman"].split(), 1)}
_WORTH, _SLIPS, _SOUNDS = _values("worth"), _values("slips"), _values("sounds")
_GROUND, _TOP = ("|".join(_TABLES[name]).replace(" ", r"\s") for name in ("ground", "top"))
_ROMAN_FLOOR = re.compile(
    r"[.,e]{0,2}\s*(?:pi[ęe]tro|[ée]tage|stock|og\b|kat\b|floor|level|piano|emelet)", re.IGNORECASE
)

_SCAN = re.compile(
    rf"""
    (?P<keycaps>(?:[0-9]\ufe0f?\u20e3)+|🔟)
  | (?P<digits>(?<!\d)(?<!\d[.,:])\d{{1,4}}(?!\d))
  | (?P<ground>\b(?:{_GROUND})\b)
  | (?P<top>\b(?:{_TOP})\b)
  | (?P<word>[^\W\d_]+)
    """,
    re.VERBOSE | re.IGNORECASE,
)
_NEXT = frozenset(_TABLES["next"])
_FLOOR_BEFORE = re.compile(r"\b(?:floor|level|storey|story|flr|number)\s+(?:is\s+)?$", re.IGNORECASE)


class Mention(NamedTuple):
    """Characters `start` to `end` (exclusive), worth `value`. `kind`: `count` (a number), `ground` (worth 1), `top`
    (worth 0: nothing is known without the whole), `one` (a word that means the next one, worth 1), `sound` (a word that
    sounds like a number)."""

    start: int
    end: int
    value: int
    kind: str


def find_mentions(text: str) -> tuple[Mention, ...]:
    """In the order of the text, at most `MOST_MENTIONS`; words that merely mean "the next one" give way first."""
    found: list[Mention] = []
    words = [(m.lastgroup or "", m.start(), m.end(), m.group().lower()) for m in _SCAN.finditer(text)]
    skip = -1
    for at, (group, start, end, raw) in enumerate(words):
        if at <= skip:
            continue
        if group == "digits":
            found.append(Mention(start, _with_suffix(text, end), int(raw), "count"))
        elif group == "keycaps":
            digits = "".join(c for c in raw if c.isdigit()) or "10"
            found.append(Mention(start, end, int(digits[:4]), "count"))
        elif group == "ground":
            found.append(Mention(start, end, 1, "ground"))
        elif group == "top":
            found.append(Mention(start, end, 0, "top"))
        else:
            number = _roman(text, start, end) if raw in _ROMAN else number_of(raw)
            if number is None:
                if raw in _NEXT:
                    found.append(Mention(start, end, 1, "one"))
                elif raw in _SOUNDS and _FLOOR_BEFORE.search(text, max(0, start - 16), start):
                    found.append(Mention(start, end, _SOUNDS[raw], "sound"))
                continue
            value, last = number, at
            if 20 <= value < 100 and value % 10 == 0 and raw not in ORDINALS and at + 1 < len(words):
                _, next_start, next_end, following = words[at + 1]
                unit = number_of(following) if text[end:next_start] in (" ", "-", "") else None
                if unit is not None and 0 < unit < 10:
                    value, end, last = value + unit, next_end, at + 1
            found.append(Mention(start, end, value, "count"))
            skip = last
    if len(found) > MOST_MENTIONS:
        counts = [m for m in found if m.kind in ("count", "ground", "top")][:MOST_MENTIONS]
        ones = [m for m in found if m.kind in ("one", "sound")][: MOST_MENTIONS - len(counts)]
        found = sorted(counts + ones)
    return tuple(found)


def _with_suffix(text: str, end: int) -> int:
    suffix = re.match(r"(?:st|nd|rd|th|er|e|º|ª|°|\.)?(?![a-z])", text[end:].lower())
    return end + (suffix.end() if suffix else 0)


def _roman(text: str, start: int, end: int) -> int | None:
    """A Roman numeral in capitals; "I" alone is one only beside another language's word for a floor."""
    word = text[start:end]
    if not word.isupper():
        return None
    if word in ("I", "V", "X") and not _ROMAN_FLOOR.match(text, end):
        return None
    return _ROMAN[word.lower()]


def number_of(word: str) -> int | None:
    """What a word in lower case is worth, misspelt ones included; null for one that is no number."""
    for table in (CARDINALS, ORDINALS, _WORTH):
        if word in table:
            return table[word]
    for ending in ("floor", "flr", "storey", "level"):
        if word.endswith(ending) and len(word) > len(ending) + 2:
            return number_of(word.removesuffix(ending))
    if word.endswith(("th", "rd", "nd", "st")) and word[:-2] in CARDINALS:
        return CARDINALS[word[:-2]]
    return _misspelt(word) if 4 <= len(word) <= 12 else None


_TARGETS = {w: v for table in (CARDINALS, ORDINALS) for w, v in table.items() if len(w) >= 4}
_NO_NUMBERS = frozenset(_TABLES["no_numbers"].split()) - _TARGETS.keys()


@lru_cache(maxsize=4096)
def _misspelt(word: str) -> int | None:
    """The number that a misspelt word means: one slip from exactly one number word."""
    if word in _SLIPS:
        return _SLIPS[word]
    if word in _NO_NUMBERS:
        return None
    near = {
        v for w, v in _TARGETS.items() if abs(len(w) - len(word)) <= 1 and OSA.distance(w, word, score_cutoff=1) <= 1
    }
    return near.pop() if len(near) == 1 else None
