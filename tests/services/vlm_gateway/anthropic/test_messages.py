"""Anthropic's messages in front of a chat model, over real HTTP: what is asked, what is answered, streams, errors."""

import json
from typing import Any

import httpx
import pytest

from services.vlm_gateway.anthropic.request import chat_of
from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys, new_key
from tests.conftest import Serve
from tests.services.vlm_gateway.hot.test_streams import chunk, data, writes
from tests.services.vlm_gateway.kit import (
    build,
    chat_backend,
    metric,
    picture_base64,
    post,
    rows,
    sqlite_cache,
    wait_until,
)
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says, status

PATH = "/v1/messages"
END = chunk({}, "stop") + b"data: [DONE]\n\n"
PICTURE = {"type": "image", "source": {"type": "base64", "media_type": "image/jpeg", "data": picture_base64()}}
TOOL = {"name": "product", "description": "of two", "input_schema": {"type": "object", "properties": {}}}


def asks(content: Any = "hi", **more: Any) -> dict[str, Any]:
    return {"model": "m", "max_tokens": 50, "messages": [{"role": "user", "content": content}], **more}


def chat(**asked: Any) -> dict[str, Any]:
    return chat_of(json.dumps(asks(**asked)).encode())


def events_of(body: bytes) -> list[dict[str, Any]]:
    events = [event for event in body.decode().split("\n\n") if event]
    found = [dict(line.split(": ", 1) for line in event.split("\n")) for event in events]
    assert [event["event"] for event in found] == [json.loads(event["data"])["type"] for event in found]
    return [json.loads(event["data"]) for event in found]


def test_a_message_is_asked_as_a_chat_and_answered_as_a_message(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says("the third floor"))
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, PATH, asks("which floor?", system="Be short.", stop_sequences=["\n\n"]))
    assert answer.status_code == 200
    assert answer.json() == {
        "id": "msg_chatcmpl-1",
        "type": "message",
        "role": "assistant",
        "model": "m",
        "content": [{"type": "text", "text": "the third floor"}],
        "stop_reason": "end_turn",
        "stop_sequence": None,
        "usage": {"input_tokens": 100, "output_tokens": 7},
    }
    sent = mock.asked[0].body
    assert sent["messages"] == [
        {"role": "system", "content": "Be short."},
        {"role": "user", "content": "which floor?"},
    ]
    assert (sent["model"], sent["stop"]) == ("maker/model-1", ["\n\n"])
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="prompt") == 100


def test_pictures_tools_and_their_results_become_parts_calls_and_messages_of_tools() -> None:
    result = {"type": "tool_result", "tool_use_id": "t1", "content": [{"type": "text", "text": "42"}, PICTURE]}
    failed = {"type": "tool_result", "tool_use_id": "t2", "content": "no such", "is_error": True}
    thought = {"type": "thinking", "thinking": "hm", "signature": "s"}
    used = {"type": "tool_use", "id": "t1", "name": "product", "input": {"a": 6}}
    asked = {
        "model": "m",
        "max_tokens": 9,
        "system": [
            {"type": "text", "text": "a", "cache_control": {"type": "ephemeral"}},
            {"type": "text", "text": "b"},
        ],
        "messages": [
            {"role": "user", "content": [{"type": "text", "text": "look"}, PICTURE]},
            {"role": "assistant", "content": [thought, {"type": "text", "text": "I ask"}, used]},
            {"role": "user", "content": [result, failed, {"type": "text", "text": "so?"}]},
        ],
        "tools": [TOOL],
        "tool_choice": {"type": "any", "disable_parallel_tool_use": True},
        "metadata": {"user_id": "u"},
    }
    made = chat_of(json.dumps(asked).encode())
    url = {"type": "image_url", "image_url": {"url": "data:image/jpeg;base64," + picture_base64()}}
    call = {"id": "t1", "type": "function", "function": {"name": "product", "arguments": '{"a":6}'}}
    assert made["messages"] == [
        {"role": "system", "content": "a\n\nb"},
        {"role": "user", "content": [{"type": "text", "text": "look"}, url]},
        {"role": "assistant", "content": "I ask", "tool_calls": [call]},
        {"role": "tool", "tool_call_id": "t1", "content": "42"},
        {"role": "tool", "tool_call_id": "t2", "content": "error: no such"},
        {"role": "user", "content": [url, {"type": "text", "text": "so?"}]},
    ]
    function = {"name": "product", "parameters": TOOL["input_schema"], "description": "of two"}
    assert made["tools"] == [{"type": "function", "function": function}]
    assert (made["tool_choice"], made["parallel_tool_calls"]) == ("required", False)
    assert "metadata" not in made


