"""Between an autopilot's frames and the contract's: NED and degrees there, ENU and radians here.

An autopilot's local frame (north, east, down from where its estimate began) is first turned into local ENU; an
`Alignment` then carries local ENU into the frame of the mission: that of a scene, or one that begins where the vehicle
stood.
"""

import math
from typing import NamedTuple, Self

from contracts.geometry import Point3, Pose
from episode_kit.kinematics import wrapped


class Ned(NamedTuple):
    """Metres north, east and down; the heading in degrees, clockwise from north, in (-180, 180]."""

    north_m: float
    east_m: float
    down_m: float
    heading_deg: float


class Enu(NamedTuple):
    """Metres east, north and up; yaw in radians, counter-clockwise from east."""

    east_m: float
    north_m: float
    up_m: float
    yaw: float


def enu_of(ned: Ned) -> Enu:
    return Enu(ned.east_m, ned.north_m, -ned.down_m, yaw_of(ned.heading_deg))


def ned_of(enu: Enu) -> Ned:
    return Ned(enu.north_m, enu.east_m, -enu.up_m, heading_of(enu.yaw))


def yaw_of(heading_deg: float) -> float:
    """Radians counter-clockwise from east, in (-pi, pi], of degrees clockwise from north."""
    return wrapped(math.pi / 2.0 - math.radians(heading_deg))


def heading_of(yaw: float) -> float:
    """Degrees clockwise from north, in (-180, 180], of radians counter-clockwise from east."""
    return math.degrees(wrapped(math.pi / 2.0 - yaw))


class Alignment(NamedTuple):
    """Local ENU, turned about its origin by `turn` (radians, counter-clockwise) and then shifted."""

    east_m: float = 0.0
    north_m: float = 0.0
    up_m: float = 0.0
    turn: float = 0.0

    @classmethod
    def between(cls, local: Enu, pose: Pose) -> Self:
        """The one that brings `local` to `pose`, heading included."""
        turn = wrapped(pose.yaw - local.yaw)
        east_m, north_m = _turned(local.east_m, local.north_m, turn)
        return cls(pose.x - east_m, pose.y - north_m, pose.z - local.up_m, turn)

    @classmethod
    def from_origin(cls, local: Enu, up_m: float) -> Self:
        """The one that begins `up_m` under `local`, not turned: east stays east."""
        return cls(-local.east_m, -local.north_m, up_m - local.up_m)

    def pose(self, local: Enu) -> Pose:
        """In the mission's frame."""
        x, y = _turned(local.east_m, local.north_m, self.turn)
        return Pose(x=x + self.east_m, y=y + self.north_m, z=local.up_m + self.up_m, yaw=wrapped(local.yaw + self.turn))

    def local(self, place: Point3 | Pose, yaw: float) -> Enu:
        """In the autopilot's frame; `yaw` in the mission's."""
        east_m, north_m = _turned(place.x - self.east_m, place.y - self.north_m, -self.turn)
        return Enu(east_m, north_m, place.z - self.up_m, wrapped(yaw - self.turn))


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return x * c - y * s, x * s + y * c
