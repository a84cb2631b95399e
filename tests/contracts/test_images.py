"""Pictures and depth survive the wire, and what is too large or not what it says is refused before decoding."""

import struct
import zlib

import cv2
import numpy as np
import pybase64
import pytest
import zstandard
from pydantic import ValidationError

from contracts import images
from contracts.images import BadImage, DepthMap, JpegImage, decode_depth, decode_jpeg, encode_depth, encode_jpeg


def test_depth_survives_to_half_a_unit_with_its_two_special_values() -> None:
    depth = np.array([[0.5, 12.3456, np.inf], [np.nan, 60.0, 130.9]], dtype=np.float32)
    back = decode_depth(encode_depth(depth))
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, depth, atol=0.001)
    assert np.isinf(back[0, 2])
    assert np.isnan(back[1, 0])


def test_a_picture_keeps_its_colours_in_order() -> None:
    rgb = np.zeros((64, 48, 3), np.uint8)
    rgb[..., 0] = 200
    back = decode_jpeg(encode_jpeg(rgb))
    assert back.shape == (64, 48, 3)
    assert back[30, 20, 0] > 180
    assert back[30, 20, 2] < 20


@pytest.mark.parametrize(("extension", "name"), [(".jpg", "jpeg"), (".png", "png")])
def test_a_header_tells_format_and_size_without_decoding(extension: str, name: str) -> None:
    _, data = cv2.imencode(extension, np.zeros((31, 77, 3), np.uint8))
    assert images.image_header(data.tobytes()) == (name, 77, 31)


def test_a_header_is_found_behind_a_long_comment() -> None:
    _, data = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))
    jpeg = data.tobytes()
    comment = b"\xff\xfe" + struct.pack(">H", 5002) + b"x" * 5000
    assert images.image_header(jpeg[:2] + comment + jpeg[2:]) == ("jpeg", 8, 8)


def png_bomb(width: int, height: int) -> bytes:
    """A PNG file of a few bytes that states a huge size."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunk = b"IHDR" + head
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))


def jpeg_of(data: bytes) -> JpegImage:
    return JpegImage(jpeg_base64=pybase64.b64encode(data).decode())


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (jpeg_of(png_bomb(50_000, 50_000)), "send a JPEG"),
        (jpeg_of(b"GIF89a..."), "not a JPEG"),
        (jpeg_of(b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xff\xff\xff\x03" + b"\0" * 16), "at most"),
        (jpeg_of(b"\xff\xd8\xff\xc0\x00\x11\x08\x00\x40\x00\x40\x03" + b"\0" * 16), "could not be decoded"),
        (jpeg_of(b"\xff\xd8\xff"), "ends before"),
        (JpegImage(jpeg_base64="@@@@"), "base64"),
    ],
)
def test_a_bad_picture_is_refused_with_the_reason(image: JpegImage, reason: str) -> None:
    with pytest.raises(BadImage, match=reason):
        decode_jpeg(image)


def depth_of(data: bytes, width: int = 4, height: int = 4) -> DepthMap:
    packed = pybase64.b64encode(data).decode()
    return DepthMap(width=width, height=height, metres_per_unit=0.002, zstd_base64=packed)


@pytest.mark.parametrize(
    ("depth", "reason"),
    [
        (depth_of(zstandard.compress(b"\0" * 30)), "needs 32"),
        (depth_of(zstandard.compress(b"\0" * 50_000_000)), "50000000 bytes"),
        (depth_of(b"not zstd at all"), "zstd"),
        (depth_of(zstandard.compress(bytes(range(32)))[:-3]), "zstd"),
    ],
)
def test_a_bad_depth_map_is_refused_before_it_is_unpacked(depth: DepthMap, reason: str) -> None:
    with pytest.raises(BadImage, match=reason):
        decode_depth(depth)


def test_a_depth_map_with_a_scale_that_is_no_number_is_refused() -> None:
    body = '{"width": 4, "height": 4, "metres_per_unit": NaN, "zstd_base64": "AAAA"}'
    with pytest.raises(ValidationError):
        DepthMap.model_validate_json(body)
