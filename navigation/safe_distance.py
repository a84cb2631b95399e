"""Safe moving distances (eq. 7): how far the drone may fly towards each of the five marked points."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from navigation.camera import DepthView, bearing_deg, planar_to_distance_m
from navigation.point_cloud import Points, nearby_cloud

LABELS = ("a", "b", "c", "d", "e")
Variant = Literal["corridor", "bare"]


class SafeDistanceParameters(NamedTuple):
    """Free constants of eq. 7.

    `corridor`: the drone, as a ball grown by `clearance_m`, flies until it would touch something. Where something
    already lies within the clearance, the ball is grown only as far as there is room, but by `tight_clearance_m` at
    least, so that the drone can leave a tight place. `bare`: eq. 7 as printed, one pixel's distance without a margin.
    """

    variant: Variant
    l_max_m: float
    drone_radius_m: float
    clearance_m: float
    tight_clearance_m: float
    sensor_range_m: float


class Corridor(NamedTuple):
    """A straight flight: `distance_m` is free; `nearest_return_m` is the distance along the flight of what limits it,
    None where nothing does within reach; the corridor is `half_width_m` wide to each side, above and below."""

    distance_m: float
    nearest_return_m: float | None
    half_width_m: float


class MarkedPoint(NamedTuple):
    """One of the five points: image position in 0..1, bearing relative to the nose (degrees, positive right)."""

    label: str
    x: float
    y: float
    bearing_deg: float
    corridor: Corridor


def safe_distances(
    view: DepthView, others: Sequence[DepthView], settings: SafeDistanceParameters
) -> tuple[MarkedPoint, ...]:
    """Eq. 7 for the points at x = W k / 6 (k = 1..5, labelled a-e) on the horizon of `view`, which must be level.

    `others` are further views of the same moment, level or not; the corridor uses their returns where it leaves the
    picture. A point without any valid pixel about it is unknown, and an unknown way is 0 m long.
    """
    camera = view.camera
    if not camera.is_level:
        raise ValueError(f"the view's camera looks {camera.pitch_deg:g} degrees up: a level one sees the horizon")
    reach = settings.l_max_m + settings.drone_radius_m + settings.clearance_m
    points, radius = None, 0.0
    if settings.variant == "corridor":
        points = nearby_cloud((view, *others), reach, settings.drone_radius_m + settings.clearance_m)
        radius = body_radius_m(points, settings)
        # one axis after the other in memory: five corridors run over each of them several times
        points = np.asfortranarray(points)
    marked = []
    for k, label in enumerate(LABELS, start=1):
        x_px = camera.width * k / 6.0
        from_axis = bearing_deg(camera, x_px)
        bearing = camera.heading_deg + from_axis
        if points is None:
            found = _bare(view, x_px, from_axis, settings)
        elif not _seen(view, x_px):
            found = Corridor(0.0, None, radius)
        else:
            found = corridor(points, bearing, radius, settings.l_max_m)
        marked.append(MarkedPoint(label, k / 6.0, camera.cy_px / camera.height, bearing, found))
    return tuple(marked)


def body_radius_m(points: Points, settings: SafeDistanceParameters) -> float:
    """Radius of the ball that is flown through `points` (nose frame): radius + clearance, less in a tight place."""
    full = settings.drone_radius_m + settings.clearance_m
    if not len(points):
        return full
    nearest = math.sqrt(float(np.einsum("ij,ij->i", points, points).min()))
    tight = settings.drone_radius_m + min(settings.tight_clearance_m, settings.clearance_m)
    # a little less than the room there is, so that noise on a wall that is flown along does not stop the drone
    return min(full, max(tight, 0.95 * nearest))


def corridor(points: Points, bearing_right_deg: float, radius: float, l_max_m: float) -> Corridor:
    """The free way of a ball along a bearing through `points` (nose frame), at most `l_max_m`, never negative.

    A point at `along` on the way and `aside` of it stops a ball of radius r at along - sqrt(r^2 - aside^2).
    """
    angle = math.radians(bearing_right_deg)
    cos, sin = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    x, y, z = points.T
    along = x * cos + y * sin
    across = y * cos - x * sin
    aside_squared = across * across + z * z
    hit = (along > 0.0) & (aside_squared < radius * radius)
    if not hit.any():
        return Corridor(l_max_m, None, radius)
    along = along[hit]
    stops = along - np.sqrt(radius * radius - aside_squared[hit])
    first = int(stops.argmin())
    return Corridor(min(l_max_m, max(0.0, float(stops[first]))), float(along[first]), radius)


def _bare(view: DepthView, x_px: float, from_axis_deg: float, settings: SafeDistanceParameters) -> Corridor:
    camera = view.camera
    depth = float(view.depth_m[int(camera.cy_px), min(int(x_px), camera.width - 1)])
    if math.isnan(depth):
        return Corridor(0.0, None, 0.0)
    if math.isinf(depth):
        return Corridor(settings.l_max_m, None, 0.0)
    distance = planar_to_distance_m(depth, from_axis_deg)
    return Corridor(min(distance, settings.l_max_m), distance, 0.0)


def _seen(view: DepthView, x_px: float) -> bool:
    """Is any pixel valid in the patch (2.5 % of the picture each way) about a point on the horizon?"""
    camera = view.camera
    half_x, half_y = max(1, camera.width // 40), max(1, camera.height // 40)
    column, row = int(x_px), int(camera.cy_px)
    patch = view.depth_m[max(0, row - half_y) : row + half_y, max(0, column - half_x) : column + half_x]
    return not bool(np.isnan(patch).all())
