"""A perceptron of one hidden layer: small enough to ship in a few hundred kilobytes, fast enough for one core."""

from collections.abc import Mapping
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


class Perceptron(NamedTuple):
    """`mean` and `scale` (D,) standardise the input; w1 (D, H), b1 (H,), w2 (H, C), b2 (C,)."""

    mean: Floats
    scale: Floats
    w1: Floats
    b1: Floats
    w2: Floats
    b2: Floats

    def logits(self, x: Floats) -> Floats:
        """(N, D) -> (N, C)."""
        hidden = np.maximum((x - self.mean) * self.scale @ self.w1 + self.b1, 0.0)
        return np.asarray(hidden @ self.w2 + self.b2, np.float32)

    def packed(self, name: str) -> dict[str, NDArray[np.float16]]:
        """Arrays to save under `<name>.<field>`, in half precision."""
        return {f"{name}.{field}": value.astype(np.float16) for field, value in self._asdict().items()}

    @classmethod
    def unpacked(cls, name: str, arrays: Mapping[str, NDArray[np.float16]]) -> Self:
        """Raises KeyError where the arrays hold no such perceptron."""
        return cls(**{field: np.asarray(arrays[f"{name}.{field}"], np.float32) for field in cls._fields})


def softmax(logits: Floats) -> Floats:
    """(N, C) rows that sum to one."""
    raised = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(raised / raised.sum(axis=1, keepdims=True), np.float32)


def sigmoid(logits: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logits, -30, 30))), np.float32)
