"""What a model and its server take of a chat request, and pictures made to fit into it."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.pictures import ChatPicture

STANDARD_MESSAGE = frozenset({"role", "content", "name", "tool_calls", "tool_call_id"})
"""The fields of a message that every server of this kind knows."""
STANDARD_PART = frozenset({"type", "text", "image_url"})
STANDARD_IMAGE = frozenset({"url", "detail"})
ALL = "*"


class PictureBounds(NamedTuple):
    """`formats` are those of `contracts.images.image_header`; `max_pixels` is of the area, `max_side` of a side."""

    formats: frozenset[str]
    max_pixels: int
    max_side: int
    max_bytes: int

    def take(self, picture: ChatPicture) -> bool:
        """Whether it may be sent as it is."""
        form, width, height = picture.header
        return (
            form in self.formats
            and width * height <= self.max_pixels
            and width <= self.max_side
            and height <= self.max_side
            and picture.size_bytes <= self.max_bytes
        )

    def take_all(self, pictures: Sequence[ChatPicture]) -> bool:
        """Whether all of them may."""
        return not pictures or all(map(self.take, pictures))


class Accepted(NamedTuple):
    """What a target makes of a chat request: its model's name as JSON, its name for the length limit, fields to add
    where the client does not give them. `counts_streams`: it is asked to say at a stream's end what that cost.

    `fields` of a request are passed besides those of OpenAI's that everybody knows; `message_fields` and `part_fields`
    of messages and their parts are passed besides the standard ones, and others are dropped (`*` passes all);
    `part_types` are passed besides texts and pictures. Without `developer` that role is called `system`."""

    model_json: bytes
    limit_field: str
    extra: Mapping[str, Any]
    counts_streams: bool
    fields: frozenset[str]
    message_fields: frozenset[str]
    part_fields: frozenset[str]
    part_types: frozenset[str]
    developer: bool
    pictures: PictureBounds

    def takes(self, fields: frozenset[str], kinds: frozenset[str]) -> bool:
        """Whether a chat with these further fields and kinds of parts can be asked as its caller means it."""
        return self.fields >= fields and self.part_types >= kinds

    @property
    def fingerprint(self) -> list[object]:
        """What an answer depends on, beside the model."""
        names = [sorted(group) for group in (self.fields, self.message_fields, self.part_fields, self.part_types)]
        bounds = [sorted(self.pictures.formats), *self.pictures[1:]]
        return [self.limit_field, self.developer, *names, *bounds]


def accepted(model: ChatModel, model_json: bytes) -> Accepted:
    """As the server's preset says and the model's own configuration adds."""
    server, config = model.server, model.config
    return Accepted(
        model_json,
        server.max_tokens_field,
        config.extra,
        model.counts_streams,
        frozenset(server.passes) | frozenset(config.passes),
        frozenset(server.message_fields) | frozenset(config.message_fields),
        frozenset(server.part_fields) | frozenset(config.part_fields),
        frozenset(server.part_types) | frozenset(config.part_types),
        server.developer_role,
        PictureBounds(
            frozenset(server.image_formats), model.pixel_range[1], server.max_image_side, server.max_image_bytes
        ),
    )
