"""Windows beside a thing on the wall: which of two openings is nearer, by their recess in depth.

A thing on the wall between two windows belongs to the nearer one; but straight in front of it both are as near to the
drone as each other, but for a decimetre or two. So the drone stops a little towards the nearer one.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Place, Pose
from navigation.point_cloud import Points
from navigation.target import Target, TargetParameters, facade_normal

_SAME_WALL = 0.9
"""The cosine of how far two fits of one wall's normal may be apart."""


class OpeningParameters(NamedTuple):
    """How openings beside a thing are read from depth.

    `half_height_m`: of the band of heights about the thing that is measured; `reach_m`: how far aside. `cell_m`: width
    of the upright strips of facade; `recess_m`: a strip so much deeper than the wall, and no more, belongs to an
    opening, which is `least_m` to `most_m` wide. `thing_m`: so near to its middle a thing may hide the wall.
    `deepest_m`: a thing on the wall stands no farther in front of it. `nearer_m`: so much nearer the middle of one has
    to be; `slide_m`: so far towards it the drone stops. `alike_m`: windows of one row are as wide as each other, but
    for so much. `plane_tolerance_m`: of the wall's plane, less than the recess. `most_aside_deg`: a look from farther
    aside of the normal does not see into both openings.
    """

    half_height_m: float = 0.4
    reach_m: float = 4.0
    cell_m: float = 0.05
    recess_m: tuple[float, float] = (0.08, 0.6)
    least_m: float = 0.4
    most_m: float = 2.6
    thing_m: float = 0.3
    deepest_m: float = 0.4
    nearer_m: float = 0.12
    slide_m: float = 0.4
    alike_m: float = 0.2
    plane_tolerance_m: float = 0.04
    most_aside_deg: float = 40.0


class Opening(NamedTuple):
    """How far aside of a thing an opening begins, and how far its middle is."""

    begins_m: float
    middle_m: float

    @property
    def width_m(self) -> float:
        return 2.0 * (self.middle_m - self.begins_m)


class Openings(NamedTuple):
    """Those next to a thing on its left and right, as one looks at the facade; None where none is seen whole."""

    left: Opening | None
    right: Opening | None


def openings_beside(target: Target, points: Points, settings: OpeningParameters) -> Openings:
    """The openings next to a thing on a wall. points: (N, 3) ENU."""
    gap = points - np.array(target.place, np.float32)
    near = (np.abs(gap[:, 2]) < settings.half_height_m) & (np.hypot(gap[:, 0], gap[:, 1]) < settings.reach_m)
    plan = gap[near, :2]
    # strip by strip, or the many returns of the nearest window would tilt the plane
    strips = _in_plan(_strips(plan, target.normal, settings), target.normal, settings)
    fit = TargetParameters(plane_tolerance_m=settings.plane_tolerance_m)
    normal, share = facade_normal(strips, target.normal, fit)
    if share == 0.0 or normal[0] * target.normal[0] + normal[1] * target.normal[1] < _SAME_WALL:
        return Openings(None, None)
    out = _strips(plan, normal, settings)
    middle = len(out) // 2
    return Openings(_first(out[middle:], settings), _first(out[:middle][::-1], settings))


def stop_towards_opening(target: Target, points: Points, pose: Pose, settings: OpeningParameters) -> Place:
    """The place to stop before: the thing's, or on the wall between two openings a little towards the nearer one.

    points: (N, 3) ENU.
    """
    sight = math.atan2(target.place.y - pose.y, target.place.x - pose.x)
    if abs(math.remainder(sight - target.facing_yaw, math.tau)) > math.radians(settings.most_aside_deg):
        return target.place
    left, right = openings_beside(target, points, settings)
    if left is None or right is None:
        return target.place
    further_m = right.middle_m - left.middle_m
    if abs(further_m) < settings.nearer_m or abs(right.width_m - left.width_m) > settings.alike_m:
        return target.place  # as near as each other, or something in one of them hides a part of it
    slide = math.copysign(min(settings.slide_m, left.middle_m, right.middle_m), further_m)
    east, north = target.normal
    return target.place._replace(x=target.place.x + slide * north, y=target.place.y - slide * east)


def _strips(plan: NDArray[np.float32], normal: tuple[float, float], settings: OpeningParameters) -> NDArray[np.float64]:
    """(2N,) how far out the median return of each upright strip lies, from right to left; nan without returns.
    plan: (M, 2) metres from the thing, east and north."""
    east, north = normal
    out, left = plan @ np.array((east, north), np.float32), plan @ np.array((north, -east), np.float32)
    count = round(settings.reach_m / settings.cell_m)
    strip = np.floor(left / settings.cell_m).astype(np.intp) + count
    depth = np.full(2 * count, np.nan)
    if not len(plan):
        return depth
    order = np.argsort(strip, kind="stable")
    names, first = np.unique(strip[order], return_index=True)
    for name, members in zip(names.tolist(), np.split(order, first[1:]), strict=True):
        if 0 <= name < 2 * count:
            depth[name] = np.median(out[members])
    return depth


def _in_plan(out: NDArray[np.float64], normal: tuple[float, float], settings: OpeningParameters) -> NDArray[np.float32]:
    """(K, 2) the strips that have returns, as places in the plan."""
    left = (np.arange(len(out)) - len(out) // 2 + 0.5) * settings.cell_m
    east, north = normal
    places = np.stack((out * east + left * north, out * north - left * east), axis=1)
    kept: NDArray[np.float32] = places[~np.isnan(out)].astype(np.float32)
    return kept


def _first(out: NDArray[np.float64], settings: OpeningParameters) -> Opening | None:
    """The first opening beside a thing on the wall; None where none is seen whole, or the thing is not on the wall.
    out: (N,) of each strip, from the thing on, how far out of the thing's place it is; nan where nothing is known.

    An opening is what lies between two strips of wall, most of it seen to be deeper. Its reveal hides a part of it.
    """
    least, most = settings.recess_m
    beside = out[round(settings.thing_m / settings.cell_m) :]
    beside = beside[np.abs(beside) < settings.deepest_m]
    if not len(beside):
        return None
    behind = out - np.percentile(beside, 75.0)
    with np.errstate(invalid="ignore"):
        is_wall = np.flatnonzero(behind > -least)
        is_deep = (behind <= -least) & (behind >= -most)
    for before, after in pairwise(is_wall.tolist()):
        strips = after - before - 1
        if is_deep[:before].any():
            return None
        if settings.least_m <= strips * settings.cell_m <= settings.most_m and 2 * is_deep[before:after].sum() > strips:
            return Opening((before + 1) * settings.cell_m, (before + after + 1) / 2 * settings.cell_m)
    return None
