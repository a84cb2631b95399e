"""Fit the embedded model to labelled pictures: `python -m services.vlm_gateway.embedded.fit DIRECTORY [DIRECTORY ...]`.

The directories come from `python -m vld.embedded_pictures`. Scenes whose seed ends in 0 are kept back: thresholds are
chosen on them. Writes `weights.npz` and `vocabulary.json` beside this module; deterministic for the same pictures.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box
from contracts.labelled import LABELS_FILE, LabelledView
from contracts.sim import Catalogue, VisibleObject
from services.vlm_gateway.embedded.bands import BANDS, column_bands, peaks, row_bands, small
from services.vlm_gateway.embedded.colours import BINS, BITS, Patch, bin_index, coded, likeness, patches
from services.vlm_gateway.embedded.describe import describe, width
from services.vlm_gateway.embedded.perceptron import Perceptron, sigmoid, softmax
from services.vlm_gateway.embedded.simple import FOLDER, ROW_APART, nominal
from services.vlm_gateway.embedded.simple_words import Vocabulary

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]
VERSION = "1"
_HEAT_WIDTH = 1.6
COLOURS_A_PICTURE = 8
BACKGROUND = 4
TABLE_EVERY = 3
_WRONG_CLAIMS = 0.03
"""Allowed share of patches whose best class is wrong and sure. Every sighting is looked at again from nearer before it
is claimed, so that a miss costs more than a wrong first look."""


class Shown(NamedTuple):
    """A labelled picture, read when it is looked at: thousands would not fit into memory."""

    path: Path
    label: LabelledView

    @property
    def rgb(self) -> Picture:
        """Raises FileNotFoundError."""
        bgr = cv2.imread(str(self.path))
        if bgr is None:
            raise FileNotFoundError(self.path)
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


class Task(NamedTuple):
    """x (N, D), y (N, C); `kept_back` (N,) marks what thresholds are chosen on."""

    x: Floats
    y: Floats
    kept_back: NDArray[np.bool_]


def pictures(folders: list[Path]) -> Iterator[Shown]:
    for folder in folders:
        for line in (folder / LABELS_FILE).read_text(encoding="utf-8").splitlines():
            label = LabelledView.model_validate_json(line)
            yield Shown(folder / label.picture, label)


def kept_back(label: LabelledView) -> bool:
    return label.seed % 10 == 0


def train(
    task: Task, hidden: int, epochs: int, seed: int, *, exclusive: bool, rate: float = 2e-3, decay: float = 1e-4
) -> Perceptron:
    """Adam on cross-entropy, over classes (`exclusive`) or per output; inputs are jittered a little."""
    rng = np.random.default_rng(seed)
    x, y = task.x[~task.kept_back], task.y[~task.kept_back]
    mean, scale = x.mean(axis=0), 1.0 / (x.std(axis=0) + 0.02)
    x = (x - mean) * scale
    d, c = x.shape[1], y.shape[1]
    weights = [
        rng.normal(0, np.sqrt(2 / d), (d, hidden)).astype(np.float32),
        np.zeros(hidden, np.float32),
        rng.normal(0, np.sqrt(1 / hidden), (hidden, c)).astype(np.float32),
        np.zeros(c, np.float32),
    ]
    first, second = [np.zeros_like(w) for w in weights], [np.zeros_like(w) for w in weights]
    batch, step = 256, 0
    steps = epochs * (len(x) // batch + 1)
    for _ in range(epochs):
        order = rng.permutation(len(x))
        for at in range(0, len(x), batch):
            pick = order[at : at + batch]
            xb = x[pick] + np.float32(0.15) * rng.standard_normal((len(pick), d), dtype=np.float32)
            raw = xb @ weights[0] + weights[1]
            drop = (rng.random(raw.shape, dtype=np.float32) > 0.2).astype(np.float32) / 0.8
            h = np.maximum(raw, 0) * drop
            out = h @ weights[2] + weights[3]
            wrong = ((softmax(out) if exclusive else sigmoid(out)) - y[pick]) / len(pick)
            back = (wrong @ weights[2].T) * (raw > 0) * drop
            slopes = [xb.T @ back, back.sum(axis=0), h.T @ wrong, wrong.sum(axis=0)]
            step += 1
            now = rate * 0.5 * (1 + np.cos(np.pi * step / steps))
            for k, slope in enumerate(slopes):
                first[k] = 0.9 * first[k] + 0.1 * slope
                second[k] = 0.999 * second[k] + 0.001 * slope * slope
                move = first[k] / (1 - 0.9**step) / (np.sqrt(second[k] / (1 - 0.999**step)) + 1e-8)
                weights[k] = (weights[k] - now * (move + decay * weights[k])).astype(np.float32)
    return Perceptron(mean.astype(np.float32), scale.astype(np.float32), *weights)


def band_tasks(shown: list[Shown]) -> tuple[Task, Task]:
    """Rows (middle of a window row, inside the building) and columns (inside the building)."""
    rows_x, rows_y, columns_x, columns_y = [], [], [], []
    held: list[bool] = []
    middles = (np.arange(BANDS) + 0.5) / BANDS
    for one in shown:
        label = one.label
        if not label.frontal:
            continue
        seen = small(one.rgb)
        for picture in (seen, np.ascontiguousarray(seen[:, ::-1])):
            box = label.truth.building_box
            flipped = len(held) % 2 == 1
            heat = np.zeros(BANDS, np.float32)
            for row in label.truth.floor_rows:
                heat = np.maximum(heat, np.exp(-(((middles - row) * BANDS / _HEAT_WIDTH) ** 2) / 2))
            inside_y = np.zeros(BANDS, np.float32)
            inside_x = np.zeros(BANDS, np.float32)
            if box is not None:
                inside_y[(middles >= box.y_min) & (middles <= box.y_max)] = 1.0
                inside_x[(middles >= box.x_min) & (middles <= box.x_max)] = 1.0
            rows_x.append(row_bands(picture))
            rows_y.append(np.stack([heat, inside_y], axis=1))
            columns_x.append(column_bands(picture))
            columns_y.append((inside_x[::-1] if flipped else inside_x)[:, None])
            held.append(kept_back(label))
    marks = np.repeat(np.array(held), BANDS)
    return (
        Task(np.concatenate(rows_x), np.concatenate(rows_y).astype(np.float32), marks),
        Task(np.concatenate(columns_x), np.concatenate(columns_y).astype(np.float32), marks),
    )


def choose_row_threshold(rows: Perceptron, shown: list[Shown]) -> tuple[float, float]:
    """The threshold that counts most kept-back pictures exactly, and the share it counts exactly."""
    told = [
        (sigmoid(rows.logits(row_bands(small(s.rgb))))[:, 0], len(s.label.truth.floor_rows))
        for s in shown
        if s.label.frontal and kept_back(s.label)
    ]
    best = (0.5, 0.0)
    for threshold in np.arange(0.25, 0.75, 0.05):
        right = sum(len(peaks(heat, float(threshold), ROW_APART)) == count for heat, count in told) / max(1, len(told))
        if right > best[1]:
            best = (float(threshold), right)
    return best


def colour_tables(shown: list[Shown], colours: tuple[str, ...]) -> NDArray[np.uint8]:
    """(colours, BINS) 0..255: likeness of each pixel colour to each name, counted inside and outside the boxes."""
    inside = np.zeros((len(colours), BINS))
    outside = np.zeros(BINS)
    for one in shown[::TABLE_EVERY]:
        label = one.label
        if kept_back(label):
            continue
        index = bin_index(nominal(one.rgb))
        free = np.ones(index.shape, bool)
        for thing in label.truth.objects:
            x0, y0, x1, y1 = _pixels(thing, index.shape[0])
            free[y0:y1, x0:x1] = False
            if thing.share < 0.5 or min(x1 - x0, y1 - y0) < 10 or thing.colour not in colours:
                continue
            w, h = (x1 - x0) // 5, (y1 - y0) // 5
            inner = index[y0 + h : y1 - h, x0 + w : x1 - w].ravel()
            inside[colours.index(thing.colour)] += np.bincount(inner, minlength=BINS) / inner.size
        outside += np.bincount(index[free][::7], minlength=BINS) / index.size * 7
    cube = (1 << BITS,) * 3
    smooth = [_blurred(row.reshape(cube)) / max(row.sum(), 1e-9) for row in inside]
    rest = _blurred(outside.reshape(cube)) / outside.sum()
    others = np.stack(smooth)
    tables = np.empty((len(colours), BINS), np.uint8)
    for k, own in enumerate(smooth):
        rival = np.max(np.delete(others, k, axis=0), axis=0)
        share = own / (own + 1.2 * rest + 0.5 * rival + 2e-6)
        tables[k] = np.rint(share.ravel() * 255).astype(np.uint8)
    return tables


class Patches(NamedTuple):
    """One picture's patches: their descriptions (N, D) in half precision, and their classes (N,)."""

    x: NDArray[np.float16]
    kinds: NDArray[np.int64]


