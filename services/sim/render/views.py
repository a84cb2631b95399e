"""What a renderer is asked and what it answers; the camera that all renderers share.

The camera is a pinhole of 90 degrees: f = size / 2 pixels, pixel centres at +0.5. A view's heading is in degrees
relative to the nose, positive to the right, that is clockwise seen from above.
"""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Pose
from contracts.images import DEPTH_METRES_PER_UNIT, NO_RETURN
from services.sim.geometry.scene_mesh import SceneMesh

NEAR_M = 0.05
FAR_M = 1000.0


class RenderedViews(NamedTuple):
    """rgb (V, H, W, 3) uint8 sRGB; depth_units (V, H, W) uint16 in units of 2 mm along the optical axis, 65535 where
    nothing was hit within 131 m; ids (V, H, W) uint16 the part seen in each pixel, 0 for none, where asked for."""

    rgb: NDArray[np.uint8]
    depth_units: NDArray[np.uint16]
    ids: NDArray[np.uint16] | None = None

    def depth_m(self) -> NDArray[np.float32]:
        """(V, H, W) metres along the optical axis, inf where nothing was hit."""
        metres = self.depth_units.astype(np.float32) * np.float32(DEPTH_METRES_PER_UNIT)
        metres[self.depth_units == NO_RETURN] = np.inf
        return metres


class Uploaded(Protocol):
    """A scene in a renderer's memory, until it is released."""

    def release(self) -> None: ...


class Renderer(Protocol):
    """Draws uploaded scenes. Bound to the thread that made it: see `services.sim.render.thread`."""

    name: Literal["moderngl", "tiny"]
    detail: str

    def upload(self, scene: SceneMesh) -> Uploaded: ...

    def render(
        self, uploaded: Any, pose: Pose, headings_deg: Sequence[float], size: int, *, labelled: bool = False
    ) -> RenderedViews:
        """Pictures and depth of each view, `size` pixels square; `labelled`: the ids as well, nearly for nothing."""
        ...

    def render_ids(self, uploaded: Any, pose: Pose, headings_deg: Sequence[float], size: int) -> NDArray[np.uint16]:
        """(V, H, W): the id of the part seen in each pixel, 0 for none."""
        ...

    def close(self) -> None: ...


def view_axes(pose: Pose, heading_deg: float) -> NDArray[np.float64]:
    """(3, 3): rows are the view's right, up and forward in the world's axes."""
    a = pose.yaw - radians(heading_deg)
    return np.array([[sin(a), -cos(a), 0.0], [0.0, 0.0, 1.0], [cos(a), sin(a), 0.0]])


def project(pose: Pose, heading_deg: float, size: int, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, 3) world points to (N, 3): x and y in pixels from the top left corner, depth in metres along the axis."""
    eye = np.array([pose.x, pose.y, pose.z])
    right, up, forward = ((np.asarray(points, np.float64) - eye) @ view_axes(pose, heading_deg).T).T
    f = size / 2
    return np.column_stack([f + f * right / forward, f - f * up / forward, forward])