@pytest.mark.parametrize(
    ("choice", "becomes"),
    [("auto", "auto"), ("none", "none"), ("tool", {"type": "function", "function": {"name": "product"}})],
)
def test_the_choice_of_a_tool_is_kept(choice: str, becomes: object) -> None:
    assert chat(tools=[TOOL], tool_choice={"type": choice, "name": "product"})["tool_choice"] == becomes


@pytest.mark.parametrize(
    ("finish_reason", "message", "stop_reason"),
    [
        ("stop", {"content": "x"}, "end_turn"),
        ("length", {"content": "x"}, "max_tokens"),
        ("content_filter", {"content": "x"}, "refusal"),
        ("stop", {"content": None, "refusal": "no"}, "refusal"),
        ("stop", {"content": None, "tool_calls": [{"id": "t", "function": {"name": "f"}}]}, "tool_use"),
    ],
)
def test_why_an_answer_ends_is_said_in_anthropic_s_words(
    serve: Serve, mock: OpenAiMock, finish_reason: str, message: dict[str, Any], stop_reason: str
) -> None:
    content = message.pop("content")
    mock.will(says(content, finish_reason=finish_reason, **message))
    answer = post(serve(build({"m": chat_backend(mock)}).app), PATH, asks())
    assert answer.json()["stop_reason"] == stop_reason


def test_a_tool_s_call_is_a_block_with_its_input(serve: Serve, mock: OpenAiMock) -> None:
    calls = [
        {"id": "t1", "type": "function", "function": {"name": "product", "arguments": '{"a": 6}'}},
        {"id": "t2", "type": "function", "function": {"name": "product", "arguments": "six"}},
    ]
    mock.will(says(None, finish_reason="tool_calls", tool_calls=calls))
    answer = post(serve(build({"m": chat_backend(mock)}).app), PATH, asks(tools=[TOOL])).json()
    assert answer["content"] == [
        {"type": "tool_use", "id": "t1", "name": "product", "input": {"a": 6}},
        {"type": "tool_use", "id": "t2", "name": "product", "input": {"arguments": "six"}},
    ]
    assert answer["stop_reason"] == "tool_use"


def test_a_stream_has_anthropic_s_events_in_their_order(serve: Serve, mock: OpenAiMock) -> None:
    first = {"index": 0, "id": "t1", "type": "function", "function": {"name": "product", "arguments": ""}}
    more = {"index": 0, "function": {"arguments": '{"a": 6}'}}
    other = {"index": 1, "id": "t2", "function": {"name": "product", "arguments": "{}"}}
    usage = data({"choices": [], "usage": {"prompt_tokens": 12, "completion_tokens": 5}})
    mock.will(
        writes(
            chunk({"role": "assistant", "content": ""}, id="c1"),
            chunk({"content": "I "}) + chunk({"content": "ask"}),
            chunk({"tool_calls": [first]}),
            chunk({"tool_calls": [more]}),
            chunk({"tool_calls": [other]}),
            chunk({}, "tool_calls"),
            usage + b"data: [DONE]\n\n",
        )
    )
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, PATH, asks(stream=True, tools=[TOOL]))
    assert answer.headers["content-type"].startswith("text/event-stream")
    start, *rest = events_of(answer.content)
    assert (start["type"], start["message"]["id"], start["message"]["content"]) == ("message_start", "msg_c1", [])
    block = {"type": "tool_use", "name": "product", "input": {}}
    assert rest == [
        {"type": "content_block_start", "index": 0, "content_block": {"type": "text", "text": ""}},
        {"type": "content_block_delta", "index": 0, "delta": {"type": "text_delta", "text": "I "}},
        {"type": "content_block_delta", "index": 0, "delta": {"type": "text_delta", "text": "ask"}},
        {"type": "content_block_stop", "index": 0},
        {"type": "content_block_start", "index": 1, "content_block": {**block, "id": "t1"}},
        {"type": "content_block_delta", "index": 1, "delta": {"type": "input_json_delta", "partial_json": '{"a": 6}'}},
        {"type": "content_block_stop", "index": 1},
        {"type": "content_block_start", "index": 2, "content_block": {**block, "id": "t2"}},
        {"type": "content_block_delta", "index": 2, "delta": {"type": "input_json_delta", "partial_json": "{}"}},
        {"type": "content_block_stop", "index": 2},
        {
            "type": "message_delta",
            "delta": {"stop_reason": "tool_use", "stop_sequence": None},
            "usage": {"input_tokens": 12, "output_tokens": 5},
        },
        {"type": "message_stop"},
    ]
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 5


