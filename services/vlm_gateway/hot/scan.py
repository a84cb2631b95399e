"""A chat request read without reading its pictures, and written anew without copying them.

Pictures are nearly all of a body's bytes. They are cut out first, so that what is parsed, checked and changed is small:

    raw       {"model":"a","messages":[... "data:image/jpeg;base64,/9j/4AAQ...130 kB..." ...]}
    skeleton  {"model":"a","messages":[... "data:image/jpeg;base64,<hole 0>" ...]}

and what is sent on is the skeleton, its model's name exchanged, with the picture's own bytes in the holes.
"""

import re
import secrets
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from typing import NamedTuple

import pybase64
from jiter import from_json

from services.vlm_gateway.config import ChatLimits
from services.vlm_gateway.errors import invalid
from services.vlm_gateway.hot.request import Chat, check_chat
from services.vlm_gateway.pictures import CutOut
from services.vlm_gateway.upstream.http_reply import Buffer

_MARKS = (BOM_UTF8, BOM_UTF16_LE, BOM_UTF16_BE)
_MIN_CUT = 256
_MAX_HOLES = 1000
_MAX_PREFIX = 200
# unguessable, so that no client can write a hole into its own request
_TOKEN = secrets.token_hex(16)
_HOLE = re.compile(_TOKEN.encode() + rb"\d{3}")
_HOLE_LENGTH = len(_TOKEN) + 3
_TEMPERATURE_0 = re.compile(rb'"temperature"\s*:\s*-?0(?:\.0*)?\s*[,}]')


class Scanned(NamedTuple):
    """`pictures` are the base64 texts that were cut out of `raw`, in order."""

    raw: bytes
    skeleton: bytes
    pictures: tuple[memoryview, ...]

    @property
    def says_temperature_0(self) -> bool:
        """A first guess, good enough to look an answer up by: what is stored was read properly."""
        return _TEMPERATURE_0.search(self.skeleton) is not None


def scan(raw: bytes) -> Scanned:
    """Takes no offence: whatever does not look like an inline picture stays in the skeleton."""
    view = memoryview(raw)
    pictures: list[memoryview] = []
    parts: list[bytes] = []
    kept = at = 0
    while (start := raw.find(b'"data:image/', at)) >= 0:
        comma, end = raw.find(b",", start, start + _MAX_PREFIX), raw.find(b'"', start + 1)
        if end < 0 or len(pictures) == _MAX_HOLES:
            break
        if 0 < comma < end - _MIN_CUT:
            parts.append(raw[kept : comma + 1])
            parts.append(f"{_TOKEN}{len(pictures):03d}".encode())
            pictures.append(view[comma + 1 : end])
            kept = end
        at = end + 1
    if not pictures:
        return Scanned(raw, raw, ())
    parts.append(raw[kept:])
    return Scanned(raw, b"".join(parts), tuple(pictures))


def read(scanned: Scanned, limits: ChatLimits) -> tuple[Scanned, Chat]:
    """The request checked, every picture's base64 and header included. Raises BadQuestion (`invalid`,
    `no_urls`, `bad_image`)."""
    try:
        decoded = [pybase64.b64decode(picture, validate=True) for picture in scanned.pictures]
    except ValueError:
        # something with quotes or escapes in it: read in full, it is either no picture or refused as a bad one
        scanned, decoded = Scanned(scanned.raw, scanned.raw, ()), []
    try:
        body = from_json(scanned.skeleton, allow_inf_nan=False, catch_duplicate_keys=True)
    except ValueError as error:
        if scanned.raw.startswith(_MARKS) or b"\0" in scanned.raw[:4]:
            raise invalid("body", "JSON in UTF-8 without a byte order mark is wanted") from None
        raise invalid("body", f"not valid JSON: {str(error)[:200]}") from None

    def cut_out(text: str) -> CutOut | None:
        """The picture where `text` is a hole."""
        if not text.startswith(_TOKEN) or len(text) != _HOLE_LENGTH:
            return None
        at = int(text[-3:])
        return CutOut(decoded[at], scanned.pictures[at])

    return scanned, check_chat(body, cut_out, limits)


def filled(skeleton: bytes, pictures: tuple[memoryview, ...]) -> list[Buffer]:
    """The skeleton with the pictures in their holes."""
    parts: list[Buffer] = []
    at = 0
    for hole in _HOLE.finditer(skeleton):
        parts.append(skeleton[at : hole.start()])
        parts.append(pictures[int(hole.group()[-3:])])
        at = hole.end()
    parts.append(skeleton[at:])
    return parts