def patches_of(number: int, one: Shown, tables: NDArray[np.uint8], words: Vocabulary) -> Patches:
    """The patches of the picture and, where it is learnt from, of its mirror image."""
    rng = np.random.default_rng((3, number))
    picture, things = nominal(one.rgb), one.label.truth.objects
    as_seen = _patches_of(picture, things, rng, tables, words)
    if kept_back(one.label):
        return as_seen
    turned = tuple(t.model_copy(update={"box": _mirrored(t.box)}) for t in things)
    mirrored = _patches_of(np.ascontiguousarray(picture[:, ::-1]), turned, rng, tables, words)
    return Patches(np.concatenate([as_seen.x, mirrored.x]), np.concatenate([as_seen.kinds, mirrored.kinds]))


def _mirrored(box: Box) -> Box:
    return box.model_copy(update={"x_min": 1.0 - box.x_max, "x_max": 1.0 - box.x_min})


def _patches_of(
    picture: Picture,
    things: tuple[VisibleObject, ...],
    rng: np.random.Generator,
    tables: NDArray[np.uint8],
    words: Vocabulary,
) -> Patches:
    """The patches of the colours that the picture's things have, and of one more colour."""
    code = coded(picture)
    present = sorted({t.colour for t in things if t.colour in words.colours})
    asked = {str(c) for c in rng.permutation(present)[:COLOURS_A_PICTURE]} | {str(rng.choice(words.colours))}
    xs: list[NDArray[np.float16]] = [np.zeros((0, width(len(words.colours))), np.float16)]
    kinds: list[int] = []
    for colour in sorted(asked):
        like = likeness(code, tables[words.colours.index(colour)])
        pairs = [(p, class_of(p, things, colour, words, picture.shape[0])) for p in patches(like)]
        told = [(p, kind) for p, kind in pairs if kind is not None]
        row = describe(picture, like, [p for p, _ in told], words.colours.index(colour), len(words.colours))
        xs.append(row.astype(np.float16))
        kinds += [kind for _, kind in told]
    return Patches(np.concatenate(xs), np.array(kinds, np.int64))


