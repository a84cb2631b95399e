"""A chat request read without reading its pictures, and written anew without copying them.

Pictures are nearly all of a body's bytes. They are cut out first, so that what is parsed, checked and changed is small:

    raw       {"model":"a","messages":[... "data:image/jpeg;base64,/9j/4AAQ...130 kB..." ...]}
    skeleton  {"model":"a","messages":[... "data:image/jpeg;base64,<hole 0>" ...]}

and what is sent on is the skeleton, its model's name exchanged, with the picture's own bytes in the holes.
"""

import re
import secrets
from typing import NamedTuple

import pybase64
from jiter import from_json
from pydantic_core import to_json

from services.vlm_gateway.hot.request import DROPPED, PASSED, Chat, check_chat, invalid
from services.vlm_gateway.upstream.client import Wanted
from services.vlm_gateway.upstream.http_reply import Buffer

_MIN_CUT = 256
_MAX_HOLES = 1000
# unguessable, so that no client can write a hole into its own request
_TOKEN = secrets.token_hex(16)
_HOLE = re.compile(_TOKEN.encode() + rb"\d{3}")
_HOLE_LENGTH = len(_TOKEN) + 3
_TEMPERATURE_0 = re.compile(rb'"temperature"\s*:\s*-?0(?:\.0*)?\s*[,}]')
_MODEL = re.compile(rb'"model"\s*:\s*"((?:[^"\\]){1,80})"')
_COUNTED = b'{"stream_options":{"include_usage":true},'
_LIMITS = ("max_tokens", "max_completion_tokens")


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
        comma, end = raw.find(b",", start, start + 40), raw.find(b'"', start + 1)
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


def read(scanned: Scanned) -> tuple[Scanned, Chat]:
    """The request checked, every picture's base64 and header included. Raises BadQuestion (`invalid`,
    `unknown_field`, `no_urls`, `bad_image`)."""
    try:
        decoded = [pybase64.b64decode(picture, validate=True) for picture in scanned.pictures]
    except ValueError:
        # something with quotes or escapes in it: read in full, it is either no picture or refused as a bad one
        scanned, decoded = Scanned(scanned.raw, scanned.raw, ()), []
    try:
        body = from_json(scanned.skeleton, allow_inf_nan=False, catch_duplicate_keys=True)
    except ValueError as error:
        raise invalid("body", f"not valid JSON: {str(error)[:200]}") from None

    def cut_out(text: str) -> bytes | None:
        """The picture's bytes where `text` is a hole."""
        if not text.startswith(_TOKEN) or len(text) != _HOLE_LENGTH:
            return None
        return decoded[int(text[-3:])]

    return scanned, check_chat(body, cut_out)


def rewritten(scanned: Scanned, chat: Chat, wanted: Wanted) -> list[Buffer]:
    """The body to send on, in pieces; the pictures are those of `raw` itself."""
    body = chat.body
    counts = chat.stream and wanted.counts_streams and not chat.wants_usage
    limits = [name for name in _LIMITS if body.get(name) is not None]
    as_it_is = (
        DROPPED.isdisjoint(body)
        and not (wanted.extra and wanted.extra.keys() - body.keys())
        and limits in ([], [wanted.limit_field])
        # \u00 may spell a letter of a key: then the one "model" seen below may be another than the one that was read
        and b"\\u00" not in scanned.skeleton
        and None not in body.values()
        and not (counts and "stream_options" in body)
    )
    found = _MODEL.search(scanned.skeleton) if as_it_is else None
    if found is not None and scanned.skeleton.count(b'"model"') == 1 and chat.alias is not None:
        start, end = found.start(1) - 1, found.end(1) + 1
        if wanted.model_json == scanned.skeleton[start:end] and not counts:
            return [scanned.raw]
        skeleton = scanned.skeleton[:start] + wanted.model_json + scanned.skeleton[end:]
        if counts:
            skeleton = skeleton.replace(b"{", _COUNTED, 1)
    else:
        skeleton = _composed(chat, wanted, counts)
    return _filled(skeleton, scanned.pictures)


def _composed(chat: Chat, wanted: Wanted, counts: bool) -> bytes:
    """The skeleton written anew, for requests that take more than another model's name."""
    body = {
        **wanted.extra,
        **{name: value for name, value in chat.body.items() if name in PASSED and value is not None},
    }
    limit = next((body.pop(name) for name in _LIMITS if name in chat.body and name in body), None)
    for name in _LIMITS:
        body.pop(name, None)
    if limit is not None:
        body[wanted.limit_field] = limit
    if chat.stream:
        body["stream"] = True
    if counts:
        body["stream_options"] = {**(body.get("stream_options") or {}), "include_usage": True}
    return b'{"model":' + wanted.model_json + b"," + to_json(body)[1:]


def _filled(skeleton: bytes, pictures: tuple[memoryview, ...]) -> list[Buffer]:
    """The skeleton with the pictures in their holes."""
    if not pictures:
        return [skeleton]
    parts: list[Buffer] = []
    at = 0
    for hole in _HOLE.finditer(skeleton):
        parts.append(skeleton[at : hole.start()])
        parts.append(pictures[int(hole.group()[-3:])])
        at = hole.end()
    parts.append(skeleton[at:])
    return parts
