"""What is cut out of a request, what is sent on instead, and that nobody smuggles anything past the checks."""

import json
from typing import Any

import pytest

from service_kit.errors import BadQuestion
from services.vlm_gateway.config import NO_LIMITS_SET
from services.vlm_gateway.hot.rewriting import rewritten
from services.vlm_gateway.hot.scan import read, scan
from services.vlm_gateway.upstream.accepted import Accepted, accepted
from tests.services.vlm_gateway.kit import chat_settings, picture_base64


def taken(model: str = "maker/model", **settings: Any) -> Accepted:
    """What a server of which nothing is known takes."""
    settings = {"preset": "generic-vision", "counts_streams": False, **settings}
    return accepted(chat_settings(None, **settings), json.dumps(model).encode())


WANTED = taken()
URL = "data:image/jpeg;base64," + picture_base64(400, 300)


def body(url: str = URL, **more: Any) -> dict[str, Any]:
    parts = [{"type": "text", "text": 'say "model": {x}'}, {"type": "image_url", "image_url": {"url": url}}]
    return {"messages": [{"role": "user", "content": parts * 2}], "model": "m", "temperature": 0, **more}


def sent(raw: bytes, wanted: Accepted = WANTED) -> bytes:
    scanned, chat = read(scan(raw), NO_LIMITS_SET)
    return b"".join(bytes(piece) for piece in rewritten(scanned, chat, wanted))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-32-be"])
def test_a_body_that_is_not_plain_utf_8_is_told_so(encoding: str) -> None:
    with pytest.raises(BadQuestion, match="JSON in UTF-8 without a byte order mark is wanted"):
        sent(json.dumps(body()).encode(encoding))


def test_only_the_model_s_name_differs_in_what_is_sent_on() -> None:
    for form in ({}, {"separators": (",", ":")}, {"indent": 2}, {"ensure_ascii": False}):
        raw = json.dumps(body(), **form).encode()
        assert len(scan(raw).skeleton) < len(raw) / 2
        assert sent(raw) == raw.replace(b'"m"', b'"maker/model"')


@pytest.mark.parametrize(
    "more",
    [
        {"user": "é"},
        {"max_completion_tokens": 5},
        {"tools": [{"type": "function", "function": {"name": "f", "parameters": {"model": "m"}}}]},
        {"seed": None},
        {"stream": True},
    ],
)
def test_what_takes_more_than_a_name_says_the_same_afterwards(more: dict[str, Any]) -> None:
    asked = body(**more)
    expected = {k: v for k, v in asked.items() if k != "user" and v is not None} | {"model": "maker/model"}
    if "max_completion_tokens" in expected:
        expected["max_tokens"] = expected.pop("max_completion_tokens")
    assert json.loads(sent(json.dumps(asked).encode())) == expected


def test_settings_are_added_and_do_not_override_the_caller_s() -> None:
    wanted = taken("x", extra={"top_k": 3, "temperature": 1})
    said = json.loads(sent(json.dumps(body()).encode(), wanted))
    assert (said["top_k"], said["temperature"]) == (3, 0)


SMUGGLED = [
    b'{"model":"m","model":"evil","messages":[{"role":"user","content":"x"}]}',
    b'{"model":"m","mod\\u0065l":"evil","messages":[{"role":"user","content":"x"}]}',
    b'{"model":"m","messages":[{"role":"user","content":"x","content":"y"}]}',
    b'{"model":"m","messages":[{"role":"user","content":[{"type":"image_url","image_url":'
    b'{"url":"http://evil/","url":"' + URL.encode() + b'"}}]}]}',
    b'{"model":"m","messages":[{"role":"user","content":"x"}],"temperature":NaN}',
    b'{"model":"m","messages":[{"role":"user","content":[{"type":"image_url","image_url":{"url":"'
    + URL.encode()[:600]
    + b'\\" , '
    + URL.encode()[600:]
    + b'"}}]}]}',
]


@pytest.mark.parametrize("raw", SMUGGLED)
def test_what_two_readers_might_read_differently_is_refused(raw: bytes) -> None:
    with pytest.raises(BadQuestion):
        sent(raw)


def test_a_name_spelled_with_escapes_is_the_one_that_is_exchanged() -> None:
    raw = b'{"mod\\u0065l":"m","messages":[{"role":"user","content":"x"}],"tools":[{"model":"m"}]}'
    said = json.loads(sent(raw))
    assert (said["model"], said["tools"]) == ("maker/model", [{"model": "m"}])


def test_a_text_that_only_looks_like_a_picture_stays_a_text() -> None:
    text = "data:image/png;base64, " + "not a picture, " * 40
    raw = json.dumps({"model": "m", "messages": [{"role": "user", "content": text}]}).encode()
    assert json.loads(sent(raw))["messages"][0]["content"] == text
