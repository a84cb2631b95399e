"""Railings that depth misses. A stereo camera looks through a pane and drops a bar of a few pixels, but it sees the
slab that they stand on. So of a sensor that leaves pixels invalid, whatever juts out above head height is taken to
carry a railing of the usual height, seen or not."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from navigation.camera import DepthView
from navigation.point_cloud import Points

Float = TypeVar("Float", np.float32, np.float64)

RAILING_M = 1.1
"""Building codes ask for 0.9 to 1.1 m."""
_ABOVE_M = 2.0
"""Lower things are hedges, walls and cars."""
_CELL_M = 0.25
_UP_M = (RAILING_M / 2, RAILING_M)
STEPS = len(_UP_M)


def misses_railings(views: Sequence[DepthView]) -> bool:
    """Is this a sensor that leaves pixels invalid? Views as the cameras gave them or as `read_views` gives them."""
    return any(bool(np.isnan(view.depth_m).any()) for view in views)


def tops(points: Points) -> Points:
    """(K, 3) of points (N, 3) ENU, heights above ground: the highest over each patch of the ground plan, of those that
    may carry a railing."""
    high = points[points[:, 2] > _ABOVE_M]
    cells = np.floor(high[:, :2] / np.float32(_CELL_M)).astype(np.int64)
    order = np.lexsort((-high[:, 2], cells[:, 1], cells[:, 0]))
    first = np.ones(len(high), bool)
    first[1:] = (np.diff(cells[order], axis=0) != 0).any(axis=1)
    kept: Points = high[order[first]]
    return kept


def railings_on(carriers: NDArray[Float]) -> NDArray[Float]:
    """(STEPS * K, 3) where the railings on those (K, 3) would be: all half way up, then all at the hand rail."""
    return np.concatenate([carriers + np.array((0.0, 0.0, up), carriers.dtype) for up in _UP_M])
