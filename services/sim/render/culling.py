"""Which chunks of a scene a view can see, nearest first: what is near hides what is far before it is shaded."""

import numpy as np
from numpy.typing import NDArray


def visible_chunks(
    low: NDArray[np.float64], high: NDArray[np.float64], eye: NDArray[np.float64], axes: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Indices of the boxes low..high ((C, 3) each) that reach into a 90-degree view; `axes` as in `view_axes`."""
    if not len(low):
        return np.zeros(0, np.int64)
    right, up, forward = axes
    planes = np.stack([forward, forward - right, forward + right, forward - up, forward + up])
    # a box is outside when even its corner farthest along a plane's normal is behind that plane
    centre, half = (low + high) / 2 - eye, (high - low) / 2
    inside = (centre @ planes.T + half @ np.abs(planes).T >= 0).all(axis=1)
    index = np.nonzero(inside)[0]
    gap = np.maximum(np.maximum(low[index] - eye, eye - high[index]), 0.0)
    return index[np.argsort(np.einsum("ij,ij->i", gap, gap), kind="stable")]
