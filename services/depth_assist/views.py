"""From the wire's views to those of the mathematics: checked, told apart, decoded."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import MAX_VIEW_PIXELS
from contracts.cameras import Camera as RigCamera
from contracts.depth_assist import ViewDepth
from contracts.geometry import Box
from contracts.images import BadImage, decode_depth, decode_depth_units
from navigation import viewpoint
from navigation.camera import Camera, DepthView
from navigation.sensing import read_units, read_views
from service_kit.errors import BadQuestion

Rows = tuple[int, int]
"""First and past the last."""


def camera_of(camera: RigCamera) -> Camera:
    """The wire's camera as the mathematics takes it."""
    offset = camera.offset
    return Camera(
        width=camera.width,
        height=camera.height,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=camera.cx_px,
        cy_px=camera.cy_px,
        heading_deg=camera.heading_deg,
        pitch_deg=camera.pitch_deg,
        forward_m=offset.forward_m,
        right_m=offset.right_m,
        up_m=offset.up_m,
    )


def checked(views: Sequence[ViewDepth]) -> Sequence[ViewDepth]:
    """The same views. Raises BadQuestion where two share a name or one is too large to be read."""
    names = [view.camera.name for view in views]
    if len(set(names)) < len(names):
        raise BadQuestion(
            f"two views share a camera's name: {', '.join(names)}; give each view one of its own",
            code="duplicate_camera",
        )
    for view in views:
        width, height = view.depth.width, view.depth.height
        if width * height > MAX_VIEW_PIXELS:
            raise BadQuestion(
                f"the depth map of camera {view.camera.name} has {width} x {height} pixels; "
                f"at most {MAX_VIEW_PIXELS} are read",
                code="depth_too_large",
            )
    return views


def level(views: Sequence[ViewDepth]) -> list[ViewDepth]:
    """Those that see the horizon. Raises BadQuestion where none does."""
    kept = [view for view in views if camera_of(view.camera).is_level]
    if not kept:
        raise BadQuestion(
            f"no view is level: {', '.join(view.camera.name for view in views)}; send one whose pitch is 0 and whose "
            "principal point lies in its picture",
            code="no_level_view",
        )
    return kept


def ahead(views: Sequence[ViewDepth]) -> RigCamera:
    """The camera that looks most nearly ahead, in whose picture the building's box is."""
    return min((view.camera for view in views), key=lambda camera: abs(camera.heading_deg))


def front_rows(front: RigCamera, views: Sequence[ViewDepth], box: Box) -> dict[str, Rows]:
    """Of each view's camera, the rows at the heights at which `front` sees the box's upper and lower edge."""
    rows = {}
    for view in views:
        camera = view.camera
        y_min, y_max = box.y_min, box.y_max
        if (camera.height, camera.fy_px, camera.cy_px) != (front.height, front.fy_px, front.cy_px):
            y_min, y_max = (_row_at(front, camera, y) for y in (y_min, y_max))
        rows[camera.name] = viewpoint.row_range(y_min, y_max, camera.height)
    return rows


def slice_means(
    views: Sequence[ViewDepth], settings: viewpoint.ViewpointParameters, rows: Mapping[str, Rows]
) -> dict[str, NDArray[np.float64]]:
    """By camera, cropped to its `rows` where it has any. Raises BadQuestion for depth that can't be read or sliced."""
    read = read_units([_units(view) for view in views])
    means = {}
    for view, units in zip(views, read, strict=True):
        name, per_unit = view.camera.name, view.depth.metres_per_unit
        try:
            means[name] = viewpoint.slice_means(
                units, per_unit, settings.slices, settings.sensor_range_m, rows.get(name)
            )
        except ValueError as error:
            raise _bad_depth(view, error) from None
    return means


def _units(view: ViewDepth) -> NDArray[np.uint16]:
    try:
        return decode_depth_units(view.depth)
    except BadImage as error:
        raise _bad_depth(view, error) from None


def depth_views(views: Sequence[ViewDepth], sensor_range_m: float) -> list[DepthView]:
    """Depth in metres, read by the rule of `navigation.sensing`. Raises BadQuestion."""
    decoded = []
    for view in views:
        try:
            depth_m = decode_depth(view.depth)
        except BadImage as error:
            raise _bad_depth(view, error) from None
        decoded.append(DepthView(camera_of(view.camera), depth_m))
    return read_views(decoded, sensor_range_m)


def _row_at(front: RigCamera, camera: RigCamera, y: float) -> float:
    """The share of `camera`'s picture that lies over the elevation of row `y` of the front picture."""
    slope = (front.cy_px - y * front.height) / front.fy_px
    return min(1.0, max(0.0, (camera.cy_px - slope * camera.fy_px) / camera.height))


def _bad_depth(view: ViewDepth, error: ValueError) -> BadQuestion:
    return BadQuestion(f"the view of camera {view.camera.name}: {error}", code="bad_depth")
