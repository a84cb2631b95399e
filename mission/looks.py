"""What the drone's cameras show at one moment, decoded as far as it is needed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera as WireCamera
from contracts.cameras import MountingOffset
from contracts.depth_assist import ViewDepth
from contracts.event_data import picture_name
from contracts.geometry import Pose
from contracts.images import BadImage, DepthMap, decode_depth_units, decode_jpeg, depth_in_metres, jpeg_bytes
from contracts.vehicle import Observation, SensedView
from mission.depth_pictures import depth_picture
from mission.ports import ServiceRefused
from navigation.camera import Camera, DepthView, fewest
from navigation.sensing import read_views

FAR_M = 40.0
"""A reach beyond this makes no difference to anything."""
_TURN_STEP_DEG = 15


@dataclass(frozen=True)
class Sight:
    """One camera's view of one moment. Depth: (H, W) float32 metres along the optical axis, inf where nothing was hit,
    nan where invalid."""

    pose: Pose
    view: SensedView
    shown_m: float = 0.0
    """The reach that earlier looks have shown, metres."""

    @cached_property
    def camera(self) -> Camera:
        """The camera as the mathematics takes it."""
        return navigation_camera(self.view.camera)

    @cached_property
    def seen(self) -> DepthView:
        """The depth with its camera, as the mathematics takes it: read by the rule of `navigation.sensing`."""
        return read_views((DepthView(self.camera, self.depth_m),), shown_m=self.shown_m)[0]

    @property
    def eye_z(self) -> float:
        """The camera's height above ground, metres."""
        return self.pose.z + self.camera.up_m

    @cached_property
    def rgb(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8."""
        return decode_jpeg(self.view.image)

    @cached_property
    def depth_m(self) -> NDArray[np.float32]:
        return depth_in_metres(self._units, self._depth.metres_per_unit)

    def depth_row_m(self, row: int) -> NDArray[np.float32]:
        """(W,) one row of `depth_m`, where the rest of it is not needed."""
        return depth_in_metres(self._units[row], self._depth.metres_per_unit)

    @cached_property
    def _units(self) -> NDArray[np.uint16]:
        return decode_depth_units(self._depth)

    @property
    def _depth(self) -> DepthMap:
        if self.view.depth is None:
            raise ServiceRefused("the vehicle sent a view without depth", code="garbled", status=502)
        return self.view.depth

    def depth_picture(self) -> bytes:
        """The depth as a JPEG for people."""
        return depth_picture(self._units, self._depth.metres_per_unit)

    @property
    def depth_view(self) -> ViewDepth:
        """The depth as it came, to be sent on."""
        return ViewDepth(camera=self.view.camera, depth=self._depth)

    @cached_property
    def jpeg(self) -> bytes:
        return jpeg_bytes(self.view.image)

    @property
    def name(self) -> str:
        """Of its picture in the record."""
        return picture_name(self.view.camera)

    @property
    def depth_name(self) -> str | None:
        """Of the picture of its depth in the record; null for a camera without depth."""
        return None if self.view.depth is None else f"{self.name}_depth"


@dataclass(frozen=True)
class Look:
    """All views of one moment, by camera name in the order of the rig."""

    observation: Observation
    sights: dict[str, Sight]

    @property
    def pose(self) -> Pose:
        return self.observation.pose

    @property
    def all(self) -> tuple[Sight, ...]:
        return tuple(self.sights.values())

    @property
    def across(self) -> tuple[Sight, ...]:
        """The fewest level views that see all round as far as all of them do."""
        kept = fewest([sight.camera for sight in self.all])
        return tuple(sight for sight in self.all if sight.camera in kept)

    def depth_beside(self, sight: Sight, reach_deg: float = 45.0) -> tuple[ViewDepth, ...]:
        """The depth of the views whose headings lie within `reach_deg` of that one's, and of all that look up or down;
        without itself."""
        heading = sight.camera.heading_deg
        return tuple(
            other.depth_view
            for other in self.sights.values()
            if other is not sight
            and (not other.camera.is_level or abs(other.camera.heading_deg - heading) <= reach_deg)
        )

    @property
    def pictures(self) -> dict[str, bytes]:
        """The JPEG files, by a short name, as the record keeps them."""
        seen = {sight.name: sight.jpeg for sight in self.all}
        depth = {sight.depth_name: sight.depth_picture() for sight in self.all if sight.depth_name is not None}
        return seen | depth


def look_of(observation: Observation, wanted: Sequence[str], shown_m: float = 0.0) -> Look:
    """`shown_m`: the reach that earlier looks have shown. Raises ServiceRefused where a camera's view is missing or a
    picture is not what it says it is."""
    sights = {view.camera.name: Sight(observation.pose, view, shown_m) for view in observation.views}
    missing = [name for name in wanted if name not in sights]
    if missing:
        raise ServiceRefused(f"the vehicle sent no view of {', '.join(missing)}", code="garbled", status=502)
    try:
        for sight in sights.values():
            _ = sight.jpeg
            _check_size(sight)
    except BadImage as error:
        raise ServiceRefused(f"the vehicle sent a bad picture: {error}", code="garbled", status=502) from None
    return Look(observation, sights)


def joined(seen: Sequence[Observation], wanted: Sequence[str]) -> Look:
    """One look from observations that were made while the drone turned on the spot: every view as the drone would have
    had it at the last one's pose, which is the look's. `wanted`: the cameras of the last one. Raises ServiceRefused."""
    *turned, last = seen
    look = look_of(last, wanted)
    sights: dict[str, Sight] = {}
    for observation in turned:
        for sight in look_of(observation, ()).all:
            view = sight.view.model_copy(
                update={"camera": camera_as_of(sight.view.camera, observation.pose, last.pose)}
            )
            sights[view.camera.name] = Sight(last.pose, view)
    return Look(last, sights | look.sights)


def camera_as_of(camera: WireCamera, pose: Pose, reference: Pose) -> WireCamera:
    """The camera of a drone at `pose`, as a camera of the drone at `reference` in the same place and direction; its
    name tells the heading it has there."""
    turn_deg = math.degrees(math.remainder(reference.yaw - pose.yaw, math.tau))
    heading = round(math.remainder(camera.heading_deg + turn_deg, 360.0), 6)
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    offset = camera.offset
    east = pose.x - reference.x + offset.forward_m * cos + offset.right_m * sin
    north = pose.y - reference.y + offset.forward_m * sin - offset.right_m * cos
    cos, sin = math.cos(reference.yaw), math.sin(reference.yaw)
    moved = MountingOffset(
        forward_m=round(east * cos + north * sin, 6),
        right_m=round(east * sin - north * cos, 6),
        up_m=round(pose.z - reference.z + offset.up_m, 6),
    )
    name = f"{camera.name}:{round(heading)}"
    return camera.model_copy(update={"name": name, "heading_deg": heading, "offset": moved})


def turns_needed(cameras: Sequence[Camera], reach_deg: float) -> tuple[float, ...]:
    """Towards which headings (degrees to the right of the nose) the drone must turn so that its level cameras see
    everything up to `reach_deg` to either side; ahead comes last. Empty where they see that without turning."""
    level = [camera for camera in cameras if camera.is_level]
    wanted = set(range(-math.floor(reach_deg), math.floor(reach_deg) + 1))
    seen = {turn: _bearings_seen(level, turn) & wanted for turn in range(-180, 180, _TURN_STEP_DEG)}
    turns, left = [0], wanted - seen[0]
    while left:
        best = max(seen, key=lambda turn: (len(seen[turn] & left), turn % 45 == 0, -abs(turn)))
        if not seen[best] & left:
            break  # no camera sees it, wherever the nose points
        turns.append(best)
        left -= seen[best]
    return (*map(float, sorted(turns[1:])), 0.0) if len(turns) > 1 else ()


def _bearings_seen(level: Sequence[Camera], turn_deg: float) -> set[int]:
    """The whole degrees that the cameras see with the nose turned so far to the right."""
    seen: set[int] = set()
    for camera in level:
        first, last = math.ceil(camera.left_deg + turn_deg - 1e-6), math.floor(camera.right_deg + turn_deg + 1e-6)
        seen |= {(bearing + 180) % 360 - 180 for bearing in range(first, last + 1)}
    return seen


def _check_size(sight: Sight) -> None:
    camera, depth = sight.view.camera, sight.view.depth
    if depth is not None and (depth.width, depth.height) != (camera.width, camera.height):
        raise ServiceRefused(
            f"the vehicle's camera {camera.name} has {camera.width} x {camera.height} pixels, its depth "
            f"{depth.width} x {depth.height}",
            code="garbled",
            status=502,
        )


def navigation_camera(camera: WireCamera) -> Camera:
    """A camera of the contracts as the mathematics takes it."""
    offset = camera.offset
    return Camera(
        camera.width,
        camera.height,
        camera.fx_px,
        camera.fy_px,
        camera.cx_px,
        camera.cy_px,
        camera.heading_deg,
        camera.pitch_deg,
        offset.forward_m,
        offset.right_m,
        offset.up_m,
    )
