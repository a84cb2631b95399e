"""The statistics that a LeRobot dataset carries of each feature, for each episode and for all: minimum, maximum, mean,
standard deviation, quantiles, and how many frames they are of."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from contracts.images import INVALID, NO_RETURN

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
SAMPLED_PX = 150
"""Of a picture every so manyth pixel is looked at that about this many of its longer side are."""
Statistics: TypeAlias = dict[str, NDArray[np.float64]]
"""By name; arrays of the feature's shape, of a picture (channels, 1, 1); `count` has shape (1,)."""


def of_vectors(values: NDArray[np.generic]) -> Statistics:
    """values: (frames,) or (frames, width); of a flag the share of frames that have it."""
    rows = values.astype(np.float64).reshape(len(values), -1)
    return _of_samples(rows, len(values))


def of_pictures(pictures: Sequence[NDArray[np.uint8]]) -> Statistics:
    """pictures: (H, W, 3) each; values in 0..1."""
    sampled = [_thinned(picture).reshape(-1, 3) for picture in pictures]
    found = _of_samples(np.concatenate(sampled).astype(np.float64) / 255.0, len(pictures))
    return _per_channel(found)


def of_depth(depths: Sequence[NDArray[np.uint16]], metres_per_unit: float) -> Statistics:
    """depths: (H, W) units each; metres, of what was measured alone: neither what is unknown nor what has no return."""
    sampled = np.concatenate([_thinned(depth).reshape(-1) for depth in depths])
    measured = sampled[(sampled != INVALID) & (sampled != NO_RETURN)].astype(np.float64) * metres_per_unit
    found = _of_samples((measured if len(measured) else np.zeros(1)).reshape(-1, 1), len(depths))
    return _per_channel(found)


def of_all(episodes: Sequence[Statistics]) -> Statistics:
    """Of all episodes together; the quantiles are the episodes' own, weighted by their frames."""
    counts = np.array([episode["count"][0] for episode in episodes])
    weights = counts / counts.sum()

    def weighted(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.asarray(np.tensordot(weights, np.stack(values), axes=1))

    mean = weighted([episode["mean"] for episode in episodes])
    spread = weighted([episode["std"] ** 2 + (episode["mean"] - mean) ** 2 for episode in episodes])
    return {
        "min": np.min([episode["min"] for episode in episodes], axis=0),
        "max": np.max([episode["max"] for episode in episodes], axis=0),
        "mean": mean,
        "std": np.sqrt(spread),
        "count": np.array([counts.sum()]),
        **{name: weighted([episode[name] for episode in episodes]) for name in QUANTILES},
    }


def _of_samples(rows: NDArray[np.float64], frames: int) -> Statistics:
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": np.array([float(frames)]),
        **{name: np.quantile(rows, share, axis=0) for name, share in QUANTILES.items()},
    }


def _per_channel(found: Statistics) -> Statistics:
    return {name: value if name == "count" else value.reshape(-1, 1, 1) for name, value in found.items()}


def _thinned(picture: NDArray[np.generic]) -> NDArray[np.generic]:
    step = max(1, max(picture.shape[:2]) // SAMPLED_PX)
    return picture[::step, ::step]
