"""Real cameras: streams or devices with their calibrations, as a TOML file names them.

[[cameras]]
name = "front"
source = "rtsp://10.0.0.2/front"        # or "/dev/video0", "0"
calibration = "front.yaml"              # OpenCV's YAML or ROS's camera_info, beside this file
heading_deg = 0.0
offset = {forward_m = 0.1}
latency_s = 0.08
[cameras.depth]
source = "/dev/video2"                  # 16 bits a pixel, registered to the picture
metres_per_unit = 0.001
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from contracts.base import Name, Wire
from contracts.cameras import MAX_CAMERAS, BadRig, Camera, MountingOffset, Rig, flyable
from contracts.errors import first_problem
from contracts.images import NO_RETURN, DepthMap, encode_depth_units, encode_jpeg
from contracts.vehicle import SensedView
from service_kit.errors import Unavailable
from service_kit.setting_files import BadFile, toml_of
from services.mavlink_vehicle.cameras.calibration import BadCalibration, Rectifier, read_calibration
from services.mavlink_vehicle.cameras.grabber import Frame, Grabber
from services.mavlink_vehicle.cameras.port import PoseAt, Seen

OLDEST_S = 0.5
"""A frame older than that is not of now."""
Source = Annotated[str, Field(min_length=1, max_length=500)]
Latency = Annotated[float, Field(ge=0.0, le=2.0)]


class DepthEntry(Wire):
    """Where a camera's depth comes from. What is farther than `farthest_m` is told as no return up to there."""

    source: Source
    metres_per_unit: float = Field(default=0.001, gt=0.0, le=0.1)
    farthest_m: float | None = Field(default=None, gt=0.5, le=500.0)
    latency_s: Latency = 0.0


class CameraEntry(Wire):
    """One camera. `longer_side_px`: what its pictures are scaled to."""

    name: Name
    source: Source
    calibration: Source
    heading_deg: float = 0.0
    pitch_deg: float = 0.0
    offset: MountingOffset = MountingOffset()
    latency_s: Latency = 0.0
    longer_side_px: int | None = Field(default=None, ge=64, le=1600)
    depth: DepthEntry


class CamerasFile(Wire):
    cameras: tuple[CameraEntry, ...] = Field(min_length=1, max_length=MAX_CAMERAS)


class BadCameras(ValueError):
    """A file that names no usable cameras; one line says why."""


class _Filmed:
    """One camera with its two streams."""

    def __init__(self, entry: CameraEntry, rectifier: Rectifier) -> None:
        self.entry = entry
        self.rectifier = rectifier
        self.picture = Grabber(entry.source, raw=False, latency_s=entry.latency_s)
        self.depth = Grabber(entry.depth.source, raw=True, latency_s=entry.depth.latency_s)

    @property
    def camera(self) -> Camera:
        return self.rectifier.camera

    def view(self, picture: Frame, depth: Frame | None) -> SensedView:
        """Raises BadCalibration."""
        rgb = cv2.cvtColor(self.rectifier.picture(picture.image), cv2.COLOR_BGR2RGB)
        image = encode_jpeg(np.asarray(rgb, np.uint8))
        return SensedView(camera=self.camera, image=image, depth=None if depth is None else self._depth(depth.image))

    def _depth(self, units: NDArray[np.uint16]) -> DepthMap:
        entry = self.entry.depth
        rectified = self.rectifier.depth(units)
        if entry.farthest_m is not None:
            rectified[rectified > entry.farthest_m / entry.metres_per_unit] = NO_RETURN
        return encode_depth_units(rectified, entry.metres_per_unit)


class FilmedCameras:
    """Call `start`, and `close` at the end. `clock` is the vehicle's."""

    def __init__(self, filmed: Sequence[_Filmed], clock: Callable[[], float] = time.monotonic) -> None:
        self._filmed = {one.camera.name: one for one in filmed}
        self._clock = clock
        self.carried = tuple(one.camera for one in filmed)

    @classmethod
    def load(cls, path: Path) -> "FilmedCameras":
        """As that file names them. Raises BadCameras."""
        try:
            file = toml_of(path, CamerasFile)
            filmed = [_filmed(entry, path.parent) for entry in file.cameras]
            flyable(Rig(name="vehicle", cameras=tuple(one.camera for one in filmed)))
        except OSError as error:
            raise BadCameras(f"{path}: {error.strerror}; name a readable file") from None
        except ValidationError as error:
            raise BadCameras(f"{path}: {first_problem(error)}") from None
        except (BadFile, BadCalibration, BadRig) as error:
            raise BadCameras(f"{path}: {error}") from None
        return cls(filmed)

    def start(self) -> None:
        for one in self._filmed.values():
            one.picture.start()
            one.depth.start()

    async def close(self) -> None:
        grabbers = [grabber for one in self._filmed.values() for grabber in (one.picture, one.depth)]
        await asyncio.gather(*(asyncio.to_thread(grabber.close) for grabber in grabbers))

    async def problem(self) -> str | None:
        """Which camera gives nothing of now, and why; null where all do."""
        try:
            for one in self._filmed.values():
                self._fresh(one.picture, one.camera.name, "picture")
                self._fresh(one.depth, one.camera.name, "depth")
        except Unavailable as error:
            return error.message
        return None

    async def look(self, chosen: Sequence[Camera], pose_at: PoseAt, *, depth: bool) -> Seen:
        """The latest frames, and the pose at the middle of their times. Raises Unavailable where one is not of now, or
        not as its calibration says, and NoPose."""
        began = time.perf_counter()
        pairs = []
        for camera in chosen:
            one = self._filmed[camera.name]
            picture = self._fresh(one.picture, camera.name, "picture")
            pairs.append((one, picture, self._fresh(one.depth, camera.name, "depth") if depth else None))
        times = [frame.time_s for _, *frames in pairs for frame in frames if frame is not None]
        time_s = (min(times) + max(times)) / 2.0
        pose = pose_at(time_s)
        try:
            views = await asyncio.gather(*(asyncio.to_thread(one.view, p, d) for one, p, d in pairs))
        except BadCalibration as error:
            raise Unavailable(str(error), code="bad_camera") from None
        return Seen(tuple(views), time_s, pose, {"encode": time.perf_counter() - began})

    def _fresh(self, grabber: Grabber, name: str, what: str) -> Frame:
        frame = grabber.latest
        if frame is None:
            why = grabber.trouble or "nothing came yet"
            raise Unavailable(f"camera {name} has given no {what}: {grabber.source} {why}", code="no_pictures")
        age_s = self._clock() - frame.time_s
        if age_s > OLDEST_S:
            why = f": {grabber.source} {grabber.trouble}" if grabber.trouble else ""
            raise Unavailable(f"the last {what} of camera {name} is {age_s:.1f} s old{why}", code="stale_frames")
        return frame


def _filmed(entry: CameraEntry, folder: Path) -> _Filmed:
    """Raises BadCalibration, ValidationError."""
    calibration = read_calibration(folder / entry.calibration)
    camera = calibration.camera(
        entry.name, heading_deg=entry.heading_deg, pitch_deg=entry.pitch_deg, offset=entry.offset
    )
    if entry.longer_side_px is not None:
        camera = camera.scaled_to(entry.longer_side_px)
    return _Filmed(entry, Rectifier(calibration, camera))
