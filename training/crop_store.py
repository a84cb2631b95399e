"""What the namer is fitted to: crops round things and round nothing, cut once from the shards and kept beside them."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vlm_gateway.embedded.crops import crop_squares, cut_crops
from training.pieces import shaded
from training.shards import Picture, Shard, read

CONTEXT, LEAST_PX = 1.6, 24.0
"""The namer's square: so much wider than the box, and no smaller than this."""
KEPT_PX = 96
ROOM = 1.5
"""The kept square is so much wider than the namer's, so that it can be moved and resized."""
MIN_PIXELS, MIN_SHARE = 50, 0.25
SAME, OTHER = 0.4, 0.15
"""Overlap (intersection over union) from which a proposal is the thing, and up to which it is none."""
BACKGROUNDS_A_PICTURE = 3

Floats = NDArray[np.float32]
Propose = Callable[[Picture], Floats]
"""(H, W, 3) to boxes (P, 4) in pixels."""


class Crops(NamedTuple):
    """rgb (M, KEPT_PX, KEPT_PX, 3); kind (M,), the number of classes for nothing; colour (M,); box (M, 4) of the
    thing itself in 0..1 of the kept square."""

    rgb: Picture
    kind: NDArray[np.int64]
    colour: NDArray[np.int64]
    box: Floats


def collect(
    shard_paths: Iterable[Path],
    folder: Path,
    kinds: int,
    *,
    context: float,
    min_px: float,
    propose: Propose | None = None,
) -> list[Path]:
    """Cuts what has not been cut yet; the files, in the shards' order. With `propose` the proposals are cut as well:
    things as they will be met, and what is wrongly taken for one."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for path in shard_paths:
        file = folder / f"{path.stem}.npz"
        if not file.exists():
            crops = crops_of(read(path), kinds, context=context, min_px=min_px, propose=propose)
            part = file.with_suffix(".part")
            with part.open("wb") as out:
                np.savez(out, **crops._asdict())
            part.rename(file)
        files.append(file)
    return files


def crops_of(shard: Shard, kinds: int, *, context: float, min_px: float, propose: Propose | None = None) -> Crops:
    """Every thing seen well enough, and backgrounds: chosen at random on the building, or proposed in error."""
    rng = np.random.default_rng((shard.seed, 0xC20))
    rows: list[Crops] = []
    for view in range(len(shard.jpegs)):
        rgb = shard.picture(view)
        things = shard.things[shard.things["view"] == view]
        boxes = things["box"].reshape(-1, 4).astype(np.float32)
        sure = (things["pixels"] >= MIN_PIXELS) & (things["share"] >= MIN_SHARE)
        kind, colour = things["kind"].astype(np.int64), things["colour"].astype(np.int64)
        asked, owner = boxes[sure], np.flatnonzero(sure)
        if propose is not None:
            proposed = propose(rgb)
            match = overlap_matrix(proposed, boxes)
            best = match.argmax(axis=1) if len(boxes) else np.zeros(len(proposed), np.intp)
            most = match.max(axis=1) if len(boxes) else np.zeros(len(proposed))
            same = (most >= SAME) & sure[best] if len(boxes) else np.zeros(len(proposed), np.bool_)
            none = most <= OTHER
            asked = np.concatenate([asked, proposed[same], proposed[none]])
            owner = np.concatenate([owner, best[same], np.full(int(none.sum()), -1)])
        nothing = backgrounds(shard.building[view], boxes, rng)
        asked = np.concatenate([asked, nothing]).astype(np.float32)
        owner = np.concatenate([owner, np.full(len(nothing), -1)]).astype(np.intp)
        squares = crop_squares(asked, context=context, min_px=min_px)
        squares[:, 2] *= ROOM
        true = boxes[owner] if len(boxes) else np.zeros((len(owner), 4), np.float32)
        corner = squares[:, :2] - squares[:, 2:] / 2
        inside = (true - np.concatenate([corner, corner], axis=1)) / squares[:, 2:]
        rows.append(
            Crops(
                cut_crops(rgb, squares, KEPT_PX),
                np.where(owner >= 0, kind[owner] if len(kind) else 0, kinds).astype(np.int64),
                np.where(owner >= 0, colour[owner] if len(colour) else 0, 0).astype(np.int64),
                inside.astype(np.float32),
            )
        )
    return Crops(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))


def backgrounds(building: NDArray[np.uint8], boxes: Floats, rng: np.random.Generator) -> Floats:
    """(B, 4) boxes on the building, or rarely elsewhere, in which there is no thing."""
    rows, columns = np.nonzero(building > 128)
    size = len(building) * 8
    found = []
    for _ in range(BACKGROUNDS_A_PICTURE):
        if len(rows) and rng.random() < 0.85:
            k = int(rng.integers(len(rows)))
            x, y = columns[k] * 8 + 4, rows[k] * 8 + 4
        else:
            x, y = rng.uniform(0, size, 2)
        w, h = np.exp(rng.uniform(np.log(12), np.log(110))) * np.exp(rng.normal(0, 0.3, 2))
        box = np.array([[x - w / 2, y - h / 2, x + w / 2, y + h / 2]], np.float32)
        if not len(boxes) or _shared(box[0], boxes).max() < 0.1:
            found.append(np.clip(box[0], 0, size))
    return np.array(found, np.float32).reshape(-1, 4)


def _shared(box: Floats, others: Floats) -> Floats:
    """The share of each of `others`, or of the box if that is more, that both cover."""
    both = np.maximum(0, np.minimum(others[:, 2:], box[2:]) - np.maximum(others[:, :2], box[:2])).prod(axis=1)
    area = (others[:, 2:] - others[:, :2]).prod(axis=1)
    return np.asarray(both / np.minimum(area, (box[2:] - box[:2]).prod()).clip(1e-6), np.float32)


def overlap_matrix(a: Floats, b: Floats) -> Floats:
    """(A, B) intersections over unions of boxes (A, 4) and (B, 4)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = np.maximum(high - low, 0).prod(axis=2)
    area_a, area_b = ((x[:, 2:] - x[:, :2]).prod(axis=1) for x in (a, b))
    return np.asarray(both / np.maximum(area_a[:, None] + area_b[None] - both, 1e-6), np.float32)


