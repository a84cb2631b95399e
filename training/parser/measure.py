"""What an exported reader makes of rows that it was not fitted on, and from where on it may be believed."""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, TypeAdapter

from services.llm_parser.reader.decode import content
from services.llm_parser.reader.model import ReaderModel
from services.llm_parser.reader.parser import guesses
from training.parser.rows import Forms, Row

MOST_WRONG = 0.03
"""The share of requests that may be silently wrong behind the thresholds."""
GRID = (0.0, *np.linspace(0.4, 0.9, 11).round(3).tolist(), 0.92, 0.94, 0.96, 0.97, 0.98, 0.985, 0.99, 0.995)


class Examined(BaseModel):
    """One row as it was read: the likeliest floor and object, their probabilities, and whether they are right."""

    author: str
    tags: tuple[str, ...]
    text: str
    floor: int | None
    floor_probability: float
    floor_right: bool
    object: str | None
    object_probability: float
    object_right: bool


class Pair(BaseModel):
    """A number for each field."""

    floor: float
    object: float


class Calibrated(BaseModel):
    """Temperatures that the scores are divided by, and the calibrated probabilities from which a field is answered."""

    temperatures: Pair
    thresholds: Pair


class Outcomes(NamedTuple):
    """Shares of requests."""

    right: float
    asks: float
    wrong: float


def examine(folder: Path, rows: Iterable[Row]) -> list[Examined]:
    """Reads rows with an exported reader."""
    model = ReaderModel(folder)
    found = []
    for row in rows:
        read = guesses(model, row.text)
        floor, thing = read.floors[0], read.objects[0]
        if row.object is None:
            right = thing.phrase is None
        else:
            right = thing.phrase is not None and Forms(row).right(content(thing.phrase))
        found.append(
            Examined(
                author=row.author,
                tags=tuple(sorted(row.tags)),
                text=row.text,
                floor=floor.floor,
                floor_probability=floor.probability,
                floor_right=floor.floor == row.floor,
                object=thing.phrase,
                object_probability=thing.probability,
                object_right=right,
            )
        )
    return found


def read_examined(path: Path) -> list[Examined]:
    """Raises OSError, ValueError."""
    return TypeAdapter(list[Examined]).validate_python(json.loads(path.read_text(encoding="utf-8")))


def outcomes(examined: Sequence[Examined], thresholds: Pair) -> Outcomes:
    """Right, asks and silently wrong where less sure fields are asked for."""
    right = wrong = 0
    for e in examined:
        sure_floor = e.floor is not None and e.floor_probability >= thresholds.floor
        sure_object = e.object is not None and e.object_probability >= thresholds.object
        floor_right = e.floor_right if sure_floor or e.floor is None else False
        object_right = e.object_right if sure_object or e.object is None else False
        if floor_right and object_right:
            right += 1
        elif sure_floor and sure_object:
            wrong += 1
    n = max(1, len(examined))
    return Outcomes(right / n, (len(examined) - right - wrong) / n, wrong / n)


def calibrated(examined: Sequence[Examined]) -> Calibrated:
    """The thresholds with the most right ones among those that leave at most `MOST_WRONG` silently wrong."""
    best: tuple[float, Pair] | None = None
    for floor in GRID:
        for thing in GRID:
            pair = Pair(floor=floor, object=thing)
            found = outcomes(examined, pair)
            if found.wrong <= MOST_WRONG and (best is None or found.right > best[0]):
                best = found.right, pair
    if best is None:
        raise ValueError(f"no thresholds leave at most {100 * MOST_WRONG:g} % silently wrong")
    return Calibrated(temperatures=Pair(floor=1.0, object=1.0), thresholds=best[1])


def card(examined: Sequence[Examined], found: Calibrated) -> str:
    """The figures as Markdown."""
    raw = Pair(floor=0.0, object=0.0)
    thresholds = found.thresholds
    lines = [
        "# The reader of requests, on authors that it was not trained on",
        "",
        f"Thresholds: floor {thresholds.floor:g}, object {thresholds.object:g}; at most {100 * MOST_WRONG:g} % of all "
        "requests below were to be silently wrong. Right / asks / silently wrong, in %.",
        "",
        "| author | requests | raw | behind the thresholds | floor right | object right |",
        "|---|---|---|---|---|---|",
    ]
    for author in [*sorted({e.author for e in examined}), None]:
        mine = [e for e in examined if author is None or e.author == author]
        lines.append(
            f"| {author or 'all'} | {len(mine)} | {_said(outcomes(mine, raw))} | {_said(outcomes(mine, thresholds))} | "
            f"{_percent(mine, lambda e: e.floor_right)} | {_percent(mine, lambda e: e.object_right)} |"
        )
    lines += ["", "| kind | requests | raw | behind the thresholds |", "|---|---|---|---|"]
    for tag in sorted({t for e in examined for t in e.tags}):
        mine = [e for e in examined if tag in e.tags]
        if len(mine) >= 20:
            lines.append(
                f"| {tag} | {len(mine)} | {_said(outcomes(mine, raw))} | {_said(outcomes(mine, thresholds))} |"
            )
    return "\n".join(lines) + "\n"


def _said(found: Outcomes) -> str:
    return " / ".join(f"{100 * share:.1f}" for share in found)


def _percent(examined: Sequence[Examined], right: Callable[[Examined], bool]) -> str:
    return f"{100 * sum(right(e) for e in examined) / max(1, len(examined)):.1f}"
