"""The double's maps: scenes of our own simulator, drawn by its renderer through CARLA's cameras.

It converts frames by itself, and not by the service's own functions, so that a mistake there is one here.
"""

import asyncio
import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera, pinhole_camera
from contracts.geometry import Point3, Pose
from contracts.scene import FreePlace, Scene, SceneObject
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.thread import RenderThread
from services.sim.render.views import Uploaded
from services.sim.scenes import SceneBuilder
from tests.carla_double.layouts import Transform

FAR_M = 1000.0
_CODES = 2**24 - 1


class Lens(NamedTuple):
    """Of a camera's blueprint."""

    width: int
    height: int
    fov_deg: float


class Taken(NamedTuple):
    """(H, W, 4) uint8 each, blue first: a picture, and its depth as CARLA codes it."""

    picture: bytes
    depth: bytes


class Prop(NamedTuple):
    """Something that was spawned: a thing of the catalogue."""

    kind: str
    colour: str
    at: Transform


class Street:
    """A map and what was spawned on it."""

    def __init__(self, scene: Scene, build: SceneBuilder, renderer: RenderThread) -> None:
        self._scene = scene
        self._build = build
        self._renderer = renderer
        self._props: dict[int, Prop] = {}
        self._uploaded: Uploaded | None = None
        self._mesh = lru_cache(maxsize=1)(lambda: build(scene))
        self._kept: dict[tuple[Transform, Lens], Taken] = {}

    async def prepare(self) -> None:
        """Builds the map, so that no picture has to wait for it."""
        await asyncio.to_thread(self._built)

    async def put(self, actor: int, prop: Prop) -> None:
        self._props[actor] = prop
        await self._changed()

    async def remove(self, actor: int) -> None:
        if self._props.pop(actor, None) is not None:
            await self._changed()

    async def close(self) -> None:
        await self._changed()

    async def take(self, at: Transform, lens: Lens) -> Taken:
        """What a camera sees; a camera that stands still sees the same again."""
        if (at, lens) not in self._kept:
            if len(self._kept) > 32:
                self._kept.clear()
            self._kept[at, lens] = await self._drawn(at, lens)
        return self._kept[at, lens]

    async def _drawn(self, at: Transform, lens: Lens) -> Taken:
        if self._uploaded is None:
            mesh = await asyncio.to_thread(self._built)
            self._uploaded = await asyncio.wrap_future(self._renderer.submit(lambda r: r.upload(mesh)))
        uploaded, pose, camera = self._uploaded, _pose(at), _camera(at, lens)
        views = await asyncio.wrap_future(self._renderer.submit(lambda r: r.render(uploaded, pose, [camera])))
        return await asyncio.to_thread(_coded, views.rgb[0], views.depth_m()[0])

    def _built(self) -> SceneMesh:
        if not self._props:
            return self._mesh()
        things = tuple(_object(actor, prop) for actor, prop in self._props.items())
        return self._build(self._scene.model_copy(update={"objects": (*self._scene.objects, *things)}))

    async def _changed(self) -> None:
        self._kept.clear()
        uploaded, self._uploaded = self._uploaded, None
        if uploaded is not None:
            await asyncio.wrap_future(self._renderer.submit(lambda _: uploaded.release()))


def coded_depth(depth_m: NDArray[np.floating]) -> NDArray[np.uint8]:
    """(H, W) metres, inf for the sky, to (H, W, 4): blue, green, red are the code's high, middle and low byte."""
    share = np.clip(np.asarray(depth_m, np.float64) / FAR_M, 0.0, 1.0)
    code = np.rint(share * _CODES).astype(np.uint32)
    full = np.full_like(code, 255)
    return np.dstack([code >> 16, code >> 8 & 255, code & 255, full]).astype(np.uint8)


def _coded(rgb: NDArray[np.uint8], depth_m: NDArray[np.float32]) -> Taken:
    return Taken(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGRA).tobytes(), coded_depth(depth_m).tobytes())


def _pose(at: Transform) -> Pose:
    """CARLA's y runs south where x runs east, and its yaw clockwise seen from above."""
    return Pose(x=at.x, y=-at.y, z=at.z, yaw=math.remainder(-math.radians(at.yaw), math.tau))


def _camera(at: Transform, lens: Lens) -> Camera:
    if at.roll:
        raise ValueError("the double draws no rolled camera")
    pinhole = pinhole_camera("camera", lens.width, lens.height, horizontal_fov_deg=lens.fov_deg)
    return pinhole.model_copy(update={"pitch_deg": at.pitch})


def _object(actor: int, prop: Prop) -> SceneObject:
    pose = _pose(prop.at)
    place = FreePlace(position=Point3(x=pose.x, y=pose.y, z=pose.z))
    return SceneObject(id=f"prop-{actor}", kind=prop.kind, colour=prop.colour, place=place, yaw=pose.yaw)
