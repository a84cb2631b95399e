"""Labelled requests as rows whose labels are spans of the text, so that a text can be edited and stay labelled."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from services.llm_parser.reader.decode import SIDES, agreement, content


class Span(NamedTuple):
    """Characters `start` to `end` (exclusive)."""

    start: int
    end: int

    def holds(self, start: int, end: int) -> bool:
        return self.start <= start and end <= self.end


@dataclass(frozen=True)
class Relation:
    """The customer's window by another one: `count` windows to the `side` of the one marked by the `anchor` spans."""

    side: str
    count: int
    anchor: tuple[Span, ...]


@dataclass(frozen=True)
class Row:
    """One labelled request. `floor_spans` and `object_spans` are the words that the labels are read from; an empty
    tuple beside a value means that they are not known."""

    text: str
    floor: int | None
    object: str | None
    also_ok: tuple[str, ...]
    floor_spans: tuple[Span, ...]
    object_spans: tuple[Span, ...]
    relation: Relation | None
    tags: frozenset[str] = field(default=frozenset())
    author: str = ""

    def replaced(self, span: Span, new: str) -> "Row":
        """The row with the words at `span` replaced; labels that lie inside `span` stretch over the new words."""
        grown = len(new) - (span.end - span.start)

        def moved(s: Span) -> Span:
            if s.end <= span.start:
                return s
            if s.start >= span.end:
                return Span(s.start + grown, s.end + grown)
            return Span(min(s.start, span.start), max(s.end + grown, span.start + len(new)))

        relation = self.relation
        if relation is not None:
            relation = replace(relation, anchor=tuple(moved(s) for s in relation.anchor))
        return replace(
            self,
            text=self.text[: span.start] + new + self.text[span.end :],
            floor_spans=tuple(moved(s) for s in self.floor_spans),
            object_spans=tuple(moved(s) for s in self.object_spans),
            relation=relation,
        )

    @property
    def labelled(self) -> tuple[Span, ...]:
        """All spans that carry a label."""
        anchor = self.relation.anchor if self.relation is not None else ()
        return self.floor_spans + self.object_spans + anchor


def load(paths: Iterable[Path]) -> list[Row]:
    """All rows of some files; the author is the file's name."""
    rows = []
    for path in paths:
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.strip():
                rows.append(_row(json.loads(line), path.stem))
    return rows


def _row(entry: dict[str, Any], author: str) -> Row:
    text = entry["text"]
    relation = None
    told = entry.get("relation")
    if told and told.get("side") in SIDES:
        anchor = _spans(text, told.get("to_text") or [])
        if anchor:
            relation = Relation(told["side"], min(int(told.get("count") or 1), 5), anchor)
    return Row(
        text=text,
        floor=entry["floor"],
        object=entry["object"],
        also_ok=tuple(entry["also_ok"]),
        floor_spans=_spans(text, entry["floor_text"]),
        object_spans=_spans(text, entry["object_text"]),
        relation=relation,
        tags=frozenset(entry["tags"]),
        author=author,
    )


def _spans(text: str, parts: Sequence[str]) -> tuple[Span, ...]:
    spans, at = [], 0
    for part in parts:
        start = text.find(part, at)
        if start < 0:
            start = text.find(part)
        if start < 0:
            start = text.lower().find(part.lower())
        if start >= 0 and part:
            spans.append(Span(start, start + len(part)))
            at = start + len(part)
    return tuple(spans)


class Forms:
    """The right forms of a row's object."""

    def __init__(self, row: Row) -> None:
        assert row.object is not None
        forms = (row.object, *row.also_ok)
        self.forms = [content(f) for f in forms]
        texts = [row.text[s.start : s.end] for s in row.object_spans]
        self.full = frozenset().union(*self.forms, *(content(t) for t in texts))

    def right(self, found: frozenset[str]) -> bool:
        """Are these words the object: the same up to an F1 of 0.7, or between a short and the full form of it?"""
        if not found:
            return False
        if found <= self.full and any(f <= found for f in self.forms if f):
            return True
        return max(agreement(found, f) for f in self.forms) >= 0.7
