"""What is known of model families and of servers, read from the TOML files beside this one."""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Literal

from pydantic import Field

from contracts.base import Wire

BoxStyle = Literal["unit", "thousand", "thousand_yx", "pixels", "resized_pixels"]
Structured = Literal["json_schema", "json_object", "guided", "none"]


class Family(Wire):
    """How a family of models wants to be asked. `version` goes into the cache's key: raise it with every change.

    `boxes`: numbers of a box as the model writes them. `unit`: x y x y in 0..1; `thousand`: x y x y in 0..1000;
    `thousand_yx`: y x y x in 0..1000; `pixels`: x y x y of the picture as sent; `resized_pixels`: x y x y of the
    picture as the model's processor resizes it (multiples of `image_factor`, from `min_pixels` to `max_pixels`).
    `box_key` is what the family calls a box. `documented` says whether the makers describe the boxes.
    `reads_system` is false where the chat template has no system message beside pictures.
    """

    version: int = Field(ge=1)
    about: str
    vision: bool = True
    boxes: BoxStyle = "unit"
    box_key: Literal["bbox", "bbox_2d", "box_2d"] = "bbox"
    documented: bool = False
    image_factor: int = Field(default=28, ge=1, le=512)
    min_pixels: int = Field(default=1, ge=1)
    max_pixels: int = Field(default=16_777_216, ge=1)
    max_images: int = Field(default=1, ge=1, le=16)
    reads_system: bool = True
    temperature: float = Field(default=0.0, ge=0.0, le=2.0)
    max_tokens: int = Field(default=512, ge=16, le=32_768)


class Server(Wire):
    """What a server understands. `max_tokens_field` is what it calls the limit of the answer's length."""

    about: str
    base_url: str = ""
    structured: Structured = "none"
    max_tokens_field: Literal["max_tokens", "max_completion_tokens"] = "max_tokens"


@cache
def families() -> dict[str, Family]:
    """Presets of model families by name."""
    return {name: Family.model_validate(entry) for name, entry in _table("families.toml").items()}


@cache
def servers() -> dict[str, Server]:
    """Presets of servers by name."""
    return {name: Server.model_validate(entry) for name, entry in _table("servers.toml").items()}


def _table(name: str) -> dict[str, object]:
    return tomllib.loads(files(__package__).joinpath(name).read_text(encoding="utf-8"))
