"""Requests put together from phrases: plain ones, European counting, chains, corrections, doubt, relations."""

import re
from typing import NamedTuple

import numpy as np

from services.llm_parser.reader.mentions import find_mentions
from training.parser import phrases
from training.parser.numbers import NTH, WORDS, in_any_form, nth, ordinal
from training.parser.rows import Relation, Row, Span


class Thing(NamedTuple):
    """An object as it is written, its name, and what else is right."""

    words: str
    name: str
    also_ok: tuple[str, ...]


class Said(NamedTuple):
    """Words, the floor that they say (null: none, or not surely), and their kind."""

    words: str
    floor: int | None
    kind: str

    def spans(self, start: int) -> tuple[Span, ...]:
        """Where the words, beginning at `start`, say the floor: the numbers that are it, or all of them."""
        if self.floor is None:
            return ()
        same = [m for m in find_mentions(self.words) if m.value == self.floor and m.kind == "count"]
        if same and self.kind in ("plain", "correction"):
            return tuple(Span(start + m.start, start + m.end) for m in same)
        return (Span(start, start + len(self.words)),)


class Maker:
    """Draws from `generator`."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._g = generator

    def request(self, thing: Thing) -> Row | None:
        """A request put together from phrases; null where there is none with such a thing or such numbers."""
        if find_mentions(thing.words):
            return None
        if self._g.random() < 0.2:
            return self._relation(thing.words)
        said = self.floor()
        return None if said is None else _built(said, thing, str(self._g.choice(phrases.JOINS)))

    def floor(self) -> Said | None:
        """A floor said in some way; null where the numbers drawn come to none."""
        g = self._g
        kind = g.random()
        if kind < 0.15:
            words, values = self.filled(str(g.choice(phrases.PLAIN)))
            return Said(words, values["n"], "plain")
        if kind < 0.3:
            words, values = self.filled(str(g.choice(phrases.CORRECTED)))
            return Said(words, values["a"], "correction")
        if kind < 0.5:
            return Said(self.filled(str(g.choice(phrases.DOUBTS)))[0], None, "ambiguous")
        table, tag = (phrases.EUROPEAN, "european_floor") if kind < 0.7 else (phrases.CHAINS, "relative_floor")
        form, sum_ = table[int(g.integers(len(table)))]
        words, values = self.filled(form)
        terms = re.findall(r"([+-]?)(\w+)", sum_)
        floor = sum((-1 if sign == "-" else 1) * (int(x) if x.isdigit() else values[x]) for sign, x in terms)
        return Said(words, floor, tag) if 1 <= floor <= 40 else None

    def filled(self, form: str, thing: str = "", least: int = 1) -> tuple[str, dict[str, int]]:
        """The form with chance values, and the values; `b` is at least `least`."""
        g = self._g
        n = min(int(g.geometric(0.14)), 25)
        values = {"n": n, "a": n, "b": int(g.integers(least, 5))}
        x = max(1, n + int(g.choice([-3, -2, -1, 1, 2, 3, 4, 8])))
        x = n + 1 if x == n else x
        who = str(g.choice(phrases.PEOPLE))
        return form.format(
            n=in_any_form(g, n), a=in_any_form(g, n), b=WORDS[values["b"]], d=n, e=n + 1, m=in_any_form(g, n + 1),
            x=in_any_form(g, x),
            a2=in_any_form(g, n + 2), nth=nth(n), mth=nth(n + 1), xth=nth(x), word=ordinal(n), bth=NTH[values["b"]],
            s="" if values["b"] == 1 else "s", z="" if n == 1 else "s", who=who,
            Who=who[0].upper() + who[1:], thing=thing,
        ), values  # fmt: skip

    def _relation(self, thing: str) -> Row:
        g = self._g
        side = str(g.choice(["left", "right", "above", "below"]))
        form = str(g.choice(phrases.RELATIONS[side]))
        said, values = self.filled(form, "\0", least=2)
        at = said.index("\0")
        said = said.replace("\0", thing)
        floor, plain = self.filled(str(g.choice(phrases.PLAIN)))
        first = g.random() < 0.5
        text = f"{floor}. {said}" if first else f"{said}{'' if said[-1] == '.' else '.'} {floor}"
        start = text.index(said) if first else 0
        count = values["b"] if "{b}" in form else 1
        lead = len(text) - len(floor) if not first else 0
        return Row(
            text=text,
            floor=plain["n"],
            object=None,
            also_ok=(),
            floor_spans=(Span(lead, lead + len(floor)),),
            object_spans=(),
            relation=Relation(side, count, (Span(start + at, start + at + len(thing)),)),
            tags=frozenset({"relation"}),
        )


def _built(said: Said, thing: Thing, form: str) -> Row:
    text = ""
    spans: list[Span] = []
    floors: list[Span] = []
    for piece in re.split(r"(\{\w+\})", form):
        start = len(text)
        if piece in ("{thing}", "{Thing}"):
            text += thing.words if piece == "{thing}" else thing.words[:1].upper() + thing.words[1:]
            spans.append(Span(start, len(text)))
        elif piece in ("{floor}", "{Floor}"):
            text += said.words if piece == "{floor}" else said.words[:1].upper() + said.words[1:]
            floors += said.spans(start)
        else:
            text += piece
    return Row(
        text=text,
        floor=said.floor,
        object=thing.name,
        also_ok=thing.also_ok,
        floor_spans=tuple(floors),
        object_spans=tuple(spans),
        relation=None,
        tags=frozenset({said.kind}),
    )
