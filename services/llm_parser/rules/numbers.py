"""English number words, cardinal and ordinal."""

from collections.abc import Sequence
from typing import NamedTuple

_UNITS = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine"]
_TEENS = ["ten", "eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen"]
_TENS = ["twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"]
_ORDINAL_UNITS = ["first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth"]
_ORDINAL_TEENS = [
    "tenth",
    "eleventh",
    "twelfth",
    "thirteenth",
    "fourteenth",
    "fifteenth",
    "sixteenth",
    "seventeenth",
    "eighteenth",
    "nineteenth",
]
_ORDINAL_TENS = ["twentieth", "thirtieth", "fortieth", "fiftieth", "sixtieth", "seventieth", "eightieth", "ninetieth"]

CARDINALS: dict[str, int] = {
    **{word: 1 + i for i, word in enumerate(_UNITS)},
    **{word: 10 + i for i, word in enumerate(_TEENS)},
    **{word: 20 + 10 * i for i, word in enumerate(_TENS)},
    "fourty": 40,
}
ORDINALS: dict[str, int] = {
    **{word: 1 + i for i, word in enumerate(_ORDINAL_UNITS)},
    **{word: 10 + i for i, word in enumerate(_ORDINAL_TEENS)},
    **{word: 20 + 10 * i for i, word in enumerate(_ORDINAL_TENS)},
}


class NumberWords(NamedTuple):
    """What the first `used` words say; `value` is 10**6 where they spell digits rather than a count."""

    value: int
    ordinal: bool
    used: int


def read_number_words(words: Sequence[str]) -> NumberWords:
    """The longest number at the head of `words`, of which the first is a number word.

    "twenty first" is 21st, "one hundred and two" 102; "twelve oh three" and "five five five" spell digits.
    """
    first = words[0]
    if first in ORDINALS:
        return NumberWords(ORDINALS[first], True, 1)
    value, used = CARDINALS[first], 1
    following = words[1] if len(words) > 1 else ""
    if value >= 20 and value % 10 == 0:
        if following in ORDINALS and ORDINALS[following] < 10:
            return NumberWords(value + ORDINALS[following], True, 2)
        if following in CARDINALS and CARDINALS[following] < 10:
            value, used = value + CARDINALS[following], 2
    spelled = False
    while used < len(words):
        word = words[used]
        if word == "hundred" and value < 10:
            value, used = value * 100, used + 1
            rest = used + (used < len(words) and words[used] == "and")
            if rest < len(words) and (words[rest] in CARDINALS or words[rest] in ORDINALS):
                more = read_number_words(words[rest:])
                return NumberWords(value + more.value, more.ordinal, rest + more.used)
        elif word == "thousand":
            value, used, spelled = 10**6, used + 1, True
        elif word in ("oh", "o", "zero") and used + 1 < len(words) and words[used + 1] in CARDINALS:
            used, spelled = used + 2, True
        elif word in CARDINALS:
            used, spelled = used + 1, True
        else:
            break
    return NumberWords(10**6 if spelled else value, False, used)


def number_word(value: int) -> str:
    """1..99 in words: 21 is "twenty-one"."""
    if value < 10:
        return _UNITS[value - 1]
    if value < 20:
        return _TEENS[value - 10]
    tens = _TENS[value // 10 - 2]
    return tens if value % 10 == 0 else f"{tens}-{_UNITS[value % 10 - 1]}"


def ordinal_word(value: int) -> str:
    """1..99 as an ordinal in words: 21 is "twenty-first"."""
    if value < 10:
        return _ORDINAL_UNITS[value - 1]
    if value < 20:
        return _ORDINAL_TEENS[value - 10]
    if value % 10 == 0:
        return _ORDINAL_TENS[value // 10 - 2]
    return f"{_TENS[value // 10 - 2]}-{_ORDINAL_UNITS[value % 10 - 1]}"


def ordinal_suffix(value: int) -> str:
    """ "st", "nd", "rd" or "th", as English writes it behind `value`."""
    if value % 100 in (11, 12, 13):
        return "th"
    return {1: "st", 2: "nd", 3: "rd"}.get(value % 10, "th")
