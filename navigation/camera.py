"""The pinhole camera and the frames: pixels, bearings, planar depth, places.

Frames used in this package:
- image: x to the right and y down in pixels, continuous, so that the centre of pixel (row, column) is
  (column + 0.5, row + 0.5);
- nose frame: metres from the drone's centre; x along the nose, y to the right, z up;
- ENU: metres; x east, y north, z up from the ground; yaw in radians counter-clockwise from east.

View headings and bearings are in degrees, positive to the right. Depth is along the optical axis (planar z).
All cameras sit in the drone's centre with a level optical axis.
"""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Depth = NDArray[np.float32]
"""(H, W) metres along the optical axis; inf where nothing was hit, nan where the pixel is invalid."""

Points = NDArray[np.float32]
"""(N, 3) metres; each function names the frame."""


class Pinhole(NamedTuple):
    """An ideal camera with square pixels and its principal point in the picture's middle."""

    width: int
    height: int
    focal_px: float

    @property
    def vertical_fov_rad(self) -> float:
        return 2.0 * math.atan(self.height / 2.0 / self.focal_px)


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
    """One camera's depth; `heading_deg` relative to the nose, positive to the right."""

    heading_deg: float
    depth_m: Depth


def pinhole(width: int, height: int, horizontal_fov_deg: float = 90.0) -> Pinhole:
    """f = (W / 2) / tan(FoV / 2): W / 2 at 90 degrees. Raises ValueError for a size or an angle that no camera has."""
    if width < 1 or height < 1:
        raise ValueError(f"a picture has at least one pixel each way, not {width} x {height}")
    if not 0.0 < horizontal_fov_deg < 180.0:
        raise ValueError(f"a pinhole's field of view lies between 0 and 180 degrees, not {horizontal_fov_deg:g}")
    return Pinhole(width, height, width / 2.0 / math.tan(math.radians(horizontal_fov_deg) / 2.0))


def column_slopes(camera: Pinhole) -> NDArray[np.float32]:
    """(W,) tangent of each pixel column's bearing from the optical axis, positive to the right."""
    x = np.arange(camera.width, dtype=np.float64) + 0.5
    return ((x - camera.width / 2.0) / camera.focal_px).astype(np.float32)


def row_slopes(camera: Pinhole) -> NDArray[np.float32]:
    """(H,) height above the optical axis per metre of depth of each pixel row, positive upwards."""
    y = np.arange(camera.height, dtype=np.float64) + 0.5
    return ((camera.height / 2.0 - y) / camera.focal_px).astype(np.float32)


def bearing_deg(camera: Pinhole, x_px: float) -> float:
    """Bearing of image position `x_px` from the optical axis, positive to the right."""
    return math.degrees(math.atan((x_px - camera.width / 2.0) / camera.focal_px))


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


def pixel_place(
    camera: Pinhole, x_px: float, y_px: float, depth_m: float, pose: Pose, heading_deg: float = 0.0
) -> Place:
    """ENU place of image position (x_px, y_px) at planar depth `depth_m` in the view at `heading_deg`."""
    forward = direction(pose.yaw, heading_deg)
    right = (forward[1], -forward[0])
    across = (x_px - camera.width / 2.0) / camera.focal_px * depth_m
    up = (camera.height / 2.0 - y_px) / camera.focal_px * depth_m
    return Place(
        pose.x + forward[0] * depth_m + right[0] * across,
        pose.y + forward[1] * depth_m + right[1] * across,
        pose.z + up,
    )


def cloud(view: DepthView, mask: NDArray[np.bool_] | None = None) -> Points:
    """(N, 3) nose frame: every finite return of a view, or those of them where `mask` (H, W) holds."""
    height, width = view.depth_m.shape
    camera = pinhole(width, height)
    kept = np.isfinite(view.depth_m)
    if mask is not None:
        kept &= mask
    at = np.flatnonzero(kept)  # several times faster than nonzero of two axes, as whole division is than divmod
    rows = at // width
    columns = at - rows * width
    depth = view.depth_m.ravel()[at]
    across = depth * column_slopes(camera)[columns]
    up = depth * row_slopes(camera)[rows]
    angle = math.radians(view.heading_deg)
    cos, sin = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    points = np.empty((3, len(at)), np.float32).T  # axis by axis in memory, as everything that reads it goes
    np.subtract(depth * cos, across * sin, out=points[:, 0])
    np.add(depth * sin, across * cos, out=points[:, 1])
    points[:, 2] = up
    return points


def nearby_cloud(views: Sequence[DepthView], depth_limit_m: float, half_height_m: float) -> Points:
    """(N, 3) nose frame: the returns of all views up to a planar depth, and no more than so far above or below."""
    parts = []
    for view in views:
        height, width = view.depth_m.shape
        slopes = np.abs(row_slopes(pinhole(width, height)))
        with np.errstate(divide="ignore"):
            limit = np.minimum(np.float32(half_height_m) / slopes, np.float32(depth_limit_m))
        parts.append(cloud(view, view.depth_m <= limit[:, None]))
    return np.concatenate(parts) if parts else np.zeros((0, 3), np.float32)


def nearest_of_blocks(view: DepthView, block: int = 4) -> NDArray[np.bool_]:
    """(H, W) mask of the nearest return of every `block` x `block` pixels: a thin cloud that keeps thin things."""
    height, width = view.depth_m.shape
    down, across = -(-height // block), -(-width // block)
    # a depth and its place in the block as one whole number, so that the least of a block knows where it was: the bits
    # of floats sort as the floats do, what is infinite or invalid last, and the place fits into the few least of them
    infinite = np.float32(np.inf).view(np.uint32)
    spare = np.uint32((1 << (block * block - 1).bit_length()) - 1)
    keys = np.full((down * block, across * block), infinite)
    bits = np.ascontiguousarray(view.depth_m, np.float32).view(np.uint32)
    place = np.arange(block, dtype=np.uint32)[:, None] + block * (np.arange(width, dtype=np.uint32) % block)
    np.bitwise_and(bits, ~spare, out=keys[:height, :width])
    for i in range(block):
        keys[i:height:block, :width] |= place[i]
    rows = functools.reduce(np.minimum, [keys[i::block] for i in range(block)])
    least = functools.reduce(np.minimum, [rows[:, j::block] for j in range(block)])
    found = least < infinite
    at = least & spare
    mask = np.zeros((height, width), bool)
    mask[
        (np.arange(down)[:, None] * block + at % block)[found],
        (np.arange(across) * block + at // block)[found],
    ] = True
    return mask


def to_enu(points: Points, pose: Pose) -> Points:
    """(N, 3) nose frame to ENU."""
    forward = direction(pose.yaw, 0.0)
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    east = pose.x + x * forward[0] + y * forward[1]
    north = pose.y + x * forward[1] - y * forward[0]
    return np.stack((east, north, pose.z + z), axis=1).astype(np.float32)


def move_pose(pose: Pose, bearing_right_deg: float, distance_m: float) -> Pose:
    """Where a level flight of `distance_m` along a bearing ends, the nose along the direction of travel."""
    east, north = direction(pose.yaw, bearing_right_deg)
    yaw = wrap_radians(pose.yaw - math.radians(bearing_right_deg))
    return Pose(pose.x + east * distance_m, pose.y + north * distance_m, pose.z, yaw)
