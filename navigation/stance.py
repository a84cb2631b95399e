"""Where to begin from: which walls stand about the drone, how to stand square before one, and how far the way is free.

A start may be turned off the facade, too near to it or too far, or face away. All of it is read from the depth of one
moment (views of `navigation.sensing.read_views`).
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation import safe_distance
from navigation.camera import DepthView, Pose
from navigation.explorer.facade import normals, runs
from navigation.explorer.scan import Scan, panorama
from navigation.point_cloud import Points, cloud, nearby_cloud, nearest_of_blocks, to_enu

Floats = NDArray[np.float64]

AHEAD_DEG = 20.0
_BAND_M, _BODY_M = 0.5, 1.2
_COARSE_PX = 200
_SPLIT_DEG = 25.0
_FEW = 4
_LEAST_LENGTH_M = 2.0
_MOST_ACROSS = 0.075
"""Tree crowns are round: points scatter across a wall by at most 0.053 of its length, across a crown
by 0.1 and more (40 streets)."""
_CROWN_M = 5.0
"""No crown shows wider; what scatters so and is longer goes round a corner."""
_TALL_FROM_M, _TALL_TO_M = 1.9, 2.9
"""Cars and hedges end below this height, the walls of the lowest house above."""
_TALL_SHARE = 0.4
_TALL_CELL_M = 1.0


class Wall(NamedTuple):
    """A straight piece of wall (ENU): the foot of the perpendicular on it, as unit `normal` towards the drone and
    `distance_m`; `facing_yaw` looks straight at it; `ahead`: it crosses the nose's direction."""

    normal: tuple[float, float]
    distance_m: float
    nearest_m: float
    length_m: float
    ahead: bool

    @property
    def facing_yaw(self) -> float:
        return math.atan2(-self.normal[1], -self.normal[0])


class StandOff(NamedTuple):
    """How far from its facade the drone may begin: no nearer, no farther, and what it flies to where it has to."""

    near_m: float
    far_m: float
    good_m: float

    @classmethod
    def within(cls, reach_m: float) -> "StandOff":
        """For a depth sensor of that reach: from farther off it would not see where a facade that steps back ends."""
        far_m = min(14.0, max(3.5, reach_m - 4.5))
        near_m = min(4.5, far_m - 1.0)
        return cls(near_m, far_m, min(10.0, far_m - 0.3))

    def goal_m(self, distance_m: float, more_m: float = 0.0) -> float | None:
        """The distance to fly to; None where it is right already. `more_m`: so much farther off is right as well."""
        if distance_m > self.far_m + more_m:
            return self.good_m
        return min(self.good_m, self.near_m + 2.5) if distance_m < self.near_m else None


def walls_about(views: Sequence[DepthView], pose: Pose) -> list[Wall]:
    """The upright walls as high as a house that the views show, nearest first."""
    scan = panorama(views, pose, _BAND_M, _BODY_M)
    run = runs(scan)
    normal = normals(scan, run)
    blocks = [nearest_of_blocks(view, max(1, view.camera.width // _COARSE_PX)) for view in views]
    tall = _tall_cells(np.concatenate([to_enu(cloud(v, kept), pose) for v, kept in zip(views, blocks, strict=True)]))
    pieces = [members for members in _pieces(scan, run, normal) if _is_tall(scan, members, tall)]
    found = [_wall(scan, members, normal) for members in pieces if _is_flat(scan, members)]
    return sorted((wall for wall in found if wall.length_m >= _LEAST_LENGTH_M), key=lambda wall: wall.nearest_m)


def wall_ahead(walls: Sequence[Wall]) -> Wall | None:
    """The nearest one that the nose points at."""
    return next((wall for wall in walls if wall.ahead), None)


def free_way_m(
    views: Sequence[DepthView], height_m: float, bearing_deg: float, length_m: float, radius_m: float
) -> float:
    """How far a ball may fly along a bearing, level: nothing touches it, and the views look through all of it."""
    near = nearby_cloud(views, length_m + radius_m, radius_m, height_m)
    free = safe_distance.corridor(near, bearing_deg, radius_m, length_m).distance_m
    return safe_distance.seen_along_m(views, bearing_deg, free)


def _pieces(scan: Scan, run: NDArray[np.intp], normal: Floats) -> Iterator[NDArray[np.intp]]:
    """Bins of each straight piece of each run."""
    for number in np.unique(run[run >= 0]):
        members = np.flatnonzero(run == number)
        turn = np.abs(np.diff(np.unwrap(np.arctan2(normal[members, 1], normal[members, 0]))))
        for piece in np.split(members, np.flatnonzero(turn > math.radians(_SPLIT_DEG)) + 1):
            if len(piece) >= _FEW:
                yield piece


def _wall(scan: Scan, members: NDArray[np.intp], normal: Floats) -> Wall:
    points = scan.points(scan.range_m)[members]
    middle = points.mean(axis=0)
    spread = points - middle
    along = np.linalg.eigh(spread.T @ spread)[1][:, 1]
    mean = normal[members].mean(axis=0)
    out = np.array((-along[1], along[0]))
    out = out if out @ mean > 0 else -out
    here = np.array((scan.pose.x, scan.pose.y))
    reach = spread @ along
    bearings = scan.bearing_deg[members]
    return Wall(
        normal=(float(out[0]), float(out[1])),
        distance_m=max(0.0, float((here - middle) @ out)),
        nearest_m=float(np.hypot(*(points - here).T).min()),
        length_m=float(reach.max() - reach.min()),
        ahead=bool(bearings.min() <= AHEAD_DEG and bearings.max() >= -AHEAD_DEG),
    )


def _is_flat(scan: Scan, members: NDArray[np.intp]) -> bool:
    """Does it keep to a straight line, or go on for long, as walls do and trees do not?"""
    points = scan.points(scan.range_m)[members]
    across, along = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(points.T)), 0.0))
    length = along * math.sqrt(12.0)  # of a line that is evenly filled
    return bool(across <= _MOST_ACROSS * length or length > _CROWN_M)


def _tall_cells(points: Points) -> set[tuple[int, int]]:
    high = points[(points[:, 2] >= _TALL_FROM_M) & (points[:, 2] <= _TALL_TO_M), :2]
    cells = np.unique(np.floor(high / _TALL_CELL_M).astype(np.intp), axis=0)
    return {(int(x) + dx, int(y) + dy) for x, y in cells for dx in (-1, 0, 1) for dy in (-1, 0, 1)}


def _is_tall(scan: Scan, members: NDArray[np.intp], tall: set[tuple[int, int]]) -> bool:
    """Does more stand over the piece than a car or a hedge?"""
    cells = np.floor(scan.points(scan.range_m)[members] / _TALL_CELL_M).astype(np.intp)
    return sum((int(x), int(y)) in tall for x, y in cells) >= _TALL_SHARE * len(members)
