"""Pictures as they come in: bounded and looked at, header only, before anybody decodes them."""

from collections.abc import Callable
from typing import NamedTuple

from contracts.images import BadImage, ImageHeader, JpegImage, decode_base64, image_header, jpeg_bytes
from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import Picture
from services.vlm_gateway.config import ChatLimits

TYPES = ("image/jpeg", "image/jpg", "image/pjpeg", "image/png", "image/webp", "image/gif")
_USUAL = frozenset({"image/jpeg;base64", "image/png;base64"})
"""How nearly all clients write the type of a picture's data URL."""
_SHOWN = 60


class CutOut(NamedTuple):
    """A picture that was cut out of a request before it was parsed: its bytes, and the base64 that stood there."""

    data: bytes
    base64: memoryview


CutOuts = Callable[[str], CutOut | None]
"""The picture that a text stands for, or None where it stands for none."""


class ChatPicture(NamedTuple):
    """A picture of a chat: `place` is its message's and its part's index, `url` its data URL with the right type.
    `correct` says that this is the URL the client sent."""

    place: tuple[int, int]
    url: str
    correct: bool
    header: ImageHeader
    size_bytes: int
    base64: memoryview | str


def picture_of(image: JpegImage) -> Picture:
    """A typed question's picture. Raises BadQuestion (`bad_image`)."""
    try:
        data = jpeg_bytes(image)
        header = image_header(data)
    except BadImage as error:
        raise BadQuestion(str(error), code="bad_image") from None
    return Picture(data, header.width, header.height)


def inline_picture(
    url: object, where: str, place: tuple[int, int], cut_outs: CutOuts, limits: ChatLimits
) -> ChatPicture:
    """A picture of a chat: inline JPEG, PNG, WebP or GIF, its header within bounds. What its data is counts, not what
    the URL calls it. `cut_outs` gives the picture where something else stands in the URL for it.

    Raises BadQuestion: `no_urls` for anything that would have to be fetched, `bad_image` for the rest.
    """
    if not isinstance(url, str):
        raise BadQuestion(f"{where}: give the picture as a data: URL", code="bad_image")
    if url[:5].lower() != "data:":
        raise BadQuestion(
            f"{where}: pictures are never fetched from an address; send data:image/jpeg;base64,... (or png, webp, gif)",
            code="no_urls",
        )
    kind, comma, text = url[5:].partition(",")
    if not comma or not (kind in _USUAL or _is_picture(kind)):
        raise BadQuestion(
            f"{where}: only JPEG, PNG, WebP and GIF pictures in base64 are taken, not {url[:_SHOWN]!r}",
            code="bad_image",
        )
    try:
        cut = cut_outs(text)
        data = decode_base64(text, where) if cut is None else cut.data
        header = image_header(data)
    except BadImage as error:
        raise BadQuestion(f"{where}: {error}" if where not in str(error) else str(error), code="bad_image") from None
    _check_size(header, where, limits)
    right = f"data:image/{header.format};base64,{text}"
    return ChatPicture(place, right, right == url, header, len(data), text if cut is None else cut.base64)


def _is_picture(kind: str) -> bool:
    """Whether a data URL's type is a picture's, in base64."""
    mime, *parameters = (part.strip().lower() for part in kind.split(";"))
    return mime in TYPES and "base64" in parameters


def _check_size(header: ImageHeader, where: str, limits: ChatLimits) -> None:
    _, width, height = header
    side = limits.picture_side
    if 0 < width * height <= limits.picture_pixels and width <= side and height <= side:
        return
    raise BadQuestion(
        f"{where}: the picture is {width} x {height}; at most {limits.picture_pixels} pixels and "
        f"{limits.picture_side} a side are taken",
        code="bad_image",
    )
