"""Safe moving distances (eq. 7): how far the drone may fly towards each of the five marked points."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from navigation.camera import DepthView, Pose, bearing_deg, direction, planar_to_distance_m
from navigation.point_cloud import Points, nearby_cloud
from navigation.sensing import FREE, looked_at

LABELS = ("a", "b", "c", "d", "e")
_HERE = Pose(0.0, 0.0, 0.0, 0.0)
_SEEN_STEP_M = 0.5
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
    view: DepthView, others: Sequence[DepthView], settings: SafeDistanceParameters, height_m: float | None = None
) -> tuple[MarkedPoint, ...]:
    """Eq. 7 for the points at x = W k / 6 (k = 1..5, labelled a-e) on the horizon of `view`, which must be level.

    `others` are further views of the same moment, level or not; the corridor uses their returns where it leaves the
    picture. With the drone's `height_m`, the ground is no obstacle. A way is no longer than it was looked through:
    where nobody knows what is there, it ends.
    """
    camera = view.camera
    if not camera.is_level:
        raise ValueError(f"the view's camera looks {camera.pitch_deg:g} degrees up: a level one sees the horizon")
    reach = settings.l_max_m + settings.drone_radius_m + settings.clearance_m
    points, radius = None, 0.0
    if settings.variant == "corridor":
        points = nearby_cloud((view, *others), reach, settings.drone_radius_m + settings.clearance_m, height_m)
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
        else:
            found = corridor(points, bearing, radius, settings.l_max_m)
            seen_m = seen_along_m((view, *others), bearing, found.distance_m)
            found = found._replace(distance_m=min(found.distance_m, seen_m))
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
        return Corridor(
            min(settings.l_max_m, planar_to_distance_m(min(view.reach_m, settings.l_max_m), from_axis_deg)), None, 0.0
        )
    distance = planar_to_distance_m(depth, from_axis_deg)
    return Corridor(min(distance, settings.l_max_m), distance, 0.0)


def seen_along_m(views: Sequence[DepthView], bearing_right_deg: float, length_m: float) -> float:
    """How far along a bearing from the drone the views look through, at most `length_m`."""
    count = math.ceil(length_m / _SEEN_STEP_M)
    if count < 1:
        return length_m
    away = np.minimum(np.arange(1, count + 1) * _SEEN_STEP_M, length_m)
    east, north = direction(_HERE.yaw, bearing_right_deg)
    places = np.stack((away * east, away * north, np.zeros(count)), axis=1)
    free = looked_at(places, views, _HERE) == FREE
    if free.all():
        return length_m
    first = int(free.argmin())
    return float(away[first - 1]) if first else 0.0
