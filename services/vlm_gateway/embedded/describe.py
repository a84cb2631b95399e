"""What a patch looks like, as numbers: outlines, the likeness map, colours, size."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vlm_gateway.embedded.colours import Patch

SIDE = 40
CELL = 8
TURNS = 8
AROUND = 1.6
LARGE = 0.1
"""Of the picture's side."""
Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]


def describe(rgb: Picture, like: NDArray[np.uint8], found: list[Patch], colour: int, colours: int) -> Floats:
    """(N, D): one row a patch. rgb: (H, W, 3); like: (H, W), its likeness to the colour looked for; `colour` is that
    colour's number of `colours`."""
    if not found:
        return np.zeros((0, width(colours)), np.float32)
    cut = np.stack([_cut(rgb, p) for p in found]).astype(np.float32) / 255.0
    soft = np.stack([_cut(like, p) for p in found]).astype(np.float32) / 255.0
    shapes = np.array([_shape(p, rgb.shape[0]) for p in found], np.float32)
    asked = np.zeros((len(found), colours), np.float32)
    asked[:, colour] = 1.0
    n = len(found)
    grey = cut.mean(axis=3)
    tiny = cut.reshape(n, SIDE // CELL, CELL, SIDE // CELL, CELL, 3).mean(axis=(2, 4)).reshape(n, -1)
    mask = soft.reshape(n, SIDE // 4, 4, SIDE // 4, 4).mean(axis=(2, 4)).reshape(n, -1)
    return np.concatenate([_turns(grey), _turns(soft), tiny, mask, shapes, asked], axis=1)


def width(colours: int) -> int:
    """How long a row of `describe` is."""
    cells = (SIDE // CELL) ** 2
    return 2 * cells * TURNS + 3 * cells + (SIDE // 4) ** 2 + 6 + colours


def _cut(picture: NDArray[np.uint8], p: Patch) -> NDArray[np.uint8]:
    side = max(AROUND * max(p.width, p.height), 14.0)
    x, y = p.x + p.width / 2, p.y + p.height / 2
    k = SIDE / side
    move = np.array([[k, 0, SIDE / 2 - k * x], [0, k, SIDE / 2 - k * y]], np.float64)
    if k < 0.7:
        # so much smaller that single samples would skip pixels: take the mean of the square instead
        left, top = max(0, int(x - side / 2)), max(0, int(y - side / 2))
        right, low = min(picture.shape[1], int(x + side / 2) + 1), min(picture.shape[0], int(y + side / 2) + 1)
        part = picture[top:low, left:right]
        shrunk = cv2.resize(part, None, fx=k, fy=k, interpolation=cv2.INTER_AREA)
        move = np.array([[1, 0, SIDE / 2 - k * (x - left)], [0, 1, SIDE / 2 - k * (y - top)]], np.float64)
        picture = np.asarray(shrunk, np.uint8)
    return np.asarray(
        cv2.warpAffine(picture, move, (SIDE, SIDE), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )


def _turns(grey: Floats) -> Floats:
    """(N, SIDE, SIDE) -> (N, cells * TURNS): how much edge of each direction each cell holds, brightness aside."""
    gx = np.zeros_like(grey)
    gy = np.zeros_like(grey)
    gx[:, :, 1:-1] = grey[:, :, 2:] - grey[:, :, :-2]
    gy[:, 1:-1, :] = grey[:, 2:, :] - grey[:, :-2, :]
    strength = np.hypot(gx, gy)
    turn = (np.arctan2(gy, gx) / np.pi * TURNS) % TURNS
    n, cells = len(grey), SIDE // CELL
    out = np.empty((n, cells, cells, TURNS), np.float32)
    for k in range(TURNS):
        near = np.abs((turn - k + TURNS / 2) % TURNS - TURNS / 2)
        share = strength * np.maximum(0.0, 1.0 - near)
        out[:, :, :, k] = share.reshape(n, cells, CELL, cells, CELL).sum(axis=(2, 4))
    flat = out.reshape(n, -1)
    return np.asarray(np.sqrt(flat / (flat.sum(axis=1, keepdims=True) + 0.5)), np.float32)


def _shape(p: Patch, side: int) -> tuple[float, ...]:
    # from near, size says nothing more: a large patch is not to look strange for having been learnt from afar
    w, h = min(p.width / side, LARGE), min(p.height / side, LARGE)
    return (
        float(np.log(w)),
        float(np.log(h)),
        float(np.log(p.width / p.height)),
        p.area / (p.width * p.height),
        (p.x + p.width / 2) / side,
        (p.y + p.height / 2) / side,
    )
