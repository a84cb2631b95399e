"""Cameras for tests: square and level, in the drone's centre, as the rigs in use have them."""

from collections.abc import Iterable

from contracts.cameras import Camera, default_rig, pinhole_camera

NAMES = {round(camera.heading_deg): camera.name for camera in default_rig().cameras}
"""Of the default rig's cameras, by their headings."""


def square(heading_deg: float = 0.0, size: int = 800) -> Camera:
    """90 degrees across and down, named as the default rig's camera with that heading where there is one."""
    name = NAMES.get(round(heading_deg), f"at{heading_deg:g}")
    return pinhole_camera(name, size, size, horizontal_fov_deg=90.0, heading_deg=heading_deg)


def squares(headings_deg: Iterable[float], size: int = 800) -> tuple[Camera, ...]:
    return tuple(square(heading_deg, size) for heading_deg in headings_deg)


def camera_json(heading_deg: float = 0.0, size: int = 800) -> dict[str, object]:
    """As it crosses the wire."""
    return square(heading_deg, size).model_dump()
