"""From the proposer's maps to boxes, and from boxes to the crops that the namer looks at.

Training cuts its crops by the same functions, so that the namer sees at run time what it was trained on.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]


def proposals(
    objectness: Floats, box: Floats, *, stride: int, threshold: float, overlap: float, limit: int
) -> tuple[Floats, Floats]:
    """Boxes (P, 4) left, top, right, bottom in pixels, clipped to the picture, and their objectness (P,), best first.

    objectness: (h, w) 0..1; box: (4, h, w) as the proposer gives them, for one picture.
    """
    rows, columns = np.nonzero(objectness >= threshold)
    scores = objectness[rows, columns]
    order = np.argsort(-scores, kind="stable")[: limit * 12]
    rows, columns, scores = rows[order], columns[order], scores[order]
    x, y = (columns + 0.5) * stride, (rows + 0.5) * stride
    left, top, right, bottom = box[:, rows, columns]
    height, width = objectness.shape
    corners = np.stack([x - left, y - top, x + right, y + bottom], axis=1)
    corners = np.clip(corners, 0.0, np.array([width, height, width, height]) * stride).astype(np.float32)
    kept = suppressed(corners, overlap, limit)
    return corners[kept], scores[kept].astype(np.float32)


def suppressed(boxes: Floats, overlap: float, limit: int) -> list[int]:
    """Indices of the boxes, best first, that overlap no better one by more than `overlap`."""
    area = np.maximum(boxes[:, 2] - boxes[:, 0], 0) * np.maximum(boxes[:, 3] - boxes[:, 1], 0)
    free = area >= 4.0
    kept: list[int] = []
    for i in range(len(boxes)):
        if not free[i]:
            continue
        kept.append(i)
        if len(kept) == limit:
            break
        across = np.minimum(boxes[:, 2], boxes[i, 2]) - np.maximum(boxes[:, 0], boxes[i, 0])
        down = np.minimum(boxes[:, 3], boxes[i, 3]) - np.maximum(boxes[:, 1], boxes[i, 1])
        both = np.maximum(across, 0) * np.maximum(down, 0)
        free &= both <= overlap * (area + area[i] - both)
    return kept


def crop_squares(boxes: Floats, *, context: float, min_px: float) -> Floats:
    """(P, 3): x and y of the middle and the side, in pixels, of the square cut round each box."""
    wide, tall = boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1]
    side = np.maximum(context * np.maximum(wide, tall), min_px)
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    return np.concatenate([middle, side[:, None]], axis=1).astype(np.float32)


def cut_crops(rgb: Picture, squares: Floats, crop_px: int) -> Picture:
    """(P, crop_px, crop_px, 3): each square brought to the same size; beyond the picture its border is repeated.

    rgb: (H, W, 3).
    """
    out = np.empty((len(squares), crop_px, crop_px, 3), np.uint8)
    for k, (x, y, side) in enumerate(squares.astype(float)):
        out[k] = _cut(rgb, x, y, side, crop_px)
    return out


def _cut(rgb: Picture, x: float, y: float, side: float, crop_px: int) -> Picture:
    scale = crop_px / side
    if scale < 0.75:
        # so much smaller that single samples would skip pixels: the mean of each cell first
        height, width = rgb.shape[:2]
        left, top = max(0, int(x - side / 2) - 2), max(0, int(y - side / 2) - 2)
        right, low = min(width, int(x + side / 2) + 3), min(height, int(y + side / 2) + 3)
        if right > left and low > top:
            part = rgb[top:low, left:right]
            size = max(1, round((right - left) * scale)), max(1, round((low - top) * scale))
            rgb = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
            x, y, scale = (x - left) * size[0] / (right - left), (y - top) * size[1] / (low - top), 1.0
    half = crop_px / 2
    # pixel centres lie at +0.5; OpenCV counts them from 0
    move = np.array(
        [[scale, 0, half - scale * x - 0.5 + 0.5 * scale], [0, scale, half - scale * y - 0.5 + 0.5 * scale]]
    )
    return np.asarray(
        cv2.warpAffine(rgb, move, (crop_px, crop_px), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )
