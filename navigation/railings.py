"""Railings that depth misses. A stereo camera looks through a pane and drops a bar of a few pixels, but it sees the
slab that they stand on, and some of what stands on it: a post, a piece of the hand rail, a chair. So of a sensor that
leaves pixels invalid, what is level above head height and has something on it is taken to carry a railing of the usual
height, seen or not. A roof and an awning, on which nothing stands, carry none."""

import itertools
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.camera import Pose
from navigation.point_cloud import Points

Float = TypeVar("Float", np.float32, np.float64)

RAILING_M = 1.1
"""Building codes ask for 0.9 to 1.1 m."""
_ABOVE_M = 2.0
"""Lower things are hedges, walls and cars."""
_REACH_M, _BELOW_M, _OVER_M = 16.0, 8.0, 1.5
"""What is farther off is looked at again before the drone gets there."""
_CELL_M, _LAYER_M = 0.25, 0.1
_ABOUT = 2
_FEWEST = 5
_BROAD_M = 0.24
"""Standard deviation of what is as high about a point, in whichever direction; a wall and a steep roof are narrower."""
_STANDS_M = (0.35, 0.95)
"""Above the slab. Sills, and what is on them, are higher."""
_BESIDE_CELLS, _SAME_SLAB_LAYERS = 8, 2
_FEW = 3
_UP_M = (RAILING_M / 2, RAILING_M)


def carriers(points: Points, pose: Pose) -> Points:
    """(K, 3) of points (N, 3) ENU about the drone, heights above ground: where something level is on which something
    stands, one for each cell of the ground plan and each height."""
    low = max(_ABOVE_M, pose.z - _BELOW_M)
    corner = np.array((pose.x - _REACH_M, pose.y - _REACH_M, low), np.float32)
    size = np.array((2 * _REACH_M / _CELL_M, 2 * _REACH_M / _CELL_M, (pose.z + _OVER_M - low) / _LAYER_M), np.int64)
    if size[2] <= 0:
        return points[:0]
    at = np.floor((points - corner) / np.array((_CELL_M, _CELL_M, _LAYER_M), np.float32)).astype(np.int64)
    inside = np.flatnonzero(((at >= 0) & (at < size)).all(axis=1))
    filled = np.zeros(size + 2 * _ABOUT, bool)
    at = at[inside] + _ABOUT
    cells, first = np.unique(np.ravel_multi_index((at[:, 0], at[:, 1], at[:, 2]), filled.shape), return_index=True)
    filled.ravel()[cells] = True
    level = first[_is_level(filled, cells)]
    filled[..., 0] = True  # below all: the top of a column of which nothing is known
    top = size[2] + 2 * _ABOUT - 1 - np.argmax(filled[..., ::-1], axis=2)
    laden = _stands_on(top, at[level])
    many = _counted_beside(at[level], at[level][laden], filled.shape) >= _FEW
    found: Points = points[inside[level[many]]]
    return found


def railings_on(slabs: NDArray[Float]) -> NDArray[Float]:
    """(2 K, 3) where railings on those (K, 3) would be: all half way up, then all at the hand rail."""
    return np.concatenate([slabs + np.array((0.0, 0.0, up), slabs.dtype) for up in _UP_M])


def _is_level(filled: NDArray[np.bool_], cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(V,) of the cells, by their places in `filled`, which is empty along its rim: those with something as high, or
    a layer higher or lower, broadly about them."""
    _, across, layers = filled.shape
    shown = filled.ravel()
    count, x, y, xx, yy, xy = np.zeros((6, len(cells)))
    for dx in range(-_ABOUT, _ABOUT + 1):
        for dy in range(-_ABOUT, _ABOUT + 1):
            beside = cells + (dx * across + dy) * layers
            here = shown[beside - 1] | shown[beside] | shown[beside + 1]
            for total, share in zip((count, x, y, xx, yy, xy), (1, dx, dy, dx * dx, dy * dy, dx * dy), strict=True):
                if share:
                    total[here] += share
    mean_x, mean_y = x / count, y / count
    xx, yy, xy = xx / count - mean_x**2, yy / count - mean_y**2, xy / count - mean_x * mean_y
    narrowest = (xx + yy) / 2 - np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    return np.asarray((count >= _FEWEST) & (narrowest * _CELL_M**2 >= _BROAD_M**2))


def _stands_on(top: NDArray[np.int64], at: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(V,) of level cells (V, 3): those on or just beside which something ends so high that it stands there. `top`:
    (C, C) the highest filled layer. What ends so high by a wall may be a sill."""
    x, y, z = (at[:, axis] for axis in range(3))
    about = cv2.dilate(top.astype(np.int16), np.ones((3, 3), np.uint8))
    stands = np.zeros(len(at), bool)
    for dx, dy in itertools.product((-1, 0, 1), repeat=2):  # at its edge a slab is not level all about
        over_m = (top[x + dx, y + dy] - z) * _LAYER_M
        by_a_wall = (about[x + dx, y + dy] - z) * _LAYER_M > RAILING_M
        stands |= (over_m >= _STANDS_M[0]) & (over_m <= _STANDS_M[1]) & ~by_a_wall
    return stands


def _counted_beside(at: NDArray[np.int64], laden: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(V,) how many of the cells `laden` (L, 3) lie beside each of the cells `at` (V, 3), on the same slab: by sums
    over a box, whatever their number."""
    sums = np.zeros([size + 1 for size in shape], np.int32)
    sums[tuple((laden + 1).T)] = 1
    for axis in range(3):
        np.cumsum(sums, axis=axis, out=sums)
    reach = np.array((_BESIDE_CELLS, _BESIDE_CELLS, _SAME_SLAB_LAYERS))
    low, high = np.maximum(at - reach, 0), np.minimum(at + reach + 1, shape)
    count = np.zeros(len(at), np.int64)
    for corner in itertools.product((0, 1), repeat=3):
        x, y, z = (np.where(end, high[:, axis], low[:, axis]) for axis, end in enumerate(corner))
        count += (-1) ** (3 - sum(corner)) * sums[x, y, z]
    return count
