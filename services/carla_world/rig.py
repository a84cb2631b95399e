"""The drone's cameras in CARLA's world: one of colour and one of depth for each camera of the rig, and the probe."""

import asyncio
import math
import time
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera, Rig
from contracts.geometry import Pose
from contracts.images import DepthMap, JpegImage, encode_depth, encode_jpeg
from contracts.vehicle import Observation, SensedView
from episode_kit.cameras import chosen_cameras
from episode_kit.episode import FlyingEpisode
from episode_kit.kinematics import Vector
from service_kit.errors import BadQuestion
from services.carla_world.client import CarlaClient
from services.carla_world.depth import decoded_depth
from services.carla_world.eyes import Kind, Lens
from services.carla_world.frames import Origin, camera_place, looking_along
from services.carla_world.sweep import PROBE_PX

PROBE = Lens("depth", PROBE_PX, PROBE_PX, 90.0)
_SQUARE_PX = 1e-6


class CarlaRig:
    """Cameras that are put where they look from, for one look at a time. Blocks; call `close` when done."""

    def __init__(self, client: CarlaClient, rig: Rig, origin: Origin) -> None:
        """Raises BadQuestion for cameras that CARLA has not, and Unavailable."""
        self._client = client
        self._origin = origin
        eyes = client.open_eyes([PROBE, *lenses_of(rig)])
        self._probe = eyes[0]
        self._by_camera = {camera.name: eyes[2 * i + 1 : 2 * i + 3] for i, camera in enumerate(rig.cameras)}

    def look(self, pose: Pose, cameras: Sequence[Camera], depth: bool) -> list[list[NDArray[np.uint8]]]:
        """Of each camera the picture and, where asked for, the coded depth: (H, W, 4), blue first. Raises
        Unavailable."""
        each = 2 if depth else 1
        eyes = [eye for camera in cameras for eye in self._by_camera[camera.name][:each]]
        places = [place for c in cameras for place in [camera_place(pose, c, self._origin)] * each]
        taken = self._client.take(eyes, places, settled=True)
        return [taken[i : i + each] for i in range(0, len(taken), each)]

    def probe(self, start: Vector, end: Vector) -> NDArray[np.float64]:
        """(H, W) metres along the axis of a camera at `start` that looks at `end`; inf where nothing is. Raises
        Unavailable."""
        place = looking_along(start, end, self._origin)
        return decoded_depth(self._client.take([self._probe], [place], settled=False)[0])

    def close(self) -> None:
        self._client.close_eyes([self._probe, *(eye for eyes in self._by_camera.values() for eye in eyes)])


class CarlaSenses:
    """What the drone of one episode sees."""

    def __init__(self, episode: FlyingEpisode, rig: CarlaRig) -> None:
        self._episode = episode
        self._rig = rig

    async def look(self, cameras: Sequence[str] | None, depth: bool) -> Observation:
        """The named cameras' views of one tick; all of the rig's where none are named. Raises BadQuestion or
        Unavailable."""
        episode = self._episode
        chosen = chosen_cameras(episode.rig.cameras, cameras)
        number, pose = episode.observations + 1, episode.drone.pose
        state = episode.drone.state(episode.id, episode.moves, number)
        started = time.perf_counter()
        taken = await asyncio.to_thread(self._rig.look, pose, chosen, depth)
        rendered = time.perf_counter()
        views = await asyncio.gather(*(asyncio.to_thread(_view, c, t) for c, t in zip(chosen, taken, strict=True)))
        episode.looked(number, pose)
        return Observation(
            vehicle=episode.id,
            number=number,
            pose=state.pose,
            time_s=state.time_s,
            uncertainty=state.uncertainty,
            views=tuple(views),
            timings_s={"render": rendered - started, "encode": time.perf_counter() - rendered},
        )


def lenses_of(rig: Rig) -> list[Lens]:
    """Of each camera one of colour and one of depth. Raises BadQuestion."""
    return [lens for camera in rig.cameras for lens in (lens_of(camera, "rgb"), lens_of(camera, "depth"))]


def lens_of(camera: Camera, kind: Kind) -> Lens:
    """CARLA's camera for one of ours. Raises BadQuestion for what CARLA has not: pixels that are not square, or a
    principal point beside the picture's middle."""
    square = abs(camera.fx_px - camera.fy_px) < _SQUARE_PX
    central = abs(camera.cx_px - camera.width / 2) < _SQUARE_PX and abs(camera.cy_px - camera.height / 2) < _SQUARE_PX
    if not square or not central:
        raise BadQuestion(
            f"camera {camera.name!r}: CARLA's cameras have square pixels and their principal point in the picture's "
            "middle; give fx_px = fy_px, cx_px = width / 2 and cy_px = height / 2",
            code="bad_camera",
        )
    fov_deg = math.degrees(2.0 * math.atan(camera.width / 2 / camera.fx_px))
    return Lens(kind, camera.width, camera.height, fov_deg)


def _view(camera: Camera, taken: list[NDArray[np.uint8]]) -> SensedView:
    return SensedView(camera=camera, image=_picture(taken[0]), depth=_depth_map(taken[1]) if len(taken) > 1 else None)


def _picture(bgra: NDArray[np.uint8]) -> JpegImage:
    rgb = cv2.cvtColor(bgra, cv2.COLOR_BGRA2RGB)
    return encode_jpeg(np.asarray(rgb, np.uint8))


def _depth_map(bgra: NDArray[np.uint8]) -> DepthMap:
    return encode_depth(decoded_depth(bgra))
