"""Chance edits of rows: other floors, other objects, other people's sentences, slips, case. Labels stay true."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.llm_parser.reader.mentions import CARDINALS, ORDINALS, find_mentions
from training.parser import phrases
from training.parser.rows import Relation, Row, Span

_ARITHMETIC = frozenset(
    ["relative_floor", "european_floor", "ground_floor", "ambiguous", "relation", "flat_number", "correction", "voice"]
)
_SENTENCE = re.compile(r"[^.!?\n;]+[.!?\n;]*\s*")
_WORDS = {v: k for k, v in CARDINALS.items() if v}
_NTH = {v: k for k, v in ORDINALS.items()}


class Augmenter:
    """Draws from `generator`; `rows` lend their objects and sentences."""

    def __init__(self, rows: Sequence[Row], generator: np.random.Generator) -> None:
        self._rows = rows
        self._g = generator
        self._objects = [
            r
            for r in rows
            if r.object and len(r.object_spans) == 1 and 2 <= len(r.text[slice(*r.object_spans[0])].split()) <= 7
        ]
        self._fillers = [s for r in rows for s in _free_sentences(r)]

    def __call__(self, row: Row) -> Row:
        g = self._g
        if g.random() < 0.12:
            made = self._made()
            if made is not None:
                row = made
        if g.random() < 0.35:
            row = self._other_floor(row)
        if g.random() < 0.35:
            row = self._other_object(row)
        if g.random() < 0.15:
            row = self._without_a_sentence(row)
        if g.random() < 0.2:
            row = self._with_a_filler(row)
        if g.random() < 0.12:
            row = self._with_a_neighbour(row)
        if g.random() < 0.15:
            row = self._with_slips(row)
        draw = g.random()
        if draw < 0.08:
            row = replace(row, text=_same_length(row.text, row.text.upper()))
        elif draw < 0.25:
            row = replace(row, text=_same_length(row.text, row.text.lower()))
        if g.random() < 0.08:
            row = replace(row, text=re.sub(r"(?<=\w)[.,;:!?](?=\s|$)", lambda m: " ", row.text))
        return row

    def _other_floor(self, row: Row) -> Row:
        if row.floor is None or row.tags & _ARITHMETIC or not row.floor_spans:
            return row
        inside = [
            m
            for m in find_mentions(row.text)
            if m.value == row.floor and m.kind == "count" and any(s.holds(m.start, m.end) for s in row.floor_spans)
        ]
        if len(inside) != 1:
            return row
        taken = {m.value for m in find_mentions(row.text)}
        choices = [f for f in range(1, 31) if f not in taken]
        weights = np.array([1.0 / (3 + f) for f in choices])
        floor = int(self._g.choice(choices, p=weights / weights.sum()))
        old = row.text[inside[0].start : inside[0].end]
        return replace(row.replaced(Span(inside[0].start, inside[0].end), _like(old, floor)), floor=floor)

    def _other_object(self, row: Row) -> Row:
        if row.object is None or len(row.object_spans) != 1 or row.relation is not None:
            return row
        other = self._objects[int(self._g.integers(len(self._objects)))]
        span, theirs = row.object_spans[0], other.object_spans[0]
        words = other.text[theirs.start : theirs.end]
        if find_mentions(words) or find_mentions(row.text[span.start : span.end]):
            return row
        changed = row.replaced(span, words)
        changed = replace(changed, object=other.object, also_ok=other.also_ok)
        before = changed.text[: changed.object_spans[0].start]
        article = re.search(r"\b(a|an)(\s+)$", before, re.IGNORECASE)
        if article and words:
            right = "an" if words[0].lower() in "aeiou" else "a"
            if article[1][0].isupper():
                right = right.capitalize()
            changed = changed.replaced(Span(article.start(1), article.end(1)), right)
        return changed

    def _without_a_sentence(self, row: Row) -> Row:
        pieces = [Span(m.start(), m.end()) for m in _SENTENCE.finditer(row.text)]
        if len(pieces) < 2 or row.tags & {"ambiguous", "european_floor", "correction"}:
            return row
        free = [p for p in pieces if not any(s.start < p.end and p.start < s.end for s in row.labelled)]
        if not free or (row.floor is None or row.object is None):
            return row
        return row.replaced(free[int(self._g.integers(len(free)))], "")

    def _with_a_filler(self, row: Row) -> Row:
        filler = self._fillers[int(self._g.integers(len(self._fillers)))].strip()
        return _beside(row, filler, self._g.random() < 0.5)

    def _with_a_neighbour(self, row: Row) -> Row:
        """Somebody else's floor or object in a sentence of its own."""
        other = self._objects[int(self._g.integers(len(self._objects)))]
        thing = other.text[slice(*other.object_spans[0])]
        floor = int(self._g.integers(1, 16))
        who = self._g.choice(phrases.PEOPLE)
        form = str(self._g.choice(phrases.NEIGHBOURS))
        said = form.format(who=who, Who=who.capitalize(), thing=thing, floor=floor, nth=_nth(floor), word=_NTH[floor])
        return _beside(row, said, self._g.random() < 0.5)

    def _with_slips(self, row: Row) -> Row:
        for _ in range(int(self._g.integers(1, 4))):
            places = list(re.finditer(r"[A-Za-z]{4,}", row.text))
            if not places:
                return row
            m = places[int(self._g.integers(len(places)))]
            word = m.group()
            at = int(self._g.integers(1, len(word) - 1))
            kind = self._g.random()
            if kind < 0.4:
                new = word[:at] + word[at + 1] + word[at] + word[at + 2 :]
            elif kind < 0.75:
                new = word[:at] + word[at + 1 :]
            else:
                new = word[:at] + word[at] + word[at:]
            row = row.replaced(Span(m.start(), m.end()), new)
        return row

    def _made(self) -> Row | None:
        """A request put together from phrases: European counting, chains, doubt, relations."""
        g = self._g
        other = self._objects[int(g.integers(len(self._objects)))]
        thing = other.text[slice(*other.object_spans[0])]
        if find_mentions(thing):
            return None
        a = int(g.integers(1, 15))
        b = int(g.integers(1, 5))
        kind = g.random()
        if kind < 0.3:
            form, add = phrases.EUROPEAN[int(g.integers(len(phrases.EUROPEAN)))]
            return _built(
                form.format(n=_any(g, a), nth=_nth(a), word=_NTH[a]), a + add, thing, other, g, {"european_floor"}
            )
        if kind < 0.55:
            form, sign = phrases.CHAINS[int(g.integers(len(phrases.CHAINS)))]
            value = a + sign * b
            if not 1 <= value <= 30:
                return None
            said = form.format(
                a=_any(g, a), nth=_nth(a), b=_WORDS[b], who=g.choice(phrases.PEOPLE), s="" if b == 1 else "s"
            )
            return _built(said, value, thing, other, g, {"relative_floor"})
        if kind < 0.75:
            form = str(g.choice(phrases.DOUBTS))
            return _built(form.format(a=_nth(a), b=_nth(a + 1), n=a, m=a + 1), None, thing, other, g, {"ambiguous"})
        side = str(g.choice(["left", "right", "above", "below"]))
        form = str(g.choice(phrases.RELATIONS[side]))
        said = form.format(thing="\0", floor=_nth(a), s="", count=_WORDS[b])
        at = said.index("\0")
        text = said.replace("\0", thing)
        floor = str(g.choice(phrases.ON)).format(n=_any(g, a), nth=_nth(a))
        lead = floor[0].upper() + floor[1:] + ". "
        return Row(
            text=lead + text,
            floor=a,
            object=None,
            also_ok=(),
            floor_spans=(Span(0, len(floor)),),
            object_spans=(),
            relation=Relation(
                side, b if "{count}" in form else 1, (Span(len(lead) + at, len(lead) + at + len(thing)),)
            ),
            tags=frozenset({"relation"}),
        )


