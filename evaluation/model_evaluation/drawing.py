"""The model card's pictures: curves of one model, and a sheet of what it got wrong."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box
from evaluation.metrics.summary import Rate
from evaluation.model_evaluation.scores import Scores

INK, SOFT, FILL, ALERT = "#2b3440", "#8a94a0", "#4c78a8", "#c25b5b"
_TILE_PX = 180
_COLUMNS = 4
_GREEN, _RED = (60, 200, 60), (230, 50, 50)


class Tile(NamedTuple):
    """One mistake: a picture's file, what was claimed, what was asked for where it shows, and two lines of text."""

    picture: Path
    claimed: Box | None
    wanted: Box | None
    title: str
    note: str


def draw_curves(scores: Scores, path: Path) -> None:
    """Recall over distance, size and visible share, calibration, decoys, floors. Raises ImportError without
    matplotlib, OSError."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 7.4), dpi=110, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{scores.model}: {scores.tasks} fresh streets, 95 % intervals", color=INK, fontsize=14)
    axes = figure.subplots(2, 3).ravel()
    groups, rates = scores.groups, scores.rates
    _points(axes[0], "Recall over distance (≥ 60 % and ≥ 200 px visible)", groups["recall by distance"], goal=0.95)
    _points(axes[1], "Recall over size (≤ 10 m, ≥ 60 % visible)", groups["recall by size"], goal=0.95)
    _points(axes[2], "Recall over visible share (≤ 10 m, ≥ 200 px)", groups["recall by visible share"], goal=0.95)
    _points(axes[3], "Right sightings over confidence", groups["right of sightings by confidence"], diagonal=True)
    _points(
        axes[4],
        "Wrong claims (less is better)",
        {
            "task,\nfirst claim": rates["wrong claims of tasks with a claim"],
            "look\nwithout it": rates["looks without it, claimed"],
            "same class\nin view": rates["same class in view: wrong claims"],
            "same colour\nin view": rates["same colour in view: wrong claims"],
            "unknown\nthing": rates["unknown things: claimed"],
            "strange\nlooks": rates["strange looks without it, claimed"],
        },
        goal=0.05,
        colour=ALERT,
    )
    _points(
        axes[5],
        "Floors (less is better)",
        {
            "count\nnot exact": _not(rates["floors: exact"]),
            "off by\ntwo or more": _not(rates["floors: within one"]),
            "stepwise\n> 7 m off": rates["floors: stepwise failures"],
            "direct count\n> 7 m off": rates["floors: direct-count failures"],
            "strange looks\nnot exact": _not(rates["strange looks, floors: exact"]),
        },
        goal=0.03,
        colour=ALERT,
    )
    figure.savefig(path)


def draw_mistakes(tiles: Sequence[Tile], path: Path) -> None:
    """A sheet of cut-outs: green is what was asked for, red what was claimed. Raises ImportError, OSError."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = max(1, math.ceil(len(tiles) / _COLUMNS))
    figure = Figure(figsize=(11, 3.35 * rows), dpi=100, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    for number, axes in enumerate(figure.subplots(rows, _COLUMNS, squeeze=False).ravel()):
        axes.axis("off")
        if number < len(tiles):
            tile = tiles[number]
            axes.imshow(_cut(tile))
            axes.set_title(f"{number + 1}. {tile.title}", fontsize=9.5, color=INK)
            axes.text(
                0.5,
                -0.03,
                tile.note.replace("; ", "\n", 1),
                transform=axes.transAxes,
                ha="center",
                va="top",
                fontsize=8.5,
                color=INK,
            )
    figure.savefig(path)


def _cut(tile: Tile) -> NDArray[np.uint8]:
    bgr = cv2.imread(str(tile.picture))
    if bgr is None:
        raise FileNotFoundError(tile.picture)
    rgb = np.ascontiguousarray(bgr[:, :, ::-1])
    side = rgb.shape[0]
    boxes = [box for box in (tile.claimed, tile.wanted) if box is not None]
    x = [v * side for box in boxes for v in (box.x_min, box.x_max)]
    y = [v * side for box in boxes for v in (box.y_min, box.y_max)]
    half = max(50.0, 0.75 * max(max(x) - min(x), max(y) - min(y)))
    centre = (min(x) + max(x)) / 2, (min(y) + max(y)) / 2
    left, top = (int(min(max(0.0, c - half), side - 2 * half)) if 2 * half < side else 0 for c in centre)
    size = min(side, int(2 * half))
    scale = 2 * _TILE_PX / size
    part = cv2.resize(rgb[top : top + size, left : left + size], None, fx=scale, fy=scale)
    for box, colour in ((tile.wanted, _GREEN), (tile.claimed, _RED)):
        if box is not None:
            corners = [(box.x_min, box.y_min), (box.x_max, box.y_max)]
            a, b = ((int((u * side - left) * scale), int((v * side - top) * scale)) for u, v in corners)
            cv2.rectangle(part, a, b, colour, 3)
    return np.asarray(part, np.uint8)


def _points(
    draw: Any,
    title: str,
    rates: Mapping[str, Rate],
    *,
    goal: float | None = None,
    colour: str = FILL,
    diagonal: bool = False,
) -> None:
    known = {name: r for name, r in rates.items() if r.rate is not None}
    at = range(len(known))
    values = [r.rate or 0.0 for r in known.values()]
    lows = [v - (r.low or 0.0) for v, r in zip(values, known.values(), strict=True)]
    highs = [(r.high or 0.0) - v for v, r in zip(values, known.values(), strict=True)]
    draw.errorbar(at, values, yerr=[lows, highs], fmt="o", color=colour, capsize=3)
    draw.set_xticks(list(at), [f"{n}\n{r.k}/{r.n}" for n, r in known.items()], fontsize=7.5)
    if goal is not None:
        draw.axhline(goal, color=SOFT, lw=1, ls="--")
    if diagonal:
        middles = [float(name[:3]) + 0.05 for name in known]
        draw.plot(list(at), middles, color=SOFT, lw=1, ls="--")
    top = 1.03 if colour == FILL else max(0.12, 1.1 * max([v + h for v, h in zip(values, highs, strict=True)] or [0]))
    draw.set_ylim(-0.02 * top, top)
    draw.set_title(title, loc="left", fontsize=10.5, color=INK)
    draw.spines[["top", "right"]].set_visible(False)
    draw.tick_params(colors=INK, length=0)


def _not(r: Rate) -> Rate:
    if r.rate is None or r.low is None or r.high is None:
        return r
    return Rate(k=r.n - r.k, n=r.n, rate=1 - r.rate, low=1 - r.high, high=1 - r.low)
