"""Chance edits of rows: other floors, other objects, other people's sentences, slips, case. Labels stay true."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.llm_parser.reader.decode import content
from services.llm_parser.reader.floors import ONE_OPERATIONS, PAIR_OPERATIONS, Reading, readings
from services.llm_parser.reader.mentions import CARDINALS, ORDINALS, Mention, find_mentions
from training.parser import phrases
from training.parser.made import Maker, Thing
from training.parser.numbers import like
from training.parser.rows import Row, Span

_ARITHMETIC = frozenset(["relative_floor", "european_floor", "ground_floor", "ambiguous", "correction", "voice"])
_SENTENCE = re.compile(r"[^.!?\n;]+[.!?\n;]*\s*")
_WORDS = {v: k for k, v in CARDINALS.items() if v}
_NTH = {v: k for k, v in ORDINALS.items()}


class Augmenter:
    """Draws from `generator`; `rows` lend their objects and sentences."""

    def __init__(self, rows: Sequence[Row], generator: np.random.Generator) -> None:
        self._rows = rows
        self._g = generator
        self._maker = Maker(generator)
        self._objects = [
            r
            for r in rows
            if r.object and len(r.object_spans) == 1 and len(_words_of(r, r.object_spans[0]).split()) <= 8
        ]
        self._fillers = [s for r in rows for s in _free_sentences(r)]

    def __call__(self, row: Row) -> Row:
        g = self._g
        if g.random() < 0.15:
            row = self._maker.request(self._thing()) or row
        elif g.random() < 0.12:
            row = self._told_otherwise(row)
        elif g.random() < 0.4:
            row = self._other_floor(row)
        if g.random() < 0.4:
            row = self._other_object(row)
        if g.random() < 0.12:
            row = self._without_a_sentence(row)
        if g.random() < 0.06:
            row = _without_its_object(row)
        while g.random() < 0.22:
            row = self._with(row, str(g.choice(self._fillers)).strip())
        while g.random() < 0.2:
            row = self._with(row, self._of_a_neighbour())
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
        """The number that the floor is read from moved by so many, and the floor with it. An open floor stays open."""
        if row.tags & _ARITHMETIC and self._g.random() < 0.5:
            return row  # other words of the row may hang on its numbers
        mentions = find_mentions(row.text)
        moved = [m for m in mentions if m.kind == "count" and 1 <= m.value <= 40]
        if row.floor is None:
            by = int(self._g.integers(1, 7))
            if "ambiguous" not in row.tags or len({m.value for m in moved}) != len(moved):
                return row
            for m in reversed(moved):
                row = row.replaced(Span(m.start, m.end), like(row.text[m.start : m.end], m.value + by))
            return row
        inside = {i for i, m in enumerate(mentions) if any(s.holds(m.start, m.end) for s in row.floor_spans)}
        read = [r for r in readings(mentions) if r.floor == row.floor and {r.first, r.second} <= inside | {None}]
        plainest = min((_plainness(r, mentions) for r in read), default=0)
        right = [r for r in read if _plainness(r, mentions) == plainest]
        for at in sorted(inside):
            m = mentions[at]
            alone = sum(other.value == m.value for other in mentions) == 1
            if m not in moved or not alone or not right or not all(_moves_with(r, at) for r in right):
                continue
            least, most = max(1 - m.value, 1 - row.floor), 30 - max(row.floor, m.value)
            taken = {other.value - m.value for other in mentions}
            shifts = [by for by in range(least, most + 1) if by not in taken and m.value + by >= 1]
            if shifts:
                weights = np.array([1.0 / (3 + row.floor + by) for by in shifts])
                by = int(self._g.choice(shifts, p=weights / weights.sum()))
                said = like(row.text[m.start : m.end], m.value + by)
                return replace(row.replaced(Span(m.start, m.end), said), floor=row.floor + by)
        return row

    def _told_otherwise(self, row: Row) -> Row:
        """Another floor, said in another way, where the row says its own in one plain place."""
        if row.floor is None or len(row.floor_spans) != 1 or row.tags & _ARITHMETIC:
            return row
        span = row.floor_spans[0]
        before = re.search(
            r"(?:\b(?:on|at|to|in|it's|its)\s+)?(?:\b(?:the|my|our|a)\s+)?$", row.text[: span.start], re.I
        )
        after = re.match(r"\s*(?:floor|level|storey|story|flr?)\b", row.text[span.end :], re.I)
        place = Span(before.start() if before else span.start, span.end + (after.end() if after else 0))
        if any(s.start < place.end and place.start < s.end for s in row.object_spans):
            return row
        said = self._maker.floor()
        if said is None:
            return row
        changed = row.replaced(place, said.words)
        return replace(changed, floor=said.floor, floor_spans=said.spans(place.start), tags=row.tags | {said.kind})

    def _thing(self) -> Thing:
        """Somebody's object; at times its shortest form."""
        other = self._objects[int(self._g.integers(len(self._objects)))]
        assert other.object is not None
        words = _words_of(other, other.object_spans[0])
        if self._g.random() < 0.3:
            short = [f for f in other.also_ok if len(f.split()) <= 2 and f in words.lower()]
            if short:
                form = str(self._g.choice(short))
                return Thing(form, form, ())
        return Thing(words, other.object, other.also_ok)

    def _other_object(self, row: Row) -> Row:
        if row.object is None or len(row.object_spans) != 1 or row.relation is not None:
            return row
        span = row.object_spans[0]
        words, name, also_ok = self._thing()
        if find_mentions(words) or find_mentions(row.text[span.start : span.end]):
            return row
        changed = replace(row.replaced(span, words), object=name, also_ok=also_ok)
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

    def _with(self, row: Row, said: str) -> Row:
        """The row with a further sentence before, behind or between its own."""
        places = [0, len(row.text)]
        places += [m.end() for m in _SENTENCE.finditer(row.text) if m.group().rstrip()[-1:] in ".!?\n"]
        place = int(self._g.choice(places)) if self._g.random() < 0.6 else int(self._g.choice(places[:2]))
        if place < len(row.text) and any(s.start < place < s.end for s in row.labelled):
            return row
        end = "" if said[-1:] in ".!?;" else "."
        if place < len(row.text):
            return row.replaced(Span(place, place), f"{said}{end} ")
        own = "" if row.text.rstrip()[-1:] in ".!?;" else "."
        return row.replaced(Span(place, place), f"{own} {said}")

    def _of_a_neighbour(self) -> str:
        """Somebody else's floor or object, or goods."""
        return self._maker.filled(str(self._g.choice(phrases.NEIGHBOURS)), self._thing().words)[0]

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


