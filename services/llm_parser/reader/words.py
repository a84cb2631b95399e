"""The word embeddings in four-bit integers: groups of 32 values share a scale."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GROUP = 32
LEAST = -8


class Words(NamedTuple):
    """A table of W words with H values each. `packed`: (W, H / 2), two values a byte, the first in the lower half, each
    8 more than it is; `scales`: (W, H / GROUP), what one step is worth."""

    packed: NDArray[np.uint8]
    scales: NDArray[np.float16]

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
