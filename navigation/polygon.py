"""Outlines on the ground plan: which points lie inside."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def inside(points: ArrayLike, outline: ArrayLike) -> NDArray[np.bool_]:
    """(N,) does each point (N, 2) lie inside the closed outline (K, 2), given either way round? By the even-odd rule; a
    point right on an edge may be either."""
    at = np.asarray(points, np.float64).reshape(-1, 2)
    a = np.asarray(outline, np.float64).reshape(-1, 2)
    b = np.roll(a, -1, axis=0)
    y = at[:, 1:2]
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return np.asarray((straddles & (at[:, 0:1] < x)).sum(axis=1) % 2 == 1)
