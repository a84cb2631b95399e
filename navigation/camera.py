"""The pinhole camera and the frames: pixels, bearings, planar depth, places.

Frames used in this package:
- image: x to the right and y down in pixels, continuous, so that the centre of pixel (row, column) is
  (column + 0.5, row + 0.5);
- camera frame: metres from the camera; forward along the optical axis, right and up in the picture;
- nose frame: metres from the drone's centre; x along the nose, y to the right, z up;
- ENU: metres; x east, y north, z up from the ground; yaw in radians counter-clockwise from east.

View headings and bearings are in degrees, positive to the right; pitch in degrees, positive upwards. Depth is along the
optical axis (planar z).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Depth = NDArray[np.float32]
"""(H, W) metres along the optical axis; inf where nothing was hit, nan where the pixel is invalid."""

TOUCHING_DEG = 1e-6
"""Pictures whose edges lie no farther apart than this leave no gap between them."""

LEVEL_DEG = 1.0
"""A camera whose optical axis is tilted by no more than this counts as level."""


class Camera(NamedTuple):
    """An ideal pinhole camera (in pixels) and how it is mounted: heading and pitch in degrees, and where it sits in the
    nose frame, metres from the drone's centre."""

    width: int
    height: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    heading_deg: float = 0.0
    pitch_deg: float = 0.0
    forward_m: float = 0.0
    right_m: float = 0.0
    up_m: float = 0.0

    @property
    def is_level(self) -> bool:
        """Does it look at the horizon, the picture's columns upright? Views along the facade are read from such."""
        return abs(self.pitch_deg) <= LEVEL_DEG and 0.0 < self.cy_px < self.height

    @property
    def is_offset(self) -> bool:
        """Does it sit anywhere but in the drone's centre?"""
        return (self.forward_m, self.right_m, self.up_m) != (0.0, 0.0, 0.0)

    @property
    def left_deg(self) -> float:
        """Bearing of the picture's left edge from the nose, for a level camera."""
        return self.heading_deg + bearing_deg(self, 0.0)

    @property
    def right_deg(self) -> float:
        """Bearing of the picture's right edge from the nose, for a level camera."""
        return self.heading_deg + bearing_deg(self, float(self.width))

    @property
    def up_slope(self) -> float:
        """Height above the optical axis that the picture's upper edge sees per metre of depth."""
        return self.cy_px / self.fy_px

    @property
    def down_slope(self) -> float:
        """Height below the optical axis that the picture's lower edge sees per metre of depth."""
        return (self.height - self.cy_px) / self.fy_px


class Pose(NamedTuple):
    """The drone's centre (metres, ENU) and its nose's direction (radians, counter-clockwise from east)."""

    x: float
    y: float
    z: float
    yaw: float


class Place(NamedTuple):
    """A point in metres, ENU."""

    x: float
    y: float
    z: float


class DepthView(NamedTuple):
    """One camera's depth. `reach_m`: up to this planar depth it is free where nothing returned; see
    `navigation.sensing`."""

    camera: Camera
    depth_m: Depth
    reach_m: float = math.inf

    @property
    def heading_deg(self) -> float:
        return self.camera.heading_deg


class Pixels(NamedTuple):
    """(N,) image positions of points, and their planar depth; meaningless where that is not positive."""

    x_px: NDArray[np.float64]
    y_px: NDArray[np.float64]
    depth_m: NDArray[np.float64]


def pinhole(width: int, height: int, horizontal_fov_deg: float, heading_deg: float = 0.0) -> Camera:
    """Square pixels, the principal point in the picture's middle, in the drone's centre and level:
    f = (W / 2) / tan(FoV / 2). Raises ValueError for a size or an angle that no camera has."""
    if width < 1 or height < 1:
        raise ValueError(f"a picture has at least one pixel each way, not {width} x {height}")
    if not 0.0 < horizontal_fov_deg < 180.0:
        raise ValueError(f"a pinhole's field of view lies between 0 and 180 degrees, not {horizontal_fov_deg:g}")
    focal_px = round(width / 2.0 / math.tan(math.radians(horizontal_fov_deg) / 2.0), 9)  # 90 degrees: W / 2 to the bit
    return Camera(width, height, focal_px, focal_px, width / 2.0, height / 2.0, heading_deg)


def column_slopes(camera: Camera) -> NDArray[np.float32]:
    """(W,) tangent of each pixel column's bearing from the optical axis, positive to the right."""
    x = np.arange(camera.width, dtype=np.float64) + 0.5
    return ((x - camera.cx_px) / camera.fx_px).astype(np.float32)


def row_slopes(camera: Camera) -> NDArray[np.float32]:
    """(H,) height above the optical axis per metre of depth of each pixel row, positive upwards."""
    y = np.arange(camera.height, dtype=np.float64) + 0.5
    return ((camera.cy_px - y) / camera.fy_px).astype(np.float32)


def horizon_rows(camera: Camera) -> slice:
    """The row of a level camera that sees the horizon, or the two beside it."""
    return slice(max(0, math.ceil(camera.cy_px) - 1), min(camera.height, math.floor(camera.cy_px) + 1))