def _built(floor: str, value: int | None, thing: str, other: Row, g: np.random.Generator, tags: set[str]) -> Row:
    form = str(g.choice(phrases.JOINS))
    text = form.replace("{thing}", "\1").replace("{floor}", "\2").replace("{Floor}", "\3")
    out, spans, floors = "", [], []
    for piece in re.split("([\1\2\3])", text):
        if piece == "\1":
            spans.append(Span(len(out), len(out) + len(thing)))
            out += thing
        elif piece in ("\2", "\3"):
            said = floor if piece == "\2" else floor[0].upper() + floor[1:]
            floors.append(Span(len(out), len(out) + len(said)))
            out += said
        else:
            out += piece
    return Row(
        text=out,
        floor=value,
        object=other.object,
        also_ok=other.also_ok,
        floor_spans=tuple(floors) if value is not None else (),
        object_spans=tuple(spans),
        relation=None,
        tags=frozenset(tags),
    )


def _free_sentences(row: Row) -> list[str]:
    pieces = list(_SENTENCE.finditer(row.text))
    if len(pieces) < 2 or row.floor is None or row.object is None or row.tags & {"relative_floor", "european_floor"}:
        return []
    return [
        m.group()
        for m in pieces
        if len(m.group()) > 8
        and not any(n.kind in ("count", "ground", "top") for n in find_mentions(m.group()))
        and not any(s.start < m.end() and m.start() < s.end for s in row.labelled)
    ]


def _beside(row: Row, said: str, before: bool) -> Row:
    if before:
        end = "" if said[-1:] in ".!?;" else "."
        return row.replaced(Span(0, 0), f"{said}{end} ")
    end = "" if row.text.rstrip()[-1:] in ".!?;" else "."
    return row.replaced(Span(len(row.text), len(row.text)), f"{end} {said}")


def _same_length(old: str, new: str) -> str:
    return new if len(new) == len(old) else old


def _nth(value: int) -> str:
    ending = "th" if value % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(value % 10, "th")
    return f"{value}{ending}"


def _any(g: np.random.Generator, value: int) -> str:
    return str(value) if g.random() < 0.5 or value not in _WORDS else _WORDS[value]


def _like(old: str, value: int) -> str:
    """The number in the form of the old one."""
    if re.fullmatch(r"\d+", old):
        return str(value)
    if re.match(r"\d", old):
        return (
            _nth(value)
            if old.rstrip(".").lower().endswith(("st", "nd", "rd", "th"))
            else str(value) + old.lstrip("0123456789")
        )
    low = old.lower()
    if low in ORDINALS or low.split("-")[-1].split(" ")[-1] in ORDINALS:
        new = _NTH.get(value) or f"{_WORDS[value - value % 10]}-{_NTH[value % 10]}" if value < 30 else _nth(value)
    elif low in CARDINALS:
        new = _WORDS.get(value) or f"{_WORDS[value - value % 10]}-{_WORDS[value % 10]}"
    else:
        return str(value)
    return new.capitalize() if old[0].isupper() else new
