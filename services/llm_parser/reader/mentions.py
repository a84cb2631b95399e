"""Every number, or word that counts, that a floor could be read from: where it stands and what it is worth.

The finder is generous: whether a mention is a floor, a price or a house number is learned, not decided here.
"""

import re
from functools import lru_cache
from typing import NamedTuple

from rapidfuzz.distance import OSA

HIGHEST_FLOOR = 200
MOST_MENTIONS = 24

_CARDINALS = (
    "one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen seventeen "
    "eighteen nineteen twenty thirty forty fifty sixty seventy eighty ninety"
)
_ORDINALS = (
    "first second third fourth fifth sixth seventh eighth ninth tenth eleventh twelfth thirteenth fourteenth fifteenth "
    "sixteenth seventeenth eighteenth nineteenth twentieth thirtieth fortieth fiftieth sixtieth seventieth eightieth "
    "ninetieth"
)
_VALUES = (*range(1, 20), *range(20, 100, 10))
CARDINALS: dict[str, int] = {**dict(zip(_CARDINALS.split(), _VALUES, strict=True)), "fourty": 40, "zero": 0}
ORDINALS: dict[str, int] = dict(zip(_ORDINALS.split(), _VALUES, strict=True))
_ROMAN = {
    "i": 1, "ii": 2, "iii": 3, "iv": 4, "v": 5, "vi": 6, "vii": 7, "viii": 8, "ix": 9, "x": 10, "xi": 11, "xii": 12,
}  # fmt: skip
_ELSEWHERE = {
    "premier": 1, "deuxième": 2, "deuxieme": 2, "troisième": 3, "troisieme": 3, "quatrième": 4, "quatrieme": 4,
    "cinquième": 5, "cinquieme": 5, "primo": 1, "secondo": 2, "terzo": 3, "quarto": 4, "quinto": 5, "sesto": 6,
    "primero": 1, "segundo": 2, "tercero": 3, "tercer": 3, "cuarto": 4, "sexto": 6, "erste": 1, "ersten": 1,
    "erster": 1,
    "zweite": 2, "zweiten": 2, "zweites": 2, "dritte": 3, "dritten": 3, "drittes": 3, "vierte": 4, "vierten": 4,
    "viertes": 4, "fünfte": 5, "fünften": 5, "eerste": 1, "tweede": 2, "derde": 3, "vierde": 4, "prvi": 1, "drugi": 2,
    "treći": 3, "peti": 5, "första": 1, "andra": 2, "tredje": 3, "pierwsze": 1, "drugie": 2, "trzecie": 3,
}  # fmt: skip
_GROUND = (
    r"ground level|ground floor|ground flr|grnd|gnd|gr\.?\s?fl|groundfloor|ground|street level"
    "|pavement level|lobby level|parter|parterre"
    "|rez-de-chaussée|rez de chaussée|rdc|erdgeschoss|piano terra|bajo|planta baja|prizemlje|přízemí|zemin|entresuelo"
    "|begane grond|bottom floor|bottom|lowest floor|lowest|doorbell level|entrance level"
)
_ONES = (
    "one|a|another|next|directly|right|straight|just|immediately|single|upstairs|downstairs|above|below|over|under"
    "|higher|lower|up|down|beneath|underneath"
)
_COUPLE = {"couple": 2, "twice": 2, "double": 2, "pair": 2, "half": 2, "halfway": 2, "dozen": 12, "both": 2,
           "triple": 3, "thrice": 3, "trio": 3}  # fmt: skip
_TOP = "topmost|top floor|top|highest|uppermost|penthouse|last floor|roof|attic|under the roof"

_ROMAN_FLOOR = re.compile(
    r"[.,e]{0,2}\s*(?:pi[ęe]tro|[ée]tage|stock|og\b|kat\b|floor|level|piano|emelet)", re.IGNORECASE
)

_SCAN = re.compile(
    rf"""
    (?P<keycaps>(?:[0-9]\ufe0f?\u20e3)+|🔟)
  | (?P<digits>(?<!\d)(?<!\d[.,:])\d{{1,4}}(?!\d))
  | (?P<ground>\b(?:{_GROUND.replace(" ", chr(92) + "s")})\b)
  | (?P<top>\b(?:{_TOP.replace(" ", chr(92) + "s")})\b)
  | (?P<word>[^\W\d_]+)
    """,
    re.VERBOSE | re.IGNORECASE,
)
_ONE_WORDS = frozenset(_ONES.split("|"))
_FLOOR_BEFORE = re.compile(r"\b(?:floor|level|storey|story|flr|number)\s+(?:is\s+)?$", re.IGNORECASE)
_SOUNDS = {"to": 2, "too": 2, "for": 4, "ate": 8, "won": 1}
"""What dictation makes of a number."""


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
                if raw in _ONE_WORDS:
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
    for table in (CARDINALS, ORDINALS, _COUPLE, _ELSEWHERE):
        if word in table:
            return table[word]
    for ending in ("floor", "flr", "storey", "level"):
        if word.endswith(ending) and len(word) > len(ending) + 2:
            return number_of(word.removesuffix(ending))
    if word.endswith(("th", "rd", "nd", "st")) and word[:-2] in CARDINALS:
        return CARDINALS[word[:-2]]
    return _misspelt(word) if 4 <= len(word) <= 12 else None


_TARGETS = {w: v for table in (CARDINALS, ORDINALS) for w, v in table.items() if len(w) >= 4}
_NOT = (
    "form firm fist fit vase sever sent tent night nigh light right thirsty sixty oven even nice fine line mine tine "
    "pine wine fire file give live dive hive teeth month find fort worth north sevens ones twos threes turd bird weird "
    "sight might height weight seve severity seconds never fever lever birth girth mirth earth heart tooth"
)
_NO_NUMBERS = frozenset(_NOT.split()) - _TARGETS.keys()
_SLIPS = {"foruth": 4, "forth": 4, "fouth": 4, "fith": 5, "sixt": 6, "sevnth": 7, "eigth": 8, "nineth": 9, "ninght": 9,
          "tenht": 10, "secnd": 2, "secound": 2, "thrid": 3, "thrd": 3, "furst": 1, "frist": 1, "tird": 3, "sven": 7,
          "tree": 3, "fore": 4, "twelf": 12, "twelth": 12, "twelveth": 12, "sicks": 6}  # fmt: skip


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
