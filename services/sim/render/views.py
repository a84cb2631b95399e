"""What a renderer is asked and what it answers; the camera mathematics that all renderers share.

The image frame is that of `contracts.cameras`: pixel centres at +0.5, headings positive to the right of the nose, that
is clockwise seen from above, pitch positive upwards.
"""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import MAX_CAMERAS, MAX_VIEW_PIXELS, Camera
from contracts.geometry import Pose
from contracts.images import DEPTH_METRES_PER_UNIT, NO_RETURN
from services.sim.geometry.scene_mesh import SceneMesh

NEAR_M = 0.05
FAR_M = 1000.0


class RenderedViews(NamedTuple):
    """Of each view, in the order asked for: rgb (H, W, 3) uint8 sRGB; depth_units (H, W) uint16 in units of 2 mm along
    the optical axis, 65535 where nothing was hit within 131 m; ids (H, W) uint16 the part seen in each pixel, 0 for
    none, where asked for; panes (H, W) bool window panes, where asked for and told."""

    rgb: tuple[NDArray[np.uint8], ...]
    depth_units: tuple[NDArray[np.uint16], ...]
    ids: tuple[NDArray[np.uint16], ...] | None = None
    panes: tuple[NDArray[np.bool_], ...] | None = None

    def depth_m(self) -> tuple[NDArray[np.float32], ...]:
        """(H, W) metres along the optical axis, inf where nothing was hit."""
        return tuple(_metres(units) for units in self.depth_units)


class Uploaded(Protocol):
    """A scene in a renderer's memory, until it is released."""

    def release(self) -> None: ...


class Renderer(Protocol):
    """Draws uploaded scenes. Bound to the thread that made it: see `services.sim.render.thread`."""

    name: Literal["moderngl", "tiny"]
    detail: str

    def upload(self, scene: SceneMesh) -> Uploaded: ...

    def render(
        self,
        uploaded: Any,
        pose: Pose,
        cameras: Sequence[Camera],
        time_s: float = 0.0,
        *,
        labelled: bool = False,
        panes: bool = False,
    ) -> RenderedViews:
        """Picture and depth of each camera of a drone at `pose`; `time_s`: of the clock that traffic goes by;
        `labelled`: the ids as well, nearly for nothing; `panes`: which pixels are panes, where the renderer can tell.
        Raises ValueError as `check_cameras` does."""
        ...

    def render_ids(
        self, uploaded: Any, pose: Pose, cameras: Sequence[Camera], time_s: float = 0.0
    ) -> tuple[NDArray[np.uint16], ...]:
        """(H, W) each: the id of the part seen in each pixel, 0 for none. Raises ValueError."""
        ...

    def close(self) -> None: ...


def check_cameras(cameras: Sequence[Camera]) -> None:
    """Raises ValueError for more cameras, or more pixels in one, than can be drawn at once; the message says which."""
    if not 1 <= len(cameras) <= MAX_CAMERAS:
        raise ValueError(f"{len(cameras)} views were asked for; 1 to {MAX_CAMERAS} can be drawn at once")
    for camera in cameras:
        if camera.width * camera.height > MAX_VIEW_PIXELS:
            raise ValueError(
                f"camera {camera.name!r} has {camera.width} x {camera.height} pixels; views of up to {MAX_VIEW_PIXELS} "
                "can be drawn"
            )


def eye_of(pose: Pose, camera: Camera) -> NDArray[np.float64]:
    """(3,) where the camera of a drone at `pose` is, in the world's axes."""
    at = np.array([pose.x, pose.y, pose.z])
    offset = camera.offset
    if offset.forward_m or offset.right_m or offset.up_m:
        c, s = cos(pose.yaw), sin(pose.yaw)
        at += [offset.forward_m * c + offset.right_m * s, offset.forward_m * s - offset.right_m * c, offset.up_m]
    return at


def view_axes(pose: Pose, camera: Camera) -> NDArray[np.float64]:
    """(3, 3): rows are the view's right, up and forward in the world's axes."""
    a = pose.yaw - radians(camera.heading_deg)
    right, up, forward = np.array([[sin(a), -cos(a), 0.0], [0.0, 0.0, 1.0], [cos(a), sin(a), 0.0]])
    if camera.pitch_deg:
        c, s = cos(radians(camera.pitch_deg)), sin(radians(camera.pitch_deg))
        up, forward = c * up - s * forward, c * forward + s * up
    return np.stack([right, up, forward])


def project(pose: Pose, camera: Camera, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, 3) world points to (N, 3): x and y in pixels from the top left corner, depth in metres along the axis."""
    gap = np.asarray(points, np.float64) - eye_of(pose, camera)
    right, up, forward = (gap @ view_axes(pose, camera).T).T
    return np.column_stack(
        [camera.cx_px + camera.fx_px * right / forward, camera.cy_px - camera.fy_px * up / forward, forward]
    )


def _metres(units: NDArray[np.uint16]) -> NDArray[np.float32]:
    metres = units.astype(np.float32) * np.float32(DEPTH_METRES_PER_UNIT)
    metres[units == NO_RETURN] = np.inf
    return metres
