"""What an exported reader makes of rows that it was not fitted on, and from where on it may be believed."""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, TypeAdapter

from services.llm_parser.reader.decode import content
from services.llm_parser.reader.model import Calibration, Calibrations, ReaderModel, Thresholds
from services.llm_parser.reader.parser import guesses
from training.parser.rows import Forms, Row

MOST_WRONG = 0.03
"""The share of requests that may be silently wrong behind the thresholds."""
GRID = (0.0, *np.linspace(0.4, 0.99, 60).round(3).tolist(), 0.993, 0.995)


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


class Calibrated(NamedTuple):
    """What `about.json` says of a network once left-out authors were examined."""

    calibration: Calibrations
    thresholds: Thresholds


class Field(NamedTuple):
    """Of every request: how probable the likeliest value is, whether that is "none", and whether it is right."""

    probability: NDArray[np.float64]
    null: NDArray[np.bool_]
    right: NDArray[np.bool_]


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


def outcomes(examined: Sequence[Examined], found: Calibrated) -> Outcomes:
    """Right, asks and silently wrong where less sure fields are asked for."""
    return _outcomes(_columns(examined, found.calibration), found.thresholds)


def calibrated(
    examined: Sequence[Examined], chosen_on: Sequence[str] = (), most_wrong: float = MOST_WRONG
) -> Calibrated:
    """Probabilities that mean what they say, and the thresholds with the most right ones among those that leave at most
    `most_wrong` silently wrong; of these authors' requests alone where some are named. Raises ValueError where there
    are no such thresholds, or no requests of such an author."""
    calibration = Calibrations(
        floor=_platt([e.floor_probability for e in examined], [e.floor_right for e in examined]),
        object=_platt([e.object_probability for e in examined], [e.object_right for e in examined]),
    )
    unknown = sorted(set(chosen_on) - {e.author for e in examined})
    if unknown:
        raise ValueError(f"no requests of {', '.join(unknown)} were examined")
    columns = _columns([e for e in examined if not chosen_on or e.author in chosen_on], calibration)
    tried = [Thresholds(floor=floor, object=thing) for floor in GRID for thing in GRID]
    few = [(found.right, t) for t in tried if (found := _outcomes(columns, t)).wrong <= most_wrong]
    if not few:
        raise ValueError(f"no thresholds leave at most {100 * most_wrong:g} % silently wrong")
    return Calibrated(calibration, max(few, key=lambda pair: pair[0])[1])


def _columns(examined: Sequence[Examined], calibration: Calibrations) -> tuple[Field, Field]:
    return (
        Field(
            np.array([calibration.floor.probability(e.floor_probability) for e in examined]),
            np.array([e.floor is None for e in examined], bool),
            np.array([e.floor_right for e in examined], bool),
        ),
        Field(
            np.array([calibration.object.probability(e.object_probability) for e in examined]),
            np.array([e.object is None for e in examined], bool),
            np.array([e.object_right for e in examined], bool),
        ),
    )


def _outcomes(columns: tuple[Field, Field], thresholds: Thresholds) -> Outcomes:
    floor, thing = columns
    answered_floor = (floor.probability >= thresholds.floor) & ~floor.null
    answered_object = (thing.probability >= thresholds.object) & ~thing.null
    right = floor.right & (answered_floor | floor.null) & thing.right & (answered_object | thing.null)
    wrong = answered_floor & answered_object & ~right
    n = max(1, len(right))
    return Outcomes(right.sum() / n, (~right & ~wrong).sum() / n, wrong.sum() / n)


def _platt(probabilities: Sequence[float], right: Sequence[bool]) -> Calibration:
    """Logistic regression of being right on logit(p), by Newton's method, slightly drawn to slope 1 and offset 0."""
    p = np.clip(np.array(probabilities), 1e-6, 1.0 - 1e-6)
    x = np.stack([np.log(p / (1.0 - p)), np.ones_like(p)], 1)
    y, prior = np.array(right, float), np.array([1.0, 0.0])

    def loss(w: NDArray[np.float64]) -> float:
        return float(np.logaddexp(0.0, x @ w).sum() - y @ (x @ w) + 0.5 * ((w - prior) ** 2).sum())

    w = prior
    for _ in range(50):
        q = 0.5 + 0.5 * np.tanh(0.5 * (x @ w))
        curvature = (x * (q * (1.0 - q))[:, None]).T @ x + np.eye(2)
        step = np.linalg.solve(curvature, x.T @ (q - y) + (w - prior))
        while loss(w - step) > loss(w) and np.abs(step).max() > 1e-9:
            step = step / 2.0
        w = w - step
    return Calibration(slope=round(float(w[0]), 4), offset=round(float(w[1]), 4))


def card(examined: Sequence[Examined], found: Calibrated) -> str:
    """The figures as Markdown."""
    raw = found._replace(thresholds=Thresholds(floor=0.0, object=0.0))
    thresholds = found.thresholds
    lines = [
        "# The reader of requests, on authors that it was not trained on",
        "",
        f"Thresholds: floor {thresholds.floor:g}, object {thresholds.object:g}. Right / asks / silently wrong, in %.",
        "",
        "| author | requests | raw | behind the thresholds | floor right | object right |",
        "|---|---|---|---|---|---|",
    ]
    for author in [*sorted({e.author for e in examined}), None]:
        mine = [e for e in examined if author is None or e.author == author]
        lines.append(
            f"| {author or 'all'} | {len(mine)} | {_said(outcomes(mine, raw))} | {_said(outcomes(mine, found))} | "
            f"{_percent(mine, lambda e: e.floor_right)} | {_percent(mine, lambda e: e.object_right)} |"
        )
    lines += ["", "| kind | requests | raw | behind the thresholds |", "|---|---|---|---|"]
    for tag in sorted({t for e in examined for t in e.tags}):
        mine = [e for e in examined if tag in e.tags]
        if len(mine) >= 20:
            lines.append(f"| {tag} | {len(mine)} | {_said(outcomes(mine, raw))} | {_said(outcomes(mine, found))} |")
    return "\n".join(lines) + "\n"


def _said(found: Outcomes) -> str:
    return " / ".join(f"{100 * share:.1f}" for share in found)


def _percent(examined: Sequence[Examined], right: Callable[[Examined], bool]) -> str:
    return f"{100 * sum(right(e) for e in examined) / max(1, len(examined)):.1f}"
