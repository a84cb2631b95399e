"""A chat request in a target's words: its model's name, its name for the length limit, what it takes of messages."""

import re
from collections.abc import Mapping
from typing import Any

from pydantic_core import to_json

from services.vlm_gateway.hot.request import DROPPED, PASSED, Chat
from services.vlm_gateway.hot.scan import Scanned, filled
from services.vlm_gateway.upstream.accepted import ALL, STANDARD_IMAGE, STANDARD_MESSAGE, STANDARD_PART, Accepted
from services.vlm_gateway.upstream.http_reply import Buffer

_MODEL = re.compile(rb'"model"\s*:\s*"((?:[^"\\]){1,128})"')
_LIMITS = ("max_tokens", "max_completion_tokens")
NONE_SCALED: Mapping[int, str] = {}
_COUNTED = b'{"stream_options":{"include_usage":true},'


def rewritten(scanned: Scanned, chat: Chat, accepts: Accepted, scaled: Mapping[int, str] = NONE_SCALED) -> list[Buffer]:
    """The body to send on, in pieces; the pictures are those of `raw` itself, but for the `scaled` ones: data URLs by
    their place among the chat's pictures."""
    body = chat.body
    counts = chat.stream and accepts.counts_streams and not chat.wants_usage
    limits = [name for name in _LIMITS if body.get(name) is not None]
    as_it_is = (
        chat.plain
        and not scaled
        and DROPPED.isdisjoint(body)
        and not (accepts.extra and accepts.extra.keys() - body.keys())
        and limits in ([], [accepts.limit_field])
        # \u00 may spell a letter of a key: then the one "model" seen below may be another than the one that was read
        and b"\\u00" not in scanned.skeleton
        and None not in body.values()
        and not (counts and "stream_options" in body)
    )
    found = _MODEL.search(scanned.skeleton) if as_it_is else None
    if found is not None and scanned.skeleton.count(b'"model"') == 1 and chat.alias is not None:
        start, end = found.start(1) - 1, found.end(1) + 1
        if accepts.model_json == scanned.skeleton[start:end] and not counts:
            return [scanned.raw]
        skeleton = scanned.skeleton[:start] + accepts.model_json + scanned.skeleton[end:]
        if counts:
            skeleton = skeleton.replace(b"{", _COUNTED, 1)
    else:
        skeleton = _composed(chat, accepts, counts, scaled)
    return filled(skeleton, scanned.pictures) if scanned.pictures else [skeleton]


def _composed(chat: Chat, accepts: Accepted, counts: bool, scaled: Mapping[int, str]) -> bytes:
    """The skeleton written anew, for requests that take more than another model's name."""
    passed = PASSED | (accepts.fields & chat.further)
    body = {
        **accepts.extra,
        **{name: value for name, value in chat.body.items() if name in passed and value is not None},
    }
    if not chat.plain or scaled:
        body["messages"] = _messages(chat, accepts, scaled)
    limit = next((body.pop(name) for name in _LIMITS if name in chat.body and name in body), None)
    for name in _LIMITS:
        body.pop(name, None)
    if limit is not None:
        body[accepts.limit_field] = limit
    if chat.stream:
        body["stream"] = True
    if counts:
        body["stream_options"] = {**(body.get("stream_options") or {}), "include_usage": True}
    return b'{"model":' + accepts.model_json + b"," + to_json(body)[1:]


def _messages(chat: Chat, accepts: Accepted, scaled: Mapping[int, str]) -> list[dict[str, Any]]:
    """The messages with what this target takes of them, and with their pictures' addresses put right."""
    urls = {picture.place: scaled.get(at, picture.url) for at, picture in enumerate(chat.pictures)}
    messages = []
    for at, message in enumerate(chat.body["messages"]):
        kept = _kept(message, STANDARD_MESSAGE, accepts.message_fields)
        if kept["role"] == "developer" and not accepts.developer:
            kept["role"] = "system"
        if isinstance(kept.get("content"), list):
            known = [(index, part) for index, part in enumerate(kept["content"]) if _known(part, accepts)]
            kept["content"] = [_part(part, urls.get((at, index)), accepts) for index, part in known]
        messages.append(kept)
    return messages


def _known(part: Mapping[str, Any], accepts: Accepted) -> bool:
    """False for what an assistant thought, where the server takes no such parts; others were refused before."""
    kind = part["type"]
    return kind in ("text", "image_url") or kind in accepts.part_types or ALL in accepts.part_types


def _part(part: Mapping[str, Any], url: str | None, accepts: Accepted) -> dict[str, Any]:
    if part["type"] not in ("text", "image_url"):
        return dict(part)
    kept = _kept(part, STANDARD_PART, accepts.part_fields)
    if url is not None:
        image = part["image_url"]
        details = {"url": image} if isinstance(image, str) else image
        kept["image_url"] = {**_kept(details, STANDARD_IMAGE, accepts.part_fields), "url": url}
    return kept


def _kept(fields: Mapping[str, Any], standard: frozenset[str], further: frozenset[str]) -> dict[str, Any]:
    """The standard fields, and the further ones that say something."""
    every = ALL in further
    return {
        name: value
        for name, value in fields.items()
        if name in standard or (value is not None and (every or name in further))
    }
