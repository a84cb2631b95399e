"""A tiny exact world for tests: upright prisms and the ground, seen by an analytic depth camera."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Camera, Depth, DepthView, Pose, column_slopes, direction, eye_of, pinhole
from navigation.polygon import inside

HEADINGS = (-90, -45, 0, 45, 90)


class Prism(NamedTuple):
    """An upright solid: ground plan (ENU metres), from `bottom_m` to `top_m`."""

    outline: tuple[tuple[float, float], ...]
    bottom_m: float = -1.0
    top_m: float = 1000.0


def rectangle(x: float, y: float, width: float, depth: float) -> tuple[tuple[float, float], ...]:
    """Counter-clockwise, with its middle at (x, y)."""
    a, b = width / 2, depth / 2
    return ((x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b))


class World:
    def __init__(self, prisms: Sequence[Prism], *, ground: bool = False, sensor_range_m: float = 60.0) -> None:
        self.prisms = tuple(prisms)
        self.ground = ground
        self.sensor_range_m = sensor_range_m

    def depth(self, pose: Pose, camera: Camera) -> Depth:
        """(H, W) planar depth of a level camera, inf beyond the sensor's range."""
        pose = Pose(*eye_of(camera, pose), pose.yaw)
        forward = np.array(direction(pose.yaw, camera.heading_deg))
        right = np.array((forward[1], -forward[0]))
        rays = forward + column_slopes(camera).astype(np.float64)[:, None] * right  # planar depth 1
        y = np.arange(camera.height) + 0.5
        climbs = ((camera.cy_px - y) / camera.fy_px)[:, None]
        eye = np.array((pose.x, pose.y))
        nearest = np.full((camera.height, camera.width), np.inf)
        edge = float(np.abs(column_slopes(camera)).max())
        for prism in self.prisms:
            outline = np.array(prism.outline)
            ahead, aside = (outline - eye) @ forward, (outline - eye) @ right
            if (ahead < 0).all() or (aside > edge * ahead).all() or (aside < -edge * ahead).all():
                continue  # behind the camera, or wholly beside the picture
            for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
                t = _ray_to_segment(eye, rays, a, b)
                met = np.flatnonzero(np.isfinite(t))
                z = pose.z + t[met] * climbs
                hit = (z >= prism.bottom_m) & (z <= prism.top_m)
                nearest[:, met] = np.where(hit, np.minimum(nearest[:, met], t[met]), nearest[:, met])
            for level in (prism.bottom_m, prism.top_m):
                with np.errstate(divide="ignore"):
                    t = np.broadcast_to((level - pose.z) / climbs, nearest.shape)
                t = np.where((t >= ahead.min()) & (t <= ahead.max()), t, np.nan)  # no further than the outline reaches
                t = np.where((t > 0) & (t < self.sensor_range_m * 2), t, np.nan)
                rows = np.flatnonzero(np.isfinite(t).any(axis=1))
                inside = _inside(outline, eye + t[rows, :, None] * rays)
                nearest[rows] = np.where(inside, np.fmin(nearest[rows], t[rows]), nearest[rows])
        if self.ground:
            with np.errstate(divide="ignore"):
                t = np.where(climbs < 0, -pose.z / climbs, np.inf)
            nearest = np.minimum(nearest, t)
        return np.where(nearest <= self.sensor_range_m, nearest, np.inf).astype(np.float32)

    def views(self, pose: Pose, camera: Camera | None = None) -> dict[int, DepthView]:
        camera = camera or pinhole(160, 48, 90.0)
        return {heading: self.view(pose, camera._replace(heading_deg=heading)) for heading in HEADINGS}

    def view(self, pose: Pose, camera: Camera) -> DepthView:
        return DepthView(camera, self.depth(pose, camera))

    def gap_m(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) distance of places (N, 3) to the nearest solid, 0 inside."""
        nearest = np.full(len(places), np.inf)
        for prism in self.prisms:
            outline = np.array(prism.outline)
            level = np.full(len(places), np.inf)
            for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
                t = ((places[:, :2] - a) @ (b - a) / ((b - a) @ (b - a))).clip(0, 1)
                level = np.minimum(level, np.linalg.norm(places[:, :2] - (a + t[:, None] * (b - a)), axis=1))
            level = np.where(_inside(outline, places[:, :2]), 0.0, level)
            upright = np.maximum(0.0, np.maximum(prism.bottom_m - places[:, 2], places[:, 2] - prism.top_m))
            nearest = np.minimum(nearest, np.hypot(level, upright))
        return np.minimum(nearest, places[:, 2]) if self.ground else nearest

    def free_m(self, pose: Pose, bearing_deg: float, radius_m: float, at_most_m: float) -> float:
        """How far a ball flies along a bearing before it touches something, in steps of 2 cm."""
        along = np.arange(0.0, at_most_m + 0.02, 0.02)
        east, north = direction(pose.yaw, bearing_deg)
        places = np.stack((pose.x + along * east, pose.y + along * north, np.full_like(along, pose.z)), axis=1)
        touching = np.flatnonzero(self.gap_m(places) < radius_m)
        return float(along[touching[0]]) if len(touching) else at_most_m


def units(depth_m: Depth, metres_per_unit: float = 0.002) -> NDArray[np.uint16]:
    """Depth as it crosses the wire: 0 invalid, 65535 no return."""
    scaled = np.nan_to_num(np.rint(depth_m.astype(np.float64) / metres_per_unit), nan=0.0, posinf=65535)
    return np.clip(scaled, 0, 65535).astype(np.uint16)


def winding_deg(places: Sequence[tuple[float, float]], about: tuple[float, float]) -> float:
    """How far a track turns about a point, positive clockwise."""
    angles = [math.atan2(y - about[1], x - about[0]) for x, y in places]
    return -math.degrees(sum(math.remainder(b - a, math.tau) for a, b in pairwise(angles)))


def _ray_to_segment(
    eye: NDArray[np.float64], rays: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) how many of each ray's lengths lead to the segment, inf where it is missed."""
    leg, gap = b - a, a - eye
    cross = rays[:, 0] * leg[1] - rays[:, 1] * leg[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (gap[0] * leg[1] - gap[1] * leg[0]) / cross
        s = (gap[0] * rays[:, 1] - gap[1] * rays[:, 0]) / cross
    return np.where((t > 1e-9) & (s >= -1e-12) & (s <= 1 + 1e-12), t, np.inf)


def _inside(outline: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    return inside(points, outline).reshape(points.shape[:-1])
