"""The training's figures as pictures, for the model card."""

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from services.vlm_gateway.embedded.exported import Calibration
from training.calibrate import LEAST, Sighting
from training.crop_store import overlap_matrix
from training.judge import RIGHT, SeenPicture

_INK, _SECOND, _THIRD = "#1f3b57", "#c8553d", "#5b8e7d"


def read_log(path: Path) -> dict[str, list[float]]:
    """Columns of a training's log."""
    columns: dict[str, list[float]] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        for key, value in json.loads(line).items():
            columns.setdefault(key, []).append(float(value))
    return columns


def training_curves(proposer_log: Path, namer_log: Path, out: Path) -> None:
    """Losses and training accuracy of both networks over their steps."""
    figure, axes = plt.subplots(2, 2, figsize=(10, 6.2), constrained_layout=True)
    proposer, namer = read_log(proposer_log), read_log(namer_log)
    panels = (
        (axes[0][0], proposer, "Proposer: losses", ("things", "boxes", "outlines", "rows")),
        (axes[0][1], proposer, "Proposer: on training pieces", ("found", "overlap")),
        (axes[1][0], namer, "Namer: loss", ("loss",)),
        (axes[1][1], namer, "Namer: on training crops", ("kind", "colour", "both")),
    )
    for axis, columns, title, names in panels:
        for name, colour in zip(names, (_INK, _SECOND, _THIRD, "#9a8c4f"), strict=False):
            axis.plot(columns["step"], _smooth(columns[name]), color=colour, label=name)
        axis.set(title=title, xlabel="step")
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.25)
        axis.legend(frameon=False)
    figure.savefig(out, dpi=110)
    plt.close(figure)


def calibration_curve(found: Sequence[Sighting], calibration: Calibration, out: Path) -> None:
    """Share of right sightings over the raw score, and the line that confidence is read from."""
    score = np.array([s.score for s in found if s.score >= LEAST])
    right = np.array([s.right for s in found if s.score >= LEAST])
    edges = np.linspace(0, 1, 13)
    figure, axis = plt.subplots(figsize=(5.2, 4.6), constrained_layout=True)
    bins = np.clip(np.digitize(score, edges) - 1, 0, len(edges) - 2)
    for b in range(len(edges) - 1):
        chosen = right[bins == b]
        if len(chosen):
            low, high = _interval(int(chosen.sum()), len(chosen))
            middle = (edges[b] + edges[b + 1]) / 2
            axis.plot([middle, middle], [low, high], color=_SECOND, alpha=0.6)
            axis.plot(middle, chosen.mean(), "o", color=_SECOND)
    axis.plot(calibration.score, calibration.probability, color=_INK, label="confidence")
    axis.plot([0, 1], [0, 1], color="#999999", linewidth=0.8, linestyle="--")
    axis.set(xlabel="raw score", ylabel="share of right sightings", title=f"Validation: {len(score)} sightings")
    axis.legend(frameon=False)
    axis.grid(alpha=0.25)
    figure.savefig(out, dpi=110)
    plt.close(figure)


def recall_curves(looks: Sequence[SeenPicture], out: Path) -> None:
    """Shares of things proposed, and named rightly in their own box, over distance, pixels seen and share seen."""
    rows = []
    for look in looks:
        if not len(look.things):
            continue
        true = look.things["box"].reshape(-1, 4).astype(np.float32)
        best = overlap_matrix(true, look.boxes).max(axis=1) if len(look.boxes) else np.zeros(len(true))
        named = (look.true_kind.argmax(1) == look.things["kind"]) & (
            look.true_colour.argmax(1) == look.things["colour"]
        )
        for t, b, n in zip(look.things, best, named, strict=True):
            rows.append((t["distance_m"], t["pixels"], t["share"], b >= RIGHT, n))
    table = np.array(rows, np.float64).reshape(-1, 5)
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), constrained_layout=True, sharey=True)
    panels = (
        ("distance, m", 0, (0, 3, 5, 7, 9, 11, 14, 20), "linear"),
        ("pixels seen", 1, (20, 50, 100, 200, 400, 800, 1600, 3200, 12_800), "log"),
        ("share seen", 2, (0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.01), "linear"),
    )
    for axis, (label, column, edges, scale) in zip(axes, panels, strict=True):
        # one thing at a time: what is small is also far, so the other two must be fair
        others = {0: (table[:, 1] >= 100) & (table[:, 2] >= 0.5), 1: table[:, 2] >= 0.5, 2: table[:, 1] >= 100}[column]
        for which, colour, name in ((3, _INK, "proposed"), (4, _SECOND, "named rightly in its own box")):
            xs, ys, spans = [], [], []
            for low, high in pairwise(edges):
                chosen = table[others & (table[:, column] >= low) & (table[:, column] < high)][:, which]
                if len(chosen) >= 10:
                    xs.append(np.sqrt(low * high) if scale == "log" else (low + high) / 2)
                    ys.append(chosen.mean())
                    spans.append(_interval(int(chosen.sum()), len(chosen)))
            axis.plot(xs, ys, "o-", color=colour, label=name)
            if xs:
                axis.fill_between(xs, *zip(*spans, strict=True), color=colour, alpha=0.15)
        axis.set(xlabel=label, ylim=(0, 1.02), xscale=scale)
        axis.grid(alpha=0.25)
    axes[0].set_ylabel("share of things")
    axes[0].legend(frameon=False, loc="lower left")
    figure.savefig(out, dpi=110)
    plt.close(figure)


def _smooth(values: Sequence[float], width: int = 9) -> list[float]:
    padded = np.pad(np.asarray(values, float), (width // 2, width // 2), mode="edge")
    return list(np.convolve(padded, np.ones(width) / width, mode="valid"))


def _interval(right: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval."""
    z, p = 1.96, right / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(p * (1 - p) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return float(middle - half), float(middle + half)
