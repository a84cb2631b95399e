"""Pictures as they come in: bounded and looked at, header only, before anybody decodes them."""

from collections.abc import Callable

from contracts.images import MAX_PIXELS, BadImage, JpegImage, decode_base64, image_header, jpeg_bytes
from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import Picture

_PREFIXES = ("data:image/jpeg;base64,", "data:image/jpg;base64,", "data:image/png;base64,")
_SHOWN = 60


def picture_of(image: JpegImage) -> Picture:
    """A typed question's picture. Raises BadQuestion (`bad_image`)."""
    try:
        data = jpeg_bytes(image)
        header = image_header(data)
    except BadImage as error:
        raise BadQuestion(str(error), code="bad_image") from None
    return Picture(data, header.width, header.height)


def check_data_url(url: object, where: str, cut_out: Callable[[str], bytes | None] = lambda _: None) -> int:
    """A pass-through picture: an inline JPEG or PNG whose header agrees and is within bounds. Returns its pixels.
    `cut_out` gives the picture's bytes where something else stands in the URL for them.

    Raises BadQuestion: `no_urls` for anything that would have to be fetched, `bad_image` for the rest.
    """
    if not isinstance(url, str):
        raise BadQuestion(f"{where}: give the picture as a data: URL", code="bad_image")
    if not url.startswith("data:"):
        raise BadQuestion(
            f"{where}: pictures are never fetched from an address; send data:image/jpeg;base64,... or "
            "data:image/png;base64,...",
            code="no_urls",
        )
    prefix = next((prefix for prefix in _PREFIXES if url.startswith(prefix)), None)
    if prefix is None:
        raise BadQuestion(
            f"{where}: only inline JPEG and PNG pictures are taken, not {url[:_SHOWN]!r}", code="bad_image"
        )
    try:
        data = url[len(prefix) :]
        header = image_header(cut_out(data) or decode_base64(data, where))
    except BadImage as error:
        raise BadQuestion(f"{where}: {error}" if where not in str(error) else str(error), code="bad_image") from None
    pixels = header.width * header.height
    if not 0 < pixels <= MAX_PIXELS:
        message = f"{where}: the picture is {header.width} x {header.height}; at most {MAX_PIXELS} pixels are taken"
        raise BadQuestion(message, code="bad_image")
    if (header.format == "png") != (prefix == _PREFIXES[2]):
        raise BadQuestion(f"{where}: the data is a {header.format} picture, its type says otherwise", code="bad_image")
    return pixels
