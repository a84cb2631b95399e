"""Frames as robotics' formats have them: the drone's x ahead, y left, z up; a camera's x right, y down, z into the
picture. Rotations are unit quaternions (x, y, z, w)."""

import math
from typing import NamedTuple

from contracts.cameras import Camera


class Quaternion(NamedTuple):
    x: float
    y: float
    z: float
    w: float


class Mounting(NamedTuple):
    """A camera in the drone's frame: where it sits, metres, and how its own frame is turned."""

    position: tuple[float, float, float]
    rotation: Quaternion


_OPTICAL = Quaternion(-0.5, 0.5, -0.5, 0.5)
"""Of a camera that looks ahead: its z is the drone's x."""


def about_up(yaw_rad: float) -> Quaternion:
    """A turn counter-clockwise about z."""
    return Quaternion(0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


def mounting(camera: Camera) -> Mounting:
    """How a camera is mounted; headings are to the right of the nose, pitches upwards."""
    heading, pitch = math.radians(camera.heading_deg), math.radians(camera.pitch_deg)
    lifted = Quaternion(0.0, -math.sin(pitch / 2), 0.0, math.cos(pitch / 2))
    offset = camera.offset
    rotation = _product(_product(about_up(-heading), lifted), _OPTICAL)
    return Mounting((offset.forward_m, -offset.right_m, offset.up_m), rotation)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation `b` and then `a`."""
    return Quaternion(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    )
