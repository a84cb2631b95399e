"""What the drone's cameras show at one moment, decoded as far as it is needed."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera as WireCamera
from contracts.depth_assist import ViewDepth
from contracts.event_data import picture_name
from contracts.geometry import Pose
from contracts.images import BadImage, DepthMap, decode_depth_units, decode_jpeg, depth_in_metres, jpeg_bytes
from contracts.vehicle import Observation, SensedView
from mission.ports import ServiceRefused
from navigation.camera import Camera, DepthView, fewest


@dataclass(frozen=True)
class Sight:
    """One camera's view of one moment. Depth: (H, W) float32 metres along the optical axis, inf where nothing was hit,
    nan where invalid."""

    pose: Pose
    view: SensedView

    @cached_property
    def camera(self) -> Camera:
        """The camera as the mathematics takes it."""
        return navigation_camera(self.view.camera)

    @property
    def seen(self) -> DepthView:
        """The depth with its camera, as the mathematics takes it."""
        return DepthView(self.camera, self.depth_m)

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
        return {sight.name: sight.jpeg for sight in self.sights.values()}


def look_of(observation: Observation, wanted: Sequence[str]) -> Look:
    """Raises ServiceRefused where a camera's view is missing or a picture is not what it says it is."""
    sights = {view.camera.name: Sight(observation.pose, view) for view in observation.views}
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
