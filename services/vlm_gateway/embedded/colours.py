"""Which pixels have a named colour, and the connected patches they form.

A table over 32 x 32 x 32 colours holds, for each name, how much likelier that pixel colour is on a thing called so
than anywhere else in a picture; it is counted from pictures, so it knows about shade, haze and brick.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

BITS = 5
BINS = 1 << (3 * BITS)
MAX_PATCHES = 40
MIN_AREA_PX = 28
LIKELY = 110
"""Of 255; pixels under it don't start a patch."""
THIN_PX = (7, 15)
SAME_SHARE = 0.7
COMMON_SHARE = 0.03
"""A colour that fills more of a picture than this is wall, glass or sky."""

Picture = NDArray[np.uint8]


class Patch(NamedTuple):
    """Pixels: left, top, width, height of a patch, and how many of them have the colour."""

    x: int
    y: int
    width: int
    height: int
    area: int


def bin_index(rgb: Picture) -> NDArray[np.uint16]:
    """(H, W, 3) -> (H, W): the table's row of each pixel."""
    coarse = rgb >> (8 - BITS)
    r, g, b = (coarse[:, :, k].astype(np.uint16) for k in range(3))
    return np.asarray((r << (2 * BITS)) | (g << BITS) | b, np.uint16)


class Coded(NamedTuple):
    """A picture's colours: the table's row of each pixel (H, W), and which rows are common in this picture (BINS,)."""

    rows: NDArray[np.uint16]
    common: NDArray[np.bool_]


def coded(rgb: Picture) -> Coded:
    index = bin_index(rgb)
    return Coded(index, np.bincount(index.ravel(), minlength=BINS) > COMMON_SHARE * index.size)


def likeness(picture: Coded, table: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) 0..255: how likely each pixel is of the table's colour, what is common in the picture left out.

    table: (BINS,).
    """
    return np.take(np.where(picture.common, np.uint8(0), table), picture.rows)


def patches(like: NDArray[np.uint8]) -> list[Patch]:
    """The patches of likely pixels, those with the most pixels first, at most MAX_PATCHES.

    A thing may touch a window's frame, a bar or a gutter of its own colour: patches are looked for once more with all
    that is thinner than each of THIN_PX taken away.
    """
    side = like.shape[0]
    mask = (like >= LIKELY).astype(np.uint8)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    found = _components(np.asarray(closed, np.uint8), side)
    for thin in THIN_PX:
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (thin, thin))
        thick = _components(np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel), np.uint8), side)
        found += [p for p in thick if not any(_alike(p, q) for q in found)]
    return sorted(found, key=lambda p: -p.area)[:MAX_PATCHES]


def _components(mask: NDArray[np.uint8], side: int) -> list[Patch]:
    count, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8, ltype=cv2.CV_32S)
    stats = stats[1:count]
    w, h, area = stats[:, 2], stats[:, 3], stats[:, 4]
    keep = (area >= MIN_AREA_PX) & (w >= 4) & (h >= 4) & (w <= side * 0.4) & (h <= side * 0.45)
    stats = stats[keep]
    order = np.argsort(-stats[:, 4], kind="stable")[:MAX_PATCHES]
    return [Patch(*(int(v) for v in row)) for row in stats[order]]


def _alike(p: Patch, q: Patch) -> bool:
    """Whether two boxes share most of their area."""
    across = min(p.x + p.width, q.x + q.width) - max(p.x, q.x)
    down = min(p.y + p.height, q.y + q.height) - max(p.y, q.y)
    shared = max(0, across) * max(0, down)
    return shared > SAME_SHARE * (p.width * p.height + q.width * q.height - shared)