def bearing_deg(camera: Camera, x_px: float) -> float:
    """Bearing of image position `x_px` from the optical axis, positive to the right."""
    return math.degrees(math.atan((x_px - camera.cx_px) / camera.fx_px))


def fewest(cameras: Sequence[Camera]) -> list[Camera]:
    """The fewest level cameras that together see every bearing that all level ones see, in the order given."""
    left = sorted((c for c in cameras if c.is_level), key=lambda c: (c.left_deg, -c.right_deg))
    kept: list[Camera] = []
    seen_to = -math.inf
    while left:
        joined = [c for c in left if c.left_deg <= seen_to + TOUCHING_DEG] or left[:1]
        best = max(joined, key=lambda c: c.right_deg)
        kept.append(best)
        seen_to = best.right_deg
        left = [c for c in left if c.right_deg > seen_to]
    return [camera for camera in cameras if camera in kept]


def seen_aside_deg(cameras: Sequence[Camera]) -> float:
    """How far to either side of the nose the level cameras see without a gap; 0 where none looks ahead."""
    reach = []
    for side in (-1, 1):
        seen_to = 0.0
        edges = [sorted((side * c.left_deg, side * c.right_deg)) for c in cameras if c.is_level]
        for low, high in sorted(edges):
            if low <= seen_to + TOUCHING_DEG:
                seen_to = max(seen_to, high)
        reach.append(seen_to)
    return min(reach)


def planar_to_distance_m(depth_m: float, from_axis_deg: float) -> float:
    """Planar depth to the distance along a level ray: depth / cos(bearing from the optical axis)."""
    return depth_m / math.cos(math.radians(from_axis_deg))


def direction(yaw: float, bearing_right_deg: float) -> tuple[float, float]:
    """Unit vector (east, north) of a bearing, positive to the right of the nose."""
    angle = yaw - math.radians(bearing_right_deg)
    return math.cos(angle), math.sin(angle)


def wrap_radians(angle: float) -> float:
    """The same direction in -pi (excluded) to pi."""
    turned = math.remainder(angle, math.tau)
    return math.pi if turned == -math.pi else turned


def pixel_place(camera: Camera, x_px: float, y_px: float, depth_m: float, pose: Pose) -> Place:
    """ENU place of image position (x_px, y_px) at planar depth `depth_m`."""
    across = (x_px - camera.cx_px) / camera.fx_px * depth_m
    up = (camera.cy_px - y_px) / camera.fy_px * depth_m
    level_m, up = _levelled(camera, depth_m, up)
    eye = eye_of(camera, pose)
    forward = direction(pose.yaw, camera.heading_deg)
    right = (forward[1], -forward[0])
    return Place(
        eye.x + forward[0] * level_m + right[0] * across,
        eye.y + forward[1] * level_m + right[1] * across,
        eye.z + up,
    )


def pixels_of(camera: Camera, pose: Pose, places: NDArray[np.floating]) -> Pixels:
    """Where a camera sees places (N, 3) ENU, whether they lie inside its picture or not."""
    eye = eye_of(camera, pose)
    gap = np.asarray(places, np.float64) - np.array(eye)
    angle = pose.yaw - math.radians(camera.heading_deg)
    level = gap[:, 0] * math.cos(angle) + gap[:, 1] * math.sin(angle)
    right = gap[:, 0] * math.sin(angle) - gap[:, 1] * math.cos(angle)
    forward, up = level, gap[:, 2]
    if camera.pitch_deg:
        cos, sin = math.cos(math.radians(camera.pitch_deg)), math.sin(math.radians(camera.pitch_deg))
        forward, up = level * cos + up * sin, up * cos - level * sin
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return Pixels(
            right / forward * camera.fx_px + camera.cx_px, camera.cy_px - up / forward * camera.fy_px, forward
        )


def eye_of(camera: Camera, pose: Pose) -> Place:
    """Where the camera is, ENU."""
    if not camera.is_offset:
        return Place(pose.x, pose.y, pose.z)
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return Place(
        pose.x + camera.forward_m * cos + camera.right_m * sin,
        pose.y + camera.forward_m * sin - camera.right_m * cos,
        pose.z + camera.up_m,
    )


def _levelled(camera: Camera, depth_m: float, up_m: float) -> tuple[float, float]:
    """A camera-frame depth and height as level distance along the heading and height above the camera."""
    if not camera.pitch_deg:
        return depth_m, up_m
    cos, sin = math.cos(math.radians(camera.pitch_deg)), math.sin(math.radians(camera.pitch_deg))
    return depth_m * cos - up_m * sin, depth_m * sin + up_m * cos


def move_pose(pose: Pose, bearing_right_deg: float, distance_m: float) -> Pose:
    """Where a level flight of `distance_m` along a bearing ends, the nose along the direction of travel."""
    east, north = direction(pose.yaw, bearing_right_deg)
    yaw = wrap_radians(pose.yaw - math.radians(bearing_right_deg))
    return Pose(pose.x + east * distance_m, pose.y + north * distance_m, pose.z, yaw)
