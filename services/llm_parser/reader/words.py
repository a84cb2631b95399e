"""The word embeddings in four-bit integers: groups of 32 values share a scale."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GROUP = 32
LEAST, MOST = -8, 7


class Words(NamedTuple):
    """A table of W words with H values each. `packed`: (W, H / 2), two values a byte, the first in the lower half, each
    8 more than it is; `scales`: (W, H / GROUP), what one step is worth."""

    packed: NDArray[np.uint8]
    scales: NDArray[np.float16]

    @classmethod
    def rounded(cls, table: NDArray[np.float32]) -> "Words":
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
        return cls(packed, best[..., 0])

    def rows(self, ids: NDArray[np.int64]) -> NDArray[np.float32]:
        """(T,) -> (T, H)."""
        packed = self.packed[ids]
        steps = np.stack((packed & 15, packed >> 4), axis=-1).astype(np.float32) + LEAST
        scaled = steps.reshape(len(ids), -1, GROUP) * self.scales[ids].astype(np.float32)[..., None]
        return scaled.reshape(len(ids), -1)

    def all(self) -> NDArray[np.float32]:
        """(W, H)."""
        return self.rows(np.arange(len(self.packed)))

    def save(self, path: Path) -> None:
        np.savez(path, packed=self.packed, scales=self.scales)

    @classmethod
    def load(cls, path: Path) -> "Words":
        with np.load(path) as stored:
            return cls(stored["packed"], stored["scales"])


def _steps(groups: NDArray[np.float32], scales: NDArray[np.float16]) -> NDArray[np.float32]:
    return np.clip(np.rint(groups / scales.astype(np.float32)), LEAST, MOST)


def _nonzero(scales: NDArray[np.float16]) -> NDArray[np.float16]:
    return np.where(scales == 0, np.float16(1e-4), scales)
