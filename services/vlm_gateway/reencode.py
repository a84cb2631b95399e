"""Pictures decoded, scaled and encoded anew, within what a model and its server take."""

import math

import pybase64

from service_kit.errors import BadQuestion
from services.vlm_gateway.backends.base import Picture
from services.vlm_gateway.pictures import ChatPicture
from services.vlm_gateway.upstream.accepted import PictureBounds

QUALITY = 92
_LESS = (QUALITY, 85, 75, 60)


def fresh(picture: Picture, *, max_pixels: int, max_side: int, max_bytes: int) -> Picture:
    """A typed question's picture as a new JPEG of at most `max_pixels`, no side over `max_side` pixels and no more than
    `max_bytes`: nothing but pixels goes on (no EXIF, no trailing data). Raises BadQuestion (`bad_image`) where it can't
    be decoded or made to fit."""
    import cv2  # here, so that a gateway that only passes chats on starts without it
    import numpy as np

    # the picture is taken as its pixels lie: boxes are told in these, whatever EXIF says of its orientation
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), flags)
    if pixels is None or pixels.shape[:2] != (picture.height, picture.width):
        raise BadQuestion("the JPEG's data could not be decoded", code="bad_image")
    scale = scale_to(picture.width, picture.height, max_pixels, max_side)
    if scale < 1.0:
        size = (max(1, int(picture.width * scale)), max(1, int(picture.height * scale)))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    for quality in _LESS:
        ok, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if ok and data.nbytes <= max_bytes:
            return Picture(data.tobytes(), pixels.shape[1], pixels.shape[0])
    raise BadQuestion(f"the picture can't be made smaller than the server's {max_bytes} bytes", code="bad_image")


def scaled_url(picture: ChatPicture, bounds: PictureBounds) -> str:
    """A chat's picture as the data URL of a JPEG within `bounds`: upright, as EXIF says; the first frame of a GIF;
    what is transparent on white. Raises BadQuestion (`bad_image`)."""
    import cv2
    import numpy as np

    form, width, height = picture.header
    scale = scale_to(width, height, bounds.max_pixels, bounds.max_side)
    raw = pybase64.b64decode(picture.base64)
    data = np.frombuffer(raw, np.uint8)
    try:
        pixels = cv2.imdecode(data, _reduced(scale) if form == "jpeg" else cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise BadQuestion(f"the {form} picture's data could not be decoded", code="bad_image")
    if form != "jpeg" and pixels.shape[2:] != (4,) and _has_exif(raw):
        turned = cv2.imdecode(data, cv2.IMREAD_COLOR)  # what is read unchanged is not turned
        pixels = pixels if turned is None else turned
    if pixels.dtype == np.uint16:
        pixels = (pixels // 256).astype(np.uint8)
    if pixels.ndim == 3 and pixels.shape[2] == 4:
        alpha = pixels[:, :, 3:].astype(np.uint16)
        pixels = ((pixels[:, :, :3] * alpha + 255 * (255 - alpha)) // 255).astype(np.uint8)
    left = scale_to(pixels.shape[1], pixels.shape[0], bounds.max_pixels, bounds.max_side)
    if left < 1.0:
        size = (max(1, int(pixels.shape[1] * left)), max(1, int(pixels.shape[0] * left)))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    for quality in _LESS:
        ok, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if ok and encoded.nbytes <= bounds.max_bytes:
            return "data:image/jpeg;base64," + pybase64.b64encode(encoded.tobytes()).decode("ascii")
    raise BadQuestion(f"the picture can't be made smaller than the server's {bounds.max_bytes} bytes", code="bad_image")


def _has_exif(data: bytes) -> bool:
    """Whether a PNG or a WebP picture has such a chunk."""
    return b"eXIf" in data or b"EXIF" in data


def scale_to(width: int, height: int, max_pixels: int, max_side: int) -> float:
    """The factor, at most 1, by which a picture fits."""
    return min(1.0, math.sqrt(max_pixels / (width * height)), max_side / max(width, height))


def _reduced(scale: float) -> int:
    """How a JPEG is decoded that will be scaled: at half, a quarter or an eighth, which takes that much less memory."""
    import cv2

    for factor, flag in (
        (8, cv2.IMREAD_REDUCED_COLOR_8),
        (4, cv2.IMREAD_REDUCED_COLOR_4),
        (2, cv2.IMREAD_REDUCED_COLOR_2),
    ):
        if scale <= 1 / factor:
            return int(flag)
    return int(cv2.IMREAD_COLOR)
