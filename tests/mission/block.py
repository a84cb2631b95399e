"""One block on flat ground: what is where, and what a camera sees of it by ray casting."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import Box, Point2, Point3, Pose
from contracts.scene import Building, Scene, Start

SIZE = 120
RADIUS_M = 0.35
START = Pose(x=0.0, y=-15.0, z=1.5, yaw=math.pi / 2)


@dataclass(frozen=True)
class Block:
    """An upright box [x0, x1] x [y0, y1] x [0, floors * floor_height_m], and a thing in front of one of its walls;
    another may stand beside it."""

    x0: float = -8.0
    x1: float = 8.0
    y0: float = -6.0
    y1: float = 6.0
    floors: int = 6
    floor_height_m: float = 3.0
    thing: tuple[float, float, float] = (3.0, -6.2, 10.5)
    thing_normal: tuple[float, float] = (0.0, -1.0)
    start: Pose = START
    neighbour: "Block | None" = None

    @property
    def top(self) -> float:
        return self.floors * self.floor_height_m

    def distance(self, x: float, y: float, z: float) -> float:
        """From a point to a block or the ground, metres."""
        dx = max(self.x0 - x, 0.0, x - self.x1)
        dy = max(self.y0 - y, 0.0, y - self.y1)
        dz = max(0.0, z - self.top)
        beside = self.neighbour.distance(x, y, z) if self.neighbour else math.inf
        return min(z, math.sqrt(dx * dx + dy * dy + dz * dz), beside)

    def cast(self, eye: tuple[float, float, float], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """rays: (..., 3). How many ray lengths until a block or the ground is hit; inf for none."""
        low, high = np.array([self.x0, self.y0, 0.0]), np.array([self.x1, self.y1, self.top])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - eye) / rays, (high - eye) / rays
            near, far = np.fmin(a, b).max(axis=-1), np.fmax(a, b).min(axis=-1)
            block = np.where((near <= far) & (near > 0), near, np.inf)
            ground = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.inf)
        hit = np.minimum(block, ground)
        return np.minimum(hit, self.neighbour.cast(eye, rays)) if self.neighbour else hit

    def depth_m(self, pose: Pose, camera: Camera) -> NDArray[np.float64]:
        """(H, W) metres along the optical axis of a camera in the drone's centre, inf where nothing is hit."""
        forward, right = axes(pose, camera.heading_deg)
        up = np.array([0.0, 0.0, 1.0])
        pitch = math.radians(camera.pitch_deg)
        ahead, over = forward * math.cos(pitch) + up * math.sin(pitch), up * math.cos(pitch) - forward * math.sin(pitch)
        across = (np.arange(camera.width) + 0.5 - camera.cx_px) / camera.fx_px
        down = (np.arange(camera.height) + 0.5 - camera.cy_px) / camera.fy_px
        rays = ahead + across[None, :, None] * right - down[:, None, None] * over
        return self.cast((pose.x, pose.y, pose.z), rays)

    def sees(self, pose: Pose, camera: Camera, thing: tuple[float, float, float] | None = None) -> Box | None:
        """The box (0.8 m each way) of a thing, the block's unless told, in a level view; null where it is out of the
        picture or behind a block."""
        forward, right = axes(pose, camera.heading_deg)
        gap = np.subtract(thing or self.thing, (pose.x, pose.y, pose.z))
        ahead, aside = float(gap @ forward), float(gap @ right)
        if ahead < 0.3 or math.hypot(*gap) > 16.0:
            return None
        x = (camera.cx_px + camera.fx_px * aside / ahead) / camera.width
        y = (camera.cy_px - camera.fy_px * float(gap[2]) / ahead) / camera.height
        half = 0.4 / ahead * camera.fx_px / camera.width
        hidden = float(self.cast((pose.x, pose.y, pose.z), gap[None])[0]) < 0.999
        if hidden or not (half < x < 1 - half and half < y < 1 - half):
            return None
        return Box(x_min=x - half, y_min=y - half, x_max=x + half, y_max=y + half)


@dataclass(frozen=True)
class StereoBlock(Block):
    """The block as a stereo camera has it: the sky, and what lies beyond `range_m`, is invalid; noise rises as z^2."""

    range_m: float = 10.0
    noise_per_m: float = 0.0

    def depth_m(self, pose: Pose, camera: Camera) -> NDArray[np.float64]:
        depth = super().depth_m(pose, camera)
        chance = np.random.default_rng(round(1000 * (pose.x + 3 * pose.y + 7 * pose.z)) % 2**32)
        noise = self.noise_per_m * chance.normal(size=depth.shape)
        with np.errstate(invalid="ignore"):
            depth = depth + np.where(np.isfinite(depth), noise * depth**2, 0.0)
        return np.where(depth <= self.range_m, depth, np.nan)


def block_scene(block: Block) -> Scene:
    """A scene document that fits the block; the block world reads nothing of it."""
    corners = ((block.x0, block.y0), (block.x1, block.y0), (block.x1, block.y1), (block.x0, block.y1))
    building = Building(
        id="house", kind="low_rise", footprint=tuple(Point2(x=x, y=y) for x, y in corners), floors=block.floors
    )
    place = Point3(x=block.start.x, y=block.start.y, z=block.start.z)
    return Scene(name="block", buildings=(building,), target="house", start=Start(position=place, yaw=block.start.yaw))


def axes(pose: Pose, heading: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A level view's forward and right."""
    angle = pose.yaw - math.radians(heading)
    return np.array([math.cos(angle), math.sin(angle), 0.0]), np.array([math.sin(angle), -math.cos(angle), 0.0])
