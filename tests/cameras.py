"""Cameras for tests: square and level, in the drone's centre, as the rigs in use have them."""

from collections.abc import Iterable

from contracts.cameras import Camera, pinhole_camera


def square(heading_deg: float = 0.0, size: int = 800) -> Camera:
    """90 degrees across and down."""
    return pinhole_camera(f"at{heading_deg:g}", size, size, horizontal_fov_deg=90.0, heading_deg=heading_deg)


def squares(headings_deg: Iterable[float], size: int = 800) -> tuple[Camera, ...]:
    return tuple(square(heading_deg, size) for heading_deg in headings_deg)
