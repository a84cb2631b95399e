"""Pictures and depth on the wire: RGB as JPEG, depth as uint16 under zstd, both base64 in JSON.

Everything is bounded before it is decoded. numpy and OpenCV are loaded by the functions that work on pixels: who only
passes pictures on starts without them.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

import pybase64
from pydantic import Field

from contracts.base import Wire

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_PIXELS = 4096 * 4096
MAX_PICTURE_BASE64 = 16 * 1024 * 1024
INVALID = 0
NO_RETURN = 65535
DEPTH_METRES_PER_UNIT = 0.002


class BadImage(ValueError):
    """A picture or depth map that is not what it says it is; the message says what was wrong."""


class ImageHeader(NamedTuple):
    """What a picture's first bytes say of it."""

    format: str
    width: int
    height: int


class JpegImage(Wire):
    """An RGB picture as JPEG, base64."""

    jpeg_base64: str = Field(min_length=4, max_length=MAX_PICTURE_BASE64)


class DepthMap(Wire):
    """Depth along the optical axis (planar z): little-endian uint16, row by row, zstd, base64.

    One unit is `metres_per_unit`; 0 means invalid, 65535 nothing was hit within the sensor's reach.
    """

    width: int = Field(ge=1, le=4096)
    height: int = Field(ge=1, le=4096)
    metres_per_unit: float = Field(ge=1e-6, le=1.0)
    zstd_base64: str = Field(min_length=4, max_length=64 * 1024 * 1024)


def image_header(data: bytes) -> ImageHeader:
    """Format ("jpeg", "png", "webp" or "gif"), width and height, read from the header alone. Raises BadImage."""
    if data[:8] == b"\x89PNG\r\n\x1a\n" and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return ImageHeader("png", width, height)
    if data[:2] == b"\xff\xd8":
        at = 2
        while at + 9 <= len(data):
            if data[at] != 0xFF:
                break
            marker = data[at + 1]
            if marker == 0xFF:
                at += 1
                continue
            if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
                height, width = struct.unpack(">HH", data[at + 5 : at + 9])
                return ImageHeader("jpeg", width, height)
            if marker == 0xDA:
                break
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        raise BadImage("the JPEG ends before its frame header")
    if data[:6] in (b"GIF87a", b"GIF89a") and len(data) >= 10:
        width, height = struct.unpack("<HH", data[6:10])
        return ImageHeader("gif", width, height)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP" and len(data) >= 30:
        return _webp_header(data)
    raise BadImage("not a JPEG, PNG, WebP or GIF picture (first bytes: " + data[:8].hex(" ") + ")")


def _webp_header(data: bytes) -> ImageHeader:
    """https://developers.google.com/speed/webp/docs/riff_container. Raises BadImage."""
    chunk = data[12:16]
    if chunk == b"VP8X":
        width, height = int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1
    elif chunk == b"VP8L" and data[20] == 0x2F:
        bits = int.from_bytes(data[21:25], "little")
        width, height = (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    elif chunk == b"VP8 " and data[23:26] == b"\x9d\x01\x2a":
        width, height = (side & 0x3FFF for side in struct.unpack("<HH", data[26:30]))
    else:
        raise BadImage("a WebP picture without a frame header")
    return ImageHeader("webp", width, height)


def decode_base64(text: str, what: str) -> bytes:
    """Strict base64. Raises BadImage."""
    try:
        return pybase64.b64decode(text, validate=True)
    except (ValueError, TypeError) as error:
        raise BadImage(f"{what} is not valid base64: {error}") from None


def encode_jpeg(rgb: NDArray[np.uint8], quality: int = 90) -> JpegImage:
    """rgb: (H, W, 3) uint8."""
    import cv2

    ok, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not ok:
        raise BadImage("the picture could not be encoded as JPEG")
    return JpegImage(jpeg_base64=pybase64.b64encode(data.tobytes()).decode("ascii"))


def jpeg_bytes(image: JpegImage, max_pixels: int = MAX_PIXELS) -> bytes:
    """The JPEG file inside, its header checked. Raises BadImage."""
    data = decode_base64(image.jpeg_base64, "jpeg_base64")
    header = image_header(data)
    if header.format != "jpeg":
        raise BadImage(f"jpeg_base64 holds a {header.format} picture; send a JPEG")
    if not 0 < header.width * header.height <= max_pixels:
        raise BadImage(f"the picture is {header.width} x {header.height}; at most {max_pixels} pixels are read")
    return data


def decode_jpeg(image: JpegImage, max_pixels: int = MAX_PIXELS) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB. Raises BadImage."""
    import cv2
    import numpy as np

    bgr = cv2.imdecode(np.frombuffer(jpeg_bytes(image, max_pixels), np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise BadImage("the JPEG's data could not be decoded")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)


def encode_depth(depth_m: NDArray[np.floating], metres_per_unit: float = DEPTH_METRES_PER_UNIT) -> DepthMap:
    """depth_m: (H, W) metres along the optical axis; inf where nothing was hit, nan where invalid."""
    import numpy as np

    if depth_m.ndim != 2:
        raise BadImage(f"a depth map has two axes, not {depth_m.ndim}")
    units = np.nan_to_num(depth_m / metres_per_unit, nan=0.0, posinf=NO_RETURN, neginf=0.0)
    return encode_depth_units(np.clip(np.rint(units), 0, NO_RETURN).astype(np.uint16), metres_per_unit)


def encode_depth_units(units: NDArray[np.uint16], metres_per_unit: float = DEPTH_METRES_PER_UNIT) -> DepthMap:
    """units: (H, W) uint16, 0 invalid, 65535 no return."""
    import numpy as np
    import zstandard

    packed = zstandard.ZstdCompressor(level=1).compress(np.ascontiguousarray(units, dtype="<u2").data)
    height, width = units.shape
    return DepthMap(
        width=width,
        height=height,
        metres_per_unit=metres_per_unit,
        zstd_base64=pybase64.b64encode(packed).decode("ascii"),
    )


def decode_depth_units(depth: DepthMap) -> NDArray[np.uint16]:
    """(H, W) uint16 in units of `metres_per_unit`. Raises BadImage, before unpacking, where the size does not fit."""
    import numpy as np
    import zstandard

    packed = decode_base64(depth.zstd_base64, "zstd_base64")
    expected = depth.width * depth.height * 2
    try:
        stated = zstandard.frame_content_size(packed)
        if stated != expected:
            raise BadImage(f"the depth data unpacks to {stated} bytes; {depth.width} x {depth.height} needs {expected}")
        data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=expected)
    except zstandard.ZstdError as error:
        raise BadImage(f"the depth data is not a zstd frame: {error}") from None
    if len(data) != expected:
        raise BadImage(f"the depth data unpacks to {len(data)} bytes; {depth.width} x {depth.height} needs {expected}")
    return np.frombuffer(data, dtype="<u2").reshape(depth.height, depth.width)


def decode_depth(depth: DepthMap) -> NDArray[np.float32]:
    """(H, W) float32 metres along the optical axis; inf where nothing was hit, nan where invalid. Raises BadImage."""
    return depth_in_metres(decode_depth_units(depth), depth.metres_per_unit)


def depth_in_metres(units: NDArray[np.uint16], metres_per_unit: float) -> NDArray[np.float32]:
    """float32 metres, of the same shape; inf where nothing was hit, nan where invalid."""
    import numpy as np

    metres = units.astype(np.float32) * np.float32(metres_per_unit)
    metres[units == NO_RETURN] = np.inf
    metres[units == INVALID] = np.nan
    return metres