class CropBatches:
    """Batches drawn from crop files; the same batch for the same number."""

    def __init__(self, files: Sequence[Path], kinds: int, seed: int, nothing: float = 0.22) -> None:
        loaded = [Crops(**dict(np.load(f))) for f in files]
        if not loaded:
            raise ValueError("there are no crops to train on")
        self._rgb = [c.rgb for c in loaded]
        self._file = np.concatenate([np.full(len(c.kind), i) for i, c in enumerate(loaded)])
        self._row = np.concatenate([np.arange(len(c.kind)) for c in loaded])
        self._kind, self._colour = (np.concatenate([getattr(c, n) for c in loaded]) for n in ("kind", "colour"))
        self._box = np.concatenate([c.box for c in loaded])
        counts = np.bincount(self._kind, minlength=kinds + 1).astype(float)
        weights = 1 / np.sqrt(counts[self._kind])
        empty = self._kind == kinds
        if empty.any() and not empty.all():
            weights[empty] *= nothing / (1 - nothing) * weights[~empty].sum() / weights[empty].sum()
        self._chances = np.cumsum(weights / weights.sum())
        self._seed = seed

    def __len__(self) -> int:
        return len(self._kind)

    def batch(self, number: int, size: int, crop_px: int) -> Crops:
        """rgb (size, crop_px, crop_px, 3); boxes in 0..1 of it."""
        rng = np.random.default_rng((self._seed, number))
        chosen = np.minimum(np.searchsorted(self._chances, rng.random(size)), len(self._kind) - 1)
        rgb = np.empty((size, crop_px, crop_px, 3), np.uint8)
        box = self._box[chosen].copy()
        for k, i in enumerate(chosen):
            rgb[k], box[k] = moved(self._rgb[self._file[i]][self._row[i]], box[k], crop_px, rng)
        return Crops(rgb, self._kind[chosen], self._colour[chosen], box)


def moved(kept: Picture, box: Floats, crop_px: int, rng: np.random.Generator) -> tuple[Picture, Floats]:
    """A crop as an inexact proposal would have cut it, half of them mirrored, in other light."""
    side = min(1.0, float(np.exp(rng.normal(0, 0.14))) / ROOM)
    middle = np.clip(0.5 + rng.normal(0, 0.05, 2), side / 2, 1 - side / 2)
    scale = crop_px / (side * len(kept))
    shift = crop_px / 2 - middle * len(kept) * scale - 0.5 + 0.5 * scale
    move = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    rgb = np.asarray(
        cv2.warpAffine(kept, move, (crop_px, crop_px), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
        np.uint8,
    )
    inside = ((box.reshape(2, 2) - middle + side / 2) / side).reshape(4)
    if rng.random() < 0.5:
        rgb = np.ascontiguousarray(rgb[:, ::-1])
        inside = np.array([1 - inside[2], inside[1], 1 - inside[0], inside[3]])
    if rng.random() < 0.3:
        # as if seen from farther away
        small = int(crop_px * rng.uniform(0.3, 0.8))
        less = cv2.resize(rgb, (small, small), interpolation=cv2.INTER_AREA)
        rgb = np.asarray(cv2.resize(less, (crop_px, crop_px)), np.uint8)
    return shaded(rgb, rng), inside.astype(np.float32)
