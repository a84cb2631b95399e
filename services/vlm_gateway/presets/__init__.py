"""What is known of model families and of servers, read from the TOML files beside this one.

Every entry names its `sources`: where its makers, or people who measured it, say so.
"""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import Field

from contracts.base import Wire

BoxStyle = Literal["unit", "thousand", "pixels", "resized_pixels"]
BoxOrder = Literal["xyxy", "yxyx", "xywh"]
ImageFormat = Literal["jpeg", "png", "webp", "gif"]
Structured = Literal[
    "json_schema",
    "json_object",
    "json_object_schema",
    "guided_json",
    "structured_outputs",
    "grammar",
    "format",
    "none",
]


class Family(Wire):
    """How a family of models wants to be asked. `version` goes into the cache's key: raise it with every change.

    `boxes`: the numbers of a box as the model writes them. `unit`: 0..1 of width and height; `thousand`: 0..1000 of
    them; `pixels`: of the picture as sent; `resized_pixels`: of the picture as the model's processor resizes it
    (multiples of `image_factor`, from `min_pixels` to `max_pixels` in area). `box_order`: `xyxy` two corners, x
    first; `yxyx` two corners, y first; `xywh` the upper left corner, width and height. `box_key` is what the family
    calls a box. `documented` says whether the makers describe the boxes. `reads_system` is false where the chat
    template has no system message beside pictures.
    """

    version: int = Field(ge=1)
    about: str
    sources: tuple[str, ...] = ()
    vision: bool = True
    boxes: BoxStyle = "unit"
    box_order: BoxOrder = "xyxy"
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
    """What a server understands.

    `api`: `openai` is asked at `/chat/completions` under its address, `ollama` at its native `/api/chat` (typed
    questions only; chats of clients go to its `/v1`). `structured` is the dialect in which an answer's form is asked
    for: `json_schema` and `json_object` as OpenAI's `response_format`; `json_object_schema` is llama-cpp-python's, a
    JSON object with its schema beside it; `guided_json` and `structured_outputs` are vLLM's own fields, before and
    since 0.12; `grammar` is llama.cpp's GBNF; `format` Ollama's; `none` asks in words only. Whatever a server promises,
    every answer is checked here. `max_tokens_field` is what it calls the limit of the answer's length.
    `max_image_bytes` and `max_image_side` (pixels) bound one picture; larger ones are scaled
    down before they are sent, and so are those in none of its `image_formats`. `extra` is sent with every typed
    question. `counts_streams`: it takes OpenAI's `stream_options`.

    Of a chat's fields, `passes` go to it besides OpenAI's common ones; of a message's and a part's, `message_fields`
    and `part_fields` do, and others are dropped (`*` passes all); `part_types` besides texts and pictures. Without
    `developer_role` that role is called `system`.
    """

    about: str
    sources: tuple[str, ...] = ()
    api: Literal["openai", "ollama"] = "openai"
    base_url: str = ""
    structured: Structured = "none"
    max_tokens_field: Literal["max_tokens", "max_completion_tokens"] = "max_tokens"
    counts_streams: bool = True
    max_image_bytes: int = Field(default=20_000_000, ge=10_000)
    max_image_side: int = Field(default=8192, ge=64)
    image_formats: tuple[ImageFormat, ...] = ("jpeg", "png")
    extra: dict[str, Any] = {}
    passes: tuple[str, ...] = ()
    message_fields: tuple[str, ...] = ()
    part_fields: tuple[str, ...] = ()
    part_types: tuple[str, ...] = ()
    developer_role: bool = False


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