def _without_its_object(row: Row) -> Row:
    """The request without the one sentence that names its object, where that sentence says nothing else."""
    if row.object is None or row.relation is not None or not row.object_spans or row.tags & _ARITHMETIC:
        return row
    pieces = [Span(m.start(), m.end()) for m in _SENTENCE.finditer(row.text)]
    holding = [p for p in pieces if any(s.start < p.end and p.start < s.end for s in row.object_spans)]
    if len(pieces) < 2 or len(holding) != 1:
        return row
    (piece,) = holding
    if any(s.start < piece.end and piece.start < s.end for s in row.floor_spans):
        return row
    named = content(" ".join(_words_of(row, s) for s in row.object_spans))
    rest = row.replaced(piece, "")
    if not rest.text.strip() or named & content(rest.text):
        return row
    return replace(rest, object=None, also_ok=(), object_spans=(), tags=row.tags | {"missing_object"})


def _plainness(reading: Reading, mentions: Sequence[Mention]) -> int:
    """How far-fetched a reading is: 0 for a number itself, 1 for two numbers, 2 for one and a step, 3 for the rest."""
    if reading.second is None:
        return {"itself": 0, "plus_1": 2, "minus_1": 2}.get(ONE_OPERATIONS[reading.operation], 3)
    counted = all(mentions[i].kind == "count" for i in (reading.first, reading.second))
    return 1 if counted and PAIR_OPERATIONS[reading.operation] in ("add", "subtract", "from_top") else 3


def _moves_with(reading: Reading, at: int) -> bool:
    """Does the floor move by one where the mention does?"""
    if reading.second is None:
        return reading.first == at and ONE_OPERATIONS[reading.operation] != "hundreds"
    name = PAIR_OPERATIONS[reading.operation]
    return name != "times" and (reading.first == at or (reading.second == at and name in ("add", "add_1")))


def _words_of(row: Row, span: Span) -> str:
    return row.text[span.start : span.end]


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


def _same_length(old: str, new: str) -> str:
    return new if len(new) == len(old) else old