def patch_task(shown: list[Shown], tables: NDArray[np.uint8], words: Vocabulary, workers: int) -> Task:
    """Patches and their classes, the last for none; of what shows nothing, a draw of BACKGROUND for each thing."""
    cv2.setNumThreads(1)
    with ProcessPoolExecutor(workers) as pool:
        each = list(pool.map(partial(patches_of, tables=tables, words=words), range(len(shown)), shown, chunksize=16))
    kinds = np.concatenate([e.kinds for e in each])
    held = np.repeat([kept_back(s.label) for s in shown], [len(e.kinds) for e in each])
    things = kinds < len(words.kinds)
    share = BACKGROUND * int(things.sum()) / max(1, int((~things).sum()))
    keep = things | held | (np.random.default_rng(5).random(len(kinds)) < share)
    x = np.concatenate([e.x for e in each])[keep].astype(np.float32)
    return Task(x, np.eye(len(words.kinds) + 1, dtype=np.float32)[kinds[keep]], held[keep])


def class_of(p: Patch, things: tuple[VisibleObject, ...], colour: str, words: Vocabulary, side: int) -> int | None:
    """The number of the class whose thing of that colour the patch shows; the number after the last where it shows
    none; null where it shows a scrap of one, which teaches nothing."""
    scrap = False
    for thing in things:
        if thing.colour != colour:
            continue
        x0, y0, x1, y1 = _pixels(thing, side)
        w = min(p.x + p.width, x1) - max(p.x, x0)
        h = min(p.y + p.height, y1) - max(p.y, y0)
        if w <= 0 or h <= 0:
            continue
        union = p.width * p.height + (x1 - x0) * (y1 - y0) - w * h
        covered = w * h / ((x1 - x0) * (y1 - y0))
        within = w * h / (p.width * p.height)
        if w * h / union >= 0.3 or (within >= 0.75 and covered >= 0.25):
            return words.kinds.index(thing.kind)
        scrap = True
    return None if scrap else len(words.kinds)


