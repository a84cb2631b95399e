"""A table of word embeddings as services.llm_parser.reader.words holds it: four bits a value."""

import numpy as np
from numpy.typing import NDArray

from services.llm_parser.reader.words import GROUP, LEAST, Words

MOST = 7


def rounded(table: NDArray[np.float32]) -> Words:
    """table: (W, H); each group's scale is the one of a few that leaves the least squared error."""
    groups = table.reshape(len(table), -1, GROUP)
    widest = np.take_along_axis(groups, np.abs(groups).argmax(2)[..., None], 2)  # reaches `LEAST`, the farther end
    best = np.zeros_like(widest, np.float16)
    least = np.full(widest.shape, np.inf, np.float32)
    for share in (0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05):
        scales = _nonzero((share * widest / LEAST).astype(np.float16))
        error = ((_steps(groups, scales) * scales.astype(np.float32) - groups) ** 2).sum(2, keepdims=True)
        best, least = np.where(error < least, scales, best), np.minimum(error, least)
    steps = (_steps(groups, best) - LEAST).astype(np.uint8).reshape(len(table), -1)
    packed: NDArray[np.uint8] = np.bitwise_or(steps[:, 0::2], np.left_shift(steps[:, 1::2], 4)).astype(np.uint8)
    return Words(packed, best[..., 0])


def _steps(groups: NDArray[np.float32], scales: NDArray[np.float16]) -> NDArray[np.float32]:
    return np.clip(np.rint(groups / scales.astype(np.float32)), LEAST, MOST)


def _nonzero(scales: NDArray[np.float16]) -> NDArray[np.float16]:
    return np.where(scales == 0, np.float16(1e-4), scales)
