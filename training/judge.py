"""What the trained pair sees on labelled pictures: the raw material of thresholds, calibration and figures."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.vlm_gateway.embedded.crops import crop_squares, cut_crops, proposals
from services.vlm_gateway.embedded.exported import Exported
from services.vlm_gateway.embedded.floors import box_of, profile_of, rows_in, rows_of
from services.vlm_gateway.embedded.model import brightened, softmax, tightened
from services.vlm_gateway.embedded.network import Networks
from training.crop_store import overlap_matrix
from training.shards import read

Floats = NDArray[np.float32]
RIGHT = 0.3
"""Overlap from which a box means the thing."""
_TRUE_ROW = 0.4
"""Of a label's ridge: one that is hidden in part counts as seen from here on."""
FAIR_SHARE, FAIR_PIXELS, FAIR_M = 0.6, 200, 10.0
"""What should be found: so much of it seen, so large, so near."""


class SeenPicture(NamedTuple):
    """One picture as the pair sees it. boxes, tight (P, 4) pixels; kind (P, C + 1), colour (P, K) shares; true_kind,
    true_colour the same for crops of the things' own boxes; row_profile (h,) of window rows at the picture's middle,
    rows_true how many there are."""

    seed: int
    frontal: bool
    things: NDArray[np.void]
    boxes: Floats
    tight: Floats
    kind: Floats
    colour: Floats
    true_kind: Floats
    true_colour: Floats
    row_profile: Floats
    rows_true: int
    box_overlap: float


def looks(paths: Iterable[Path], networks: Networks, model: Exported) -> Iterator[SeenPicture]:
    """Every picture of the shards."""
    for path in paths:
        shard = read(path)
        for view in range(len(shard.jpegs)):
            rgb = brightened(shard.picture(view))
            maps = networks.propose(rgb[None])
            boxes, _ = proposals(
                maps.objectness[0],
                maps.box[0],
                stride=model.stride,
                threshold=model.proposing.threshold,
                overlap=model.proposing.overlap,
                limit=model.proposing.limit,
            )
            things = shard.things[shard.things["view"] == view]
            true = things["box"].reshape(-1, 4).astype(np.float32)
            squares = crop_squares(np.concatenate([boxes, true]), context=model.crop_context, min_px=model.crop_min_px)
            kind, colour, tight = _named(networks, rgb, squares, model)
            n = len(boxes)
            true_rows = rows_of(
                shard.row[view].astype(np.float32) / 255,
                shard.building[view].astype(np.float32) / 255,
                likely=_TRUE_ROW,
                inside=model.building,
            )
            yield SeenPicture(
                shard.seed,
                bool(shard.frontal[view]),
                things,
                boxes,
                tightened(boxes, squares[:n], tight[:n]),
                kind[:n],
                colour[:n],
                kind[n:],
                colour[n:],
                profile_of(maps.row[0], maps.building[0], inside=model.building),
                len(true_rows),
                _outline_overlap(maps.building[0], shard.building[view], model.building),
            )


def _named(
    networks: Networks, rgb: NDArray[np.uint8], squares: Floats, model: Exported
) -> tuple[Floats, Floats, Floats]:
    if not len(squares):
        return (
            np.zeros((0, len(model.kinds) + 1), np.float32),
            np.zeros((0, len(model.colours)), np.float32),
            np.zeros((0, 4), np.float32),
        )
    said = networks.name(cut_crops(rgb, squares, model.crop_px))
    return softmax(said.kind), softmax(said.colour), said.box


def _outline_overlap(seen: Floats, true: NDArray[np.uint8], inside: float) -> float:
    """Intersection over union of the building's boxes; nan where there is no building."""
    a, b = box_of(seen, inside=inside), box_of(np.asarray(true / 255, np.float32), inside=0.5)
    if b is None:
        return float("nan")
    if a is None:
        return 0.0
    corners = [np.array([[v.x_min, v.y_min, v.x_max, v.y_max]], np.float32) for v in (a[0], b[0])]
    return float(overlap_matrix(*corners)[0, 0])


def fair(things: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which things should be found."""
    return np.asarray(
        (things["share"] >= FAIR_SHARE) & (things["pixels"] >= FAIR_PIXELS) & (things["distance_m"] <= FAIR_M)
    )


def figures(all_looks: Iterable[SeenPicture], row: float) -> dict[str, float]:
    """Shares over all pictures: proposals, names on true boxes, floors on square pictures (rows of at least `row`), the
    building's box."""
    proposed, overlap, named, painted, both = [], [], [], [], []
    floors, near, outline, claims = [], [], [], []
    for look in all_looks:
        good = fair(look.things)
        if good.any():
            true = look.things["box"].reshape(-1, 4)[good].astype(np.float32)
            best = overlap_matrix(true, look.boxes).max(axis=1) if len(look.boxes) else np.zeros(int(good.sum()))
            proposed += list(best >= RIGHT)
            overlap += list(best[best >= RIGHT])
            kind, colour = look.things["kind"][good], look.things["colour"][good]
            k, c = look.true_kind[good].argmax(1) == kind, look.true_colour[good].argmax(1) == colour
            named += list(k)
            painted += list(c)
            both += list(k & c)
        claims.append(float((look.kind[:, :-1].max(axis=1) > 0.5).sum()) if len(look.kind) else 0.0)
        if look.frontal:
            rows = len(rows_in(look.row_profile, row))
            floors.append(rows == look.rows_true)
            near.append(abs(rows - look.rows_true) <= 1)
            if np.isfinite(look.box_overlap):
                outline.append(look.box_overlap)
    means = {
        "proposal recall": proposed,
        "proposal overlap": overlap,
        "kind on true boxes": named,
        "colour on true boxes": painted,
        "kind and colour on true boxes": both,
        "floors exact": floors,
        "floors within one": near,
        "building box overlap": outline,
        "named things a picture": claims,
    }
    counts = {"things judged": float(len(proposed)), "square pictures": float(len(floors))}
    return {name: float(np.mean(values)) for name, values in means.items() if values} | counts
