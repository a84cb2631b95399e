"""Pictures of typed questions, decoded and encoded anew before a model's server sees them: nothing but pixels goes on
(no EXIF, no rotation that one server applies and the next does not, no trailing data), within the server's limits."""

import math

from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import Picture

QUALITY = 92
_LESS = (QUALITY, 85, 75, 60)


def fresh(picture: Picture, *, max_pixels: int, max_side: int, max_bytes: int) -> Picture:
    """The same picture as a new JPEG of at most `max_pixels`, no side over `max_side` pixels and no more than
    `max_bytes`. Raises BadQuestion (`bad_image`) where it can't be decoded or made to fit."""
    import cv2  # here, so that a gateway that only passes chats on starts without it
    import numpy as np

    # the picture is taken as its pixels lie: boxes are told in these, whatever EXIF says of its orientation
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), flags)
    if pixels is None or pixels.shape[:2] != (picture.height, picture.width):
        raise BadQuestion("the JPEG's data could not be decoded", code="bad_image")
    scale = min(
        1.0, math.sqrt(max_pixels / (picture.width * picture.height)), max_side / max(picture.width, picture.height)
    )
    if scale < 1.0:
        width, height = max(1, int(picture.width * scale)), max(1, int(picture.height * scale))
        pixels = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    for quality in _LESS:
        ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if ok and data.nbytes <= max_bytes:
            return Picture(data.tobytes(), pixels.shape[1], pixels.shape[0])
    raise BadQuestion(f"the picture can't be made smaller than the server's {max_bytes} bytes", code="bad_image")
