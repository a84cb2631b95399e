"""Between the project's frame and CARLA's.

Ours: metres, ENU (x east, y north, z up), yaw in radians, counter-clockwise from east. CARLA's: metres, left-handed (x
east, y south, z up), pitch, yaw and roll in degrees, yaw clockwise from east seen from above, pitch positive upwards.
A scene's origin may lie anywhere on CARLA's map; its axes are the map's.
"""

import math
from typing import NamedTuple

from contracts.cameras import Camera
from contracts.geometry import Point3, Pose
from episode_kit.kinematics import Vector, wrapped


class Placed(NamedTuple):
    """A place and a direction in CARLA's frame. Nothing here is rolled."""

    x: float
    y: float
    z: float
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0


class Origin(NamedTuple):
    """Where a scene's origin lies on CARLA's map, in CARLA's coordinates."""

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0


def carla_place(place: Vector, origin: Origin, *, yaw: float = 0.0, pitch_deg: float = 0.0) -> Placed:
    """A place of the scene (metres, ENU) with a heading (radians) in CARLA's frame."""
    x, y, z = place
    return Placed(x + origin.x_m, origin.y_m - y, z + origin.z_m, pitch_deg, -math.degrees(wrapped(yaw)))


def scene_pose(placed: Placed, origin: Origin) -> Pose:
    """The inverse of `carla_place`; the pitch is left out."""
    return Pose(
        x=placed.x - origin.x_m,
        y=origin.y_m - placed.y,
        z=placed.z - origin.z_m,
        yaw=wrapped(-math.radians(placed.yaw_deg)),
    )


def camera_place(pose: Pose, camera: Camera, origin: Origin) -> Placed:
    """Where the camera of a drone at `pose` is, and where it looks, in CARLA's frame."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    offset = camera.offset
    eye = (
        pose.x + offset.forward_m * c + offset.right_m * s,
        pose.y + offset.forward_m * s - offset.right_m * c,
        pose.z + offset.up_m,
    )
    return carla_place(eye, origin, yaw=pose.yaw - math.radians(camera.heading_deg), pitch_deg=camera.pitch_deg)


def looking_along(start: Vector, end: Vector, origin: Origin) -> Placed:
    """A camera at `start` that looks at `end` (metres, ENU; not the same place)."""
    dx, dy, dz = (b - a for a, b in zip(start, end, strict=True))
    yaw = math.atan2(dy, dx) if math.hypot(dx, dy) > 1e-9 else 0.0
    return carla_place(start, origin, yaw=yaw, pitch_deg=math.degrees(math.atan2(dz, math.hypot(dx, dy))))


def vector(place: Point3 | Pose) -> Vector:
    """Its position, metres, ENU."""
    return place.x, place.y, place.z
