"""Places relative to the drone, and how they are told to people."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from contracts.geometry import Point3, Pose
from navigation.camera import Camera


def spoken(place: Pose | Point3) -> str:
    return f"({place.x:.1f}, {place.y:.1f}, {place.z:.1f})"


def towards(heading_deg: float) -> str:
    """A heading, for a person."""
    return "ahead" if abs(heading_deg) < 0.5 else f"{abs(heading_deg):.3g}° {'right' if heading_deg > 0 else 'left'}"


def looks_towards(camera: Camera) -> str:
    """Where a camera looks, for a person."""
    if camera.is_level:
        return towards(camera.heading_deg)
    side = "" if camera.heading_deg == 0 else f", {towards(camera.heading_deg)}"
    return f"{abs(camera.pitch_deg):g}° {'up' if camera.pitch_deg > 0 else 'down'}{side}"


def point_of(pose: Pose) -> Point3:
    """The pose without its yaw."""
    return Point3(x=pose.x, y=pose.y, z=pose.z)


def ahead(pose: Pose, bearing_deg: float, distance_m: float) -> Point3:
    """The point at that bearing (degrees from the nose, positive to the right) and distance, at the same height."""
    angle = pose.yaw - math.radians(bearing_deg)
    return Point3(x=pose.x + distance_m * math.cos(angle), y=pose.y + distance_m * math.sin(angle), z=pose.z)


def apart_deg(here: Pose | Point3, a: Point3, b: Point3) -> float:
    """The angle between two places, as they are seen from here; 0 to 180 degrees."""
    to_a, to_b = (np.subtract((p.x, p.y, p.z), (here.x, here.y, here.z)) for p in (a, b))
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(to_a, to_b))), float(to_a @ to_b)))


def above(pose: Pose, z: float) -> Point3:
    """The point at height `z` (metres) straight above or below the pose."""
    return Point3(x=pose.x, y=pose.y, z=z)


def yaw_towards(place: Pose | Point3, target: Point3) -> float:
    """The yaw (radians, counter-clockwise from east) that faces the target from the place."""
    return math.atan2(target.y - place.y, target.x - place.x)


def distance_m(a: Pose | Point3, b: Pose | Point3) -> float:
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))


def path_m(start: Pose | Point3, path: Sequence[Point3]) -> float:
    """The length of the straight legs from the start along the path, metres."""
    return sum((distance_m(a, b) for a, b in pairwise((start, *path))), 0.0)
