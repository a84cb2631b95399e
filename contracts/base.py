"""The base of everything that crosses a wire: closed, frozen, finite."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Metres = Annotated[float, Field(ge=0.0, le=10_000.0)]
"""A length or distance in metres."""

FARTHEST_M = 10_000.0
"""From the origin, along each axis."""

Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
"""One coordinate in metres, ENU: x east, y north, z up from the ground."""

Radians = Annotated[float, Field(ge=-1_000.0, le=1_000.0)]
"""An angle in radians, counter-clockwise from east."""

Unit = Annotated[float, Field(ge=0.0, le=1.0)]
"""A share, a confidence or a position in 0..1 of an image's width or height."""

RGB = r"^#[0-9a-f]{6}$"
Rgb = Annotated[str, Field(pattern=RGB)]
"""A colour as #rrggbb in lower case, sRGB."""

Name = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.:-]*$")]
"""An identifier that is safe in a path and in a log line."""

ModelName = Annotated[str, Field(min_length=1, max_length=128, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.:/@+-]*$")]
"""What a gateway calls a model: a name, or one such as its makers write, `Qwen/Qwen2.5-VL-7B-Instruct`."""


class Wire(BaseModel):
    """A message or a part of one: unknown fields are refused, numbers are finite, values don't change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, protected_namespaces=())