def choose_sure(classes: Perceptron, task: Task) -> tuple[float, float, float]:
    """The threshold that keeps wrong claims rare on kept-back patches; with the recall and the wrong share it has."""
    scores = softmax(classes.logits(task.x[task.kept_back]))
    truth = task.y[task.kept_back].argmax(axis=1)
    none = task.y.shape[1] - 1
    guess = scores[:, :none].argmax(axis=1)
    best = scores[np.arange(len(scores)), guess]
    chosen = (0.95, 0.0, 0.0)
    for threshold in np.arange(0.95, 0.34, -0.025):
        claims = best >= threshold
        wrong = float((claims & (guess != truth)).sum() / max(1, len(truth)))
        recall = float((claims & (guess == truth)).sum() / max(1, (truth != none).sum()))
        if wrong > _WRONG_CLAIMS:
            break
        chosen = (float(threshold), recall, wrong)
    return chosen


def _pixels(thing: VisibleObject, side: int) -> tuple[int, int, int, int]:
    b = thing.box
    x0, y0 = int(b.x_min * side), int(b.y_min * side)
    return x0, y0, max(x0 + 1, round(b.x_max * side)), max(y0 + 1, round(b.y_max * side))


def _blurred(cube: NDArray[np.float64]) -> NDArray[np.float64]:
    kernel = np.array([0.06, 0.24, 0.4, 0.24, 0.06])
    for axis in range(3):
        cube = np.apply_along_axis(lambda row: np.convolve(row, kernel, mode="same"), axis, cube)
    return cube


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m services.vlm_gateway.embedded.fit", description="Fit the model.")
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=FOLDER)
    parser.add_argument("--epochs", type=int, default=30)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--hidden", type=int, default=128)
    chosen = parser.parse_args(arguments)
    catalogue = Catalogue.model_validate_json((chosen.folders[0] / "catalogue.json").read_text(encoding="utf-8"))
    vocabulary = {
        "colours": sorted({c for e in catalogue.entries for c in e.colours}),
        "entries": [e.model_dump(include={"kind", "phrase", "synonyms", "colours"}) for e in catalogue.entries],
    }
    (chosen.out / "vocabulary.json").write_text(json.dumps(vocabulary, indent=1) + "\n", encoding="utf-8")
    words = Vocabulary.load(chosen.out / "vocabulary.json")
    shown = list(pictures(chosen.folders))
    say = sys.stdout.write
    say(f"{len(shown)} pictures\n")
    rows_task, columns_task = band_tasks(shown)
    rows = train(rows_task, 48, chosen.epochs, 1, exclusive=False)
    columns = train(columns_task, 24, chosen.epochs, 2, exclusive=False)
    row_likely, exact = choose_row_threshold(rows, shown)
    sys.stdout.flush()
    say(f"floors: threshold {row_likely:.2f}, {exact:.3f} of the kept-back pictures counted exactly\n")
    tables = colour_tables(shown, words.colours)
    task = patch_task(shown, tables, words, chosen.workers)
    say(f"{len(task.x)} patches, {int(task.y[:, :-1].sum())} of things\n")
    classes = train(task, chosen.hidden, chosen.epochs, 4, exclusive=True)
    sure, recall, wrong = choose_sure(classes, task)
    say(f"things: threshold {sure:.3f}, recall {recall:.3f} of kept-back patches, wrong claims {wrong:.4f} of all\n")
    arrays: dict[str, NDArray[np.generic]] = {
        "version": np.array(VERSION),
        "tables": tables,
        "sure": np.array(sure),
        "row_likely": np.array(row_likely),
        **rows.packed("rows"),
        **columns.packed("columns"),
        **classes.packed("classes"),
    }
    np.savez_compressed(chosen.out / "weights.npz", allow_pickle=False, **arrays)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
