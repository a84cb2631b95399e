"""Cameras as data: what a pinhole camera is, where it is mounted, and the rigs that a drone carries.

Frames: the nose frame has x along the drone's nose, y to its right, z up, metres from the drone's centre. A camera's
heading is in degrees about z, positive to the right of the nose; its pitch in degrees, positive upwards. The image
frame has x to the right and y down in pixels, continuous: the centre of pixel (row, column) is
(column + 0.5, row + 0.5).
"""

import math
from functools import cache
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from contracts.base import Name, Wire
from contracts.toml_documents import Kind

MAX_CAMERAS = 16
MAX_VIEW_PIXELS = 1600 * 1600
"""Of one camera's picture, for the services to draw, read and measure it."""
AHEAD_DEG = 1.0
MIN_FOV_DEG, MAX_FOV_DEG = 1.0, 170.0
"""Of a camera that a rig's file gives by its field of view: what is wider is no pinhole camera, what is narrower sees
nothing."""
MountingMetres = Annotated[float, Field(ge=-5.0, le=5.0)]
Pixels = Annotated[int, Field(ge=16, le=4096)]
FocalPixels = Annotated[float, Field(gt=1.0, le=100_000.0)]

DEFAULT_RIG = "paper-five"


class BadRig(ValueError):
    """A rig that is none, or a name that no rig has; the message says what was wrong and what there is."""


_RIGS = Kind("rigs", "rig", "rigs", BadRig)


class MountingOffset(Wire):
    """Where the camera sits in the nose frame, metres from the drone's centre."""

    forward_m: MountingMetres = 0.0
    right_m: MountingMetres = 0.0
    up_m: MountingMetres = 0.0


class Camera(Wire):
    """An ideal pinhole camera and how it is mounted. Depth is measured along its optical axis (planar z)."""

    name: Name
    width: Pixels
    height: Pixels
    fx_px: FocalPixels
    fy_px: FocalPixels
    cx_px: float = Field(ge=-4096.0, le=8192.0)
    cy_px: float = Field(ge=-4096.0, le=8192.0)
    heading_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    pitch_deg: float = Field(default=0.0, ge=-90.0, le=90.0)
    offset: MountingOffset = MountingOffset()

    @property
    def left_deg(self) -> float:
        """Bearing of the picture's left edge from the optical axis, negative for an axis inside the picture."""
        return math.degrees(math.atan2(-self.cx_px, self.fx_px))

    @property
    def right_deg(self) -> float:
        """Bearing of the picture's right edge from the optical axis."""
        return math.degrees(math.atan2(self.width - self.cx_px, self.fx_px))

    @property
    def looks_ahead(self) -> bool:
        """Level, and along the nose: floors are counted in such a camera's pictures."""
        inside = 0.0 < self.cx_px < self.width and 0.0 < self.cy_px < self.height
        return inside and abs(self.heading_deg) <= AHEAD_DEG and abs(self.pitch_deg) <= AHEAD_DEG

    def scaled_to(self, longer_side_px: int) -> "Camera":
        """The same camera with its longer side so many pixels: what the field of view holds does not change."""
        scale = longer_side_px / max(self.width, self.height)
        if scale == 1.0:
            return self
        width, height = max(16, round(self.width * scale)), max(16, round(self.height * scale))
        across, down = width / self.width, height / self.height
        return self.model_copy(
            update={
                "width": width,
                "height": height,
                "fx_px": self.fx_px * across,
                "cx_px": self.cx_px * across,
                "fy_px": self.fy_px * down,
                "cy_px": self.cy_px * down,
            }
        )


class Rig(Wire):
    """The cameras of a drone; their names are unique."""

    name: Name
    cameras: tuple[Camera, ...] = Field(min_length=1, max_length=MAX_CAMERAS)

    @model_validator(mode="after")
    def _unique(self) -> Self:
        names = [camera.name for camera in self.cameras]
        if len(set(names)) != len(names):
            raise ValueError(f"rig {self.name}: names of cameras must be unique; there are {names}")
        return self

    @property
    def front(self) -> Camera | None:
        """The first camera that looks ahead; null where none does."""
        return next((camera for camera in self.cameras if camera.looks_ahead), None)

    def camera(self, name: str) -> Camera:
        """The camera of that name. Raises KeyError."""
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise KeyError(name)

    def scaled_to(self, longer_side_px: int) -> "Rig":
        """All cameras with pictures whose longer side has so many pixels."""
        return self.model_copy(update={"cameras": tuple(c.scaled_to(longer_side_px) for c in self.cameras)})