def test_a_stream_that_breaks_ends_with_anthropic_s_error_event(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(chunk({"content": "the "}), chunk({"content": "third"}), cut=True))
    url = serve(build({"m": chat_backend(mock, retries=0)}).app)
    last = events_of(post(url, PATH, asks(stream=True)).content)[-1]
    assert (last["type"], last["error"]["type"]) == ("error", "overloaded_error")
    assert "broke off" in last["error"]["message"]


def test_a_kept_stream_is_told_again_as_a_message(serve: Serve, mock: OpenAiMock, tmp_path: Any) -> None:
    mock.will(writes(chunk({"content": "the third"}), END))
    path = tmp_path / "answers.sqlite"
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    first = post(url, PATH, asks(stream=True, temperature=0))
    wait_until(lambda: rows(path) == 1)
    again = post(url, PATH, asks(stream=True, temperature=0))
    assert (first.headers["x-cache"], again.headers["x-cache"]) == ("miss", "hit")
    kinds = [event["type"] for event in events_of(again.content)]
    assert kinds == [event["type"] for event in events_of(first.content)]
    assert len(mock.asked) == 1


@pytest.mark.parametrize(
    ("asked", "told", "kind"),
    [
        (asks(model="gpt-9"), 404, "not_found_error"),
        (asks(messages=[]), 400, "invalid_request_error"),
        (asks(temperature=9), 400, "invalid_request_error"),
        (asks(container="c"), 400, "invalid_request_error"),
        (asks([{"type": "image", "source": {"type": "url", "url": "http://1.1.1.1/"}}]), 400, "invalid_request_error"),
        (asks([{"type": "search_result"}]), 400, "invalid_request_error"),
        (asks(tools=[{"type": "web_search_20250305", "name": "w"}]), 400, "invalid_request_error"),
        (asks("x" * 2_000_000), 413, "request_too_large"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_told_in_anthropic_s_shape(
    serve: Serve, mock: OpenAiMock, asked: dict[str, Any], told: int, kind: str
) -> None:
    app = build({"m": chat_backend(mock)}).app
    app.max_body_bytes = 1_000_000
    refused = post(serve(app), PATH, asked)
    assert (refused.status_code, refused.json()["type"], refused.json()["error"]["type"]) == (told, "error", kind)
    assert refused.json()["request_id"] == refused.headers["x-request-id"]
    assert mock.asked == []


def test_what_the_server_refuses_is_told_in_anthropic_s_shape(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock, retries=0)}).app)
    for code, told, kind in (
        (400, 400, "invalid_request_error"),
        (401, 502, "api_error"),
        (429, 429, "rate_limit_error"),
    ):
        mock.will(status(code, retry_after="7"))
        refused = post(url, PATH, asks())
        assert (refused.status_code, refused.json()["error"]["type"]) == (told, kind)
    assert refused.headers["retry-after"] == "7"


def test_a_key_may_come_in_anthropic_s_header(serve: Serve, mock: OpenAiMock) -> None:
    made = new_key()
    url = serve(build({"m": chat_backend(mock)}, keys=Keys({"k": KeyConfig(sha256=made.sha256)})).app)
    assert post(url, PATH, asks()).json()["error"]["type"] == "authentication_error"
    assert post(url, PATH, asks(), headers={"x-api-key": made.key}).status_code == 200
    both = {"x-api-key": made.key, "authorization": "Bearer wrong"}
    assert httpx.post(url + PATH, json=asks(), headers=both).status_code == 401
