"""Depth pictures as points in the nose frame (see navigation.camera): all of a view, those nearby, the nearest of each
block of pixels."""

import functools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Camera, DepthView, Pose, column_slopes, direction, row_slopes

GROUND_M = 0.4
"""Returns no higher than this are the ground, its unevenness and kerbs."""

Points = NDArray[np.float32]
"""(N, 3) metres; each function names the frame."""


def cloud(view: DepthView, mask: NDArray[np.bool_] | None = None) -> Points:
    """(N, 3) nose frame: every finite return of a view, or those of them where `mask` (H, W) holds."""
    camera = view.camera
    width = camera.width
    kept = np.isfinite(view.depth_m)
    if mask is not None:
        kept &= mask
    at = np.flatnonzero(kept)  # several times faster than nonzero of two axes, as whole division is than divmod
    rows = at // width
    columns = at - rows * width
    depth = view.depth_m.ravel()[at]
    across = depth * column_slopes(camera)[columns]
    up = depth * row_slopes(camera)[rows]
    if camera.pitch_deg:
        depth, up = _levelled_array(camera, depth, up)
    angle = math.radians(camera.heading_deg)
    cos, sin = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    points = np.empty((3, len(at)), np.float32).T  # axis by axis in memory, as everything that reads it goes
    np.subtract(depth * cos, across * sin, out=points[:, 0])
    np.add(depth * sin, across * cos, out=points[:, 1])
    points[:, 2] = up
    if camera.is_offset:
        points += np.array((camera.forward_m, camera.right_m, camera.up_m), np.float32)
    return points


def nearby_cloud(
    views: Sequence[DepthView], depth_limit_m: float, half_height_m: float, height_m: float | None = None
) -> Points:
    """(N, 3) nose frame: the returns of all views up to a planar depth, and no more than so far above or below the
    drone's centre. Cameras that look up or down help: they see what hangs over a corridor or stands under it. With the
    drone's `height_m` above ground, the ground is left out: it is no obstacle of a corridor above it."""
    below_m = half_height_m if height_m is None else min(half_height_m, above_ground_m(height_m))
    parts = [_nearby(view, depth_limit_m, half_height_m, below_m) for view in views]
    return np.concatenate(parts) if parts else np.zeros((0, 3), np.float32)


def above_ground_m(height_m: float) -> float:
    """How far below a drone at that height what is seen is something that stands on the ground, and not the ground."""
    return max(0.0, height_m - GROUND_M)


def _nearby(view: DepthView, depth_limit_m: float, above_m: float, below_m: float) -> Points:
    camera = view.camera
    if camera.pitch_deg or camera.up_m:
        points = cloud(view, view.depth_m <= np.float32(depth_limit_m))
        z = points[:, 2]
        near: Points = points[(z <= np.float32(above_m)) & (z >= np.float32(-below_m))]
        return near
    slopes = row_slopes(camera)
    room = np.where(slopes >= 0, np.float32(above_m), np.float32(below_m))
    with np.errstate(divide="ignore"):
        limit = np.minimum(room / np.abs(slopes), np.float32(depth_limit_m))
    return cloud(view, view.depth_m <= limit[:, None])


def _levelled_array(
    camera: Camera, depth_m: NDArray[np.float32], up_m: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The same for arrays, in 32 bits."""
    cos = np.float32(math.cos(math.radians(camera.pitch_deg)))
    sin = np.float32(math.sin(math.radians(camera.pitch_deg)))
    return depth_m * cos - up_m * sin, depth_m * sin + up_m * cos


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


def thinned(view: DepthView, below_px: int) -> DepthView:
    """The view at half the size until it is less than so many pixels wide: the nearest of every two by two pixels."""
    camera, depth = view.camera, view.depth_m
    while camera.width >= below_px and camera.height % 2 == 0 and camera.width % 2 == 0:
        rows = np.fmin(depth[0::2], depth[1::2])  # invalid pixels are passed over
        depth = np.fmin(rows[:, 0::2], rows[:, 1::2])
        camera = camera._replace(
            width=camera.width // 2,
            height=camera.height // 2,
            fx_px=camera.fx_px / 2,
            fy_px=camera.fy_px / 2,
            cx_px=camera.cx_px / 2,
            cy_px=camera.cy_px / 2,
        )
    return view._replace(camera=camera, depth_m=depth)


def to_enu(points: Points, pose: Pose) -> Points:
    """(N, 3) nose frame to ENU."""
    forward = direction(pose.yaw, 0.0)
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    east = pose.x + x * forward[0] + y * forward[1]
    north = pose.y + x * forward[1] - y * forward[0]
    return np.stack((east, north, pose.z + z), axis=1).astype(np.float32)
