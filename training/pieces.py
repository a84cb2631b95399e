"""What the proposer is fitted to: square pieces of pictures with the maps it should draw on them."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from training.labels import STRIDE
from training.shards import Picture, read

PIECE_PX = 384
PIECES_A_PICTURE = 2
MIN_PIXELS, MIN_SHARE = 40, 0.2
"""Of a thing less than this is seen: neither found nor missed is wrong."""
_CELLS = PIECE_PX // STRIDE
_ZOOM_CELLS = (38, 62)
_CORE, _INNER, _LEAST_PX = 0.5, 0.8, 4.5

Floats = NDArray[np.float32]


class Piece(NamedTuple):
    """rgb (PIECE_PX, PIECE_PX, 3). On cells (h, w): `core` 1 in the middle of a thing; `care` how much a wrong
    objectness counts; `inside` 1 where the box counts; `box` (4, h, w) pixels to its sides; maps (3, h, w) building,
    window, row in 0..1."""

    rgb: Picture
    core: Floats
    care: Floats
    inside: Floats
    box: Floats
    maps: Floats


class Batch(NamedTuple):
    """Pieces, stacked."""

    rgb: Picture
    core: Floats
    care: Floats
    inside: Floats
    box: Floats
    maps: Floats


class Pieces:
    """Draws batches from shards; the same batch for the same number, whoever asks and when."""

    def __init__(self, paths: Sequence[Path], seed: int) -> None:
        if not paths:
            raise ValueError("there are no shards to train on: draw some first (python -m training render)")
        self._paths = list(paths)
        self._seed = seed

    def batch(self, number: int, size: int) -> Batch:
        rng = np.random.default_rng((self._seed, number))
        pieces: list[Piece] = []
        while len(pieces) < size:
            shard = read(self._paths[int(rng.integers(len(self._paths)))])
            for view in rng.choice(len(shard.jpegs), size=min(2, len(shard.jpegs)), replace=False):
                rgb = shard.picture(int(view))
                drawn = np.stack([m[view] for m in (shard.building, shard.window, shard.row)])
                maps = np.asarray(drawn.astype(np.float32) / 255, np.float32)
                things = shard.things[shard.things["view"] == view]
                pieces += [piece(rgb, maps, things, rng) for _ in range(PIECES_A_PICTURE)]
        return Batch(*(np.stack(parts) for parts in zip(*pieces[:size], strict=True)))


def piece(rgb: Picture, maps: Floats, things: NDArray[np.void], rng: np.random.Generator) -> Piece:
    """A random piece of a picture, a little larger or smaller than life, half of them mirrored."""
    whole = rgb.shape[0] // STRIDE
    cells = int(rng.integers(_ZOOM_CELLS[0], _ZOOM_CELLS[1] + 1))
    row, column = _place(things, whole, cells, rng)
    part = rgb[row * STRIDE : (row + cells) * STRIDE, column * STRIDE : (column + cells) * STRIDE]
    how = cv2.INTER_AREA if cells > _CELLS else cv2.INTER_LINEAR
    picture = np.asarray(cv2.resize(part, (PIECE_PX, PIECE_PX), interpolation=how), np.uint8)
    small = maps[:, row : row + cells, column : column + cells]
    drawn = np.stack([cv2.resize(m, (_CELLS, _CELLS), interpolation=cv2.INTER_AREA) for m in small])
    scale = _CELLS / cells
    boxes = ((things["box"].reshape(-1, 4) - np.array([column, row, column, row]) * STRIDE) * scale).astype(np.float32)
    if rng.random() < 0.5:
        picture, drawn = picture[:, ::-1], drawn[:, :, ::-1]
        boxes = np.stack([PIECE_PX - boxes[:, 2], boxes[:, 1], PIECE_PX - boxes[:, 0], boxes[:, 3]], axis=1)
    sure = (things["pixels"] * scale**2 >= MIN_PIXELS) & (things["share"] >= MIN_SHARE)
    return Piece(shaded(picture, rng), *targets(boxes, sure, _CELLS), np.ascontiguousarray(drawn, np.float32))


def _place(things: NDArray[np.void], whole: int, cells: int, rng: np.random.Generator) -> tuple[int, int]:
    """Mostly about a thing, else anywhere."""
    if len(things) and rng.random() < 0.7:
        left, top, right, bottom = things["box"][int(rng.integers(len(things)))]
        middle = np.array([(top + bottom) / 2, (left + right) / 2]) / STRIDE
        at = middle - cells * rng.uniform(0.15, 0.85, 2)
    else:
        at = rng.uniform(0, whole - cells, 2)
    row, column = (int(v) for v in np.clip(np.rint(at), 0, whole - cells))
    return row, column


def targets(boxes: Floats, sure: NDArray[np.bool_], cells: int) -> tuple[Floats, Floats, Floats, Floats]:
    """core, care, inside (h, w) and box (4, h, w). The smaller of two things that share a cell has it."""
    core, inside = np.zeros((cells, cells), np.float32), np.zeros((cells, cells), np.float32)
    care, box = np.ones((cells, cells), np.float32), np.ones((4, cells, cells), np.float32)
    at = ((np.arange(cells) + 0.5) * STRIDE).astype(np.float32)
    areas = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    for k in np.argsort(-areas, kind="stable"):
        left, top, right, bottom = (float(v) for v in boxes[k])
        if right <= 0 or bottom <= 0 or left >= cells * STRIDE or top >= cells * STRIDE:
            continue
        whole = _span(at, left, right, 1.0), _span(at, top, bottom, 1.0)
        if not sure[k]:
            care[np.ix_(whole[1], whole[0])] = 0.0
            continue
        # cut by the piece's edge: what is left of it is what can be boxed
        clipped = np.clip([left, top, right, bottom], 0, cells * STRIDE)
        kept = (clipped[2] - clipped[0]) * (clipped[3] - clipped[1]) / max(areas[k], 1e-6)
        if kept < 0.5:
            care[np.ix_(whole[1], whole[0])] = 0.0
            continue
        left, top, right, bottom = (float(v) for v in clipped)
        inner = np.ix_(_span(at, top, bottom, _INNER), _span(at, left, right, _INNER))
        middle = np.ix_(_span(at, top, bottom, _CORE), _span(at, left, right, _CORE))
        care[np.ix_(whole[1], whole[0])] = np.maximum(care[np.ix_(whole[1], whole[0])] * 0.5, 0.0)
        core[inner], care[inner] = 0.0, 0.5
        inside[inner] = 1.0
        core[middle], care[middle] = 1.0, 1.0
        rows, columns = inner
        x, y = at[columns], at[rows]
        shape = np.broadcast_shapes(x.shape, y.shape)
        for side, value in enumerate((x - left, y - top, right - x, bottom - y)):
            box[(np.full(shape, side), *np.broadcast_arrays(rows, columns))] = np.maximum(
                np.broadcast_to(value, shape), 0.5
            )
    return core, care, inside, box


def _span(at: Floats, low: float, high: float, share: float) -> NDArray[np.intp]:
    middle, half = (low + high) / 2, max((high - low) / 2 * share, _LEAST_PX)
    return np.flatnonzero(np.abs(at - middle) <= half)


def shaded(rgb: Picture, rng: np.random.Generator) -> Picture:
    """Other exposure, white balance, sharpness and noise, as cameras differ."""
    gain = np.exp(rng.normal(0, 0.12)) * np.exp(rng.normal(0, 0.04, 3))
    gamma = float(np.exp(rng.normal(0, 0.12)))
    levels = np.arange(256) / 255.0
    table = np.stack([np.clip(g * levels**gamma, 0, 1) * 255 for g in gain], axis=1)
    out = np.asarray(cv2.LUT(np.ascontiguousarray(rgb), np.rint(table).astype(np.uint8).reshape(1, 256, 3)), np.uint8)
    if rng.random() < 0.25:
        out = np.asarray(cv2.GaussianBlur(out, (0, 0), float(rng.uniform(0.4, 1.1))), np.uint8)
    if rng.random() < 0.25:
        noise = rng.integers(-8, 9, (*out.shape[:2], 1), dtype=np.int16)
        out = np.clip(out.astype(np.int16) + noise, 0, 255).astype(np.uint8)
    return out
