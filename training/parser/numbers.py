"""Numbers in words and figures, as people write them."""

import re

import numpy as np

from services.llm_parser.reader.mentions import CARDINALS, ORDINALS

WORDS = {v: k for k, v in CARDINALS.items() if v}
NTH = {v: k for k, v in ORDINALS.items()}


def nth(value: int) -> str:
    """4 is "4th"."""
    ending = "th" if value % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(value % 10, "th")
    return f"{value}{ending}"


def ordinal(value: int) -> str:
    """4 is "fourth"."""
    if value in NTH:
        return NTH[value]
    return f"{WORDS[value - value % 10]}-{NTH[value % 10]}" if value < 100 else nth(value)


def in_any_form(g: np.random.Generator, value: int) -> str:
    """A figure or a word."""
    return str(value) if g.random() < 0.5 or value not in WORDS else WORDS[value]


def like(old: str, value: int) -> str:
    """The number in the form of the old one."""
    if re.fullmatch(r"\d+", old):
        return str(value)
    if re.match(r"\d", old):
        return (
            nth(value)
            if old.rstrip(".").lower().endswith(("st", "nd", "rd", "th"))
            else str(value) + old.lstrip("0123456789")
        )
    low = old.lower()
    if low in ORDINALS or low.split("-")[-1].split(" ")[-1] in ORDINALS:
        new = NTH.get(value) or f"{WORDS[value - value % 10]}-{NTH[value % 10]}" if value < 30 else nth(value)
    elif low in CARDINALS:
        new = WORDS.get(value) or f"{WORDS[value - value % 10]}-{WORDS[value % 10]}"
    else:
        return str(value)
    return new.capitalize() if old[0].isupper() else new