def pinhole_camera(
    name: str,
    width: int,
    height: int,
    *,
    horizontal_fov_deg: float,
    heading_deg: float = 0.0,
    pitch_deg: float = 0.0,
    offset: MountingOffset | None = None,
) -> Camera:
    """Square pixels, the principal point in the picture's middle: f = (W / 2) / tan(FoV / 2)."""
    focal_px = round(width / 2.0 / math.tan(math.radians(horizontal_fov_deg) / 2.0), 9)  # 90 degrees: W / 2 to the bit
    return Camera(
        name=name,
        width=width,
        height=height,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=width / 2.0,
        cy_px=height / 2.0,
        heading_deg=heading_deg,
        pitch_deg=pitch_deg,
        offset=offset or MountingOffset(),
    )


def flyable(rig: Rig) -> Rig:
    """The same rig. Raises BadRig where a mission can't be flown with it."""
    if rig.front is None:
        raise BadRig(
            f"rig {rig.name} has no camera that looks ahead: one needs heading_deg = 0, pitch_deg = 0 and its "
            "principal point inside the picture"
        )
    for camera in rig.cameras:
        if camera.width * camera.height > MAX_VIEW_PIXELS:
            raise BadRig(
                f"rig {rig.name}: camera {camera.name} has {camera.width} x {camera.height} pixels; at most "
                f"{MAX_VIEW_PIXELS} are flown with"
            )
    return rig


def rig_names() -> tuple[str, ...]:
    """The rigs that ship with the project."""
    return _RIGS.names()


def shipped_rig(name: str) -> Rig:
    """The rig of that name. Raises BadRig."""
    return _RIGS.shipped(name, _rig)


@cache
def default_rig() -> Rig:
    """The rig of a drone of which nothing else is said."""
    return shipped_rig(DEFAULT_RIG)


def load_rig(name_or_file: str) -> Rig:
    """A shipped rig by its name, or a rig from a TOML file. Raises BadRig."""
    return _RIGS.load(name_or_file, _rig)


def parse_rig(text: str, source: str) -> Rig:
    """A rig from TOML: `name` and `[[cameras]]`, each with `horizontal_fov_deg` or with focal lengths and principal
    point in pixels. `source` is named in errors. Raises BadRig."""
    return _RIGS.parse(text, source, _rig)


def _rig(document: dict[str, Any]) -> Rig:
    """Raises ValueError."""
    entries = document.pop("cameras", [])
    if not isinstance(entries, list):
        raise ValueError("cameras must be tables, each headed [[cameras]]")
    return Rig.model_validate({**document, "cameras": [_camera(entry) for entry in entries]})


def _camera(entry: object) -> object:
    """Raises ValueError."""
    if not isinstance(entry, dict) or "horizontal_fov_deg" not in entry:
        return entry
    clash = sorted({"fx_px", "fy_px", "cx_px", "cy_px"} & set(entry))
    if clash:
        raise ValueError(f"a camera with horizontal_fov_deg has no {', '.join(clash)}: give one or the other")
    rest = dict(entry)
    fov = rest.pop("horizontal_fov_deg")
    if isinstance(fov, bool) or not isinstance(fov, int | float) or not MIN_FOV_DEG <= fov <= MAX_FOV_DEG:
        raise ValueError(f"horizontal_fov_deg must lie between {MIN_FOV_DEG:g} and {MAX_FOV_DEG:g}, not {fov!r}")
    width, height = rest.get("width"), rest.get("height")
    if not isinstance(width, int) or not isinstance(height, int):
        raise ValueError("a camera needs width and height in whole pixels")
    pinhole = pinhole_camera("camera", width, height, horizontal_fov_deg=float(fov))
    return pinhole.model_dump(exclude={"name", "heading_deg", "pitch_deg", "offset"}) | rest
