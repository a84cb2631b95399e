"""Chats that do not come as OpenAI's do, told as Anthropic's messages over real HTTP, and odd requests for messages."""

import json
from typing import Any

import pytest

from tests.conftest import Serve
from tests.services.vlm_gateway.anthropic.test_messages import END, PATH, asks, events_of
from tests.services.vlm_gateway.hot.test_streams import chunk, writes
from tests.services.vlm_gateway.kit import build, chat_backend, post
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says

CALL = {"id": "t1", "type": "function", "function": {"name": "f", "arguments": {"a": 6}}}
ODD = [
    b"data: {broken\n\n",
    b"data: 5\n\ndata: null\n\ndata: [1]\n\n",
    b'data: {"choices": [null]}\n\ndata: {"choices": {}}\n\ndata: {"choices": [{"delta": 5}]}\n\n',
    b'data: {"choices": [{"delta": {"tool_calls": 5}}]}\n\ndata: {"choices": [{"delta": {"tool_calls": [7]}}]}\n\n',
    b": a comment\n\nretry: 5\n\n",
]


def texts(events: list[dict[str, Any]]) -> str:
    return "".join(event["delta"].get("text", "") for event in events if event["type"] == "content_block_delta")


@pytest.mark.parametrize("odd", ODD)
def test_events_that_say_nothing_of_a_chat_are_left_out(serve: Serve, mock: OpenAiMock, odd: bytes) -> None:
    mock.will(writes(odd, b"\xef\xbb\xbf" + chunk({"content": "one "}), odd + chunk({"content": "two"}), END))
    events = events_of(post(serve(build({"m": chat_backend(mock)}).app), PATH, asks(stream=True)).content)
    assert (events[0]["type"], events[-1]["type"], texts(events)) == ("message_start", "message_stop", "one two")


def test_words_in_parts_and_cut_characters_are_told(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    parts = [{"type": "text", "text": "in "}, {"type": "text", "text": "parts"}, {"type": "reference"}]
    mock.will(writes(chunk({"content": parts}), chunk({"content": " \ud83d"}), END))
    assert texts(events_of(post(url, PATH, asks(stream=True)).content)) == "in parts ?"
    mock.will(says(parts))
    assert post(url, PATH, asks()).json()["content"] == [{"type": "text", "text": "in parts"}]


def test_a_tool_s_input_may_come_as_an_object(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    mock.will(says(None, finish_reason="tool_calls", tool_calls=[CALL, None, 5]))
    block = {"type": "tool_use", "id": "t1", "name": "f", "input": {"a": 6}}
    assert post(url, PATH, asks()).json()["content"] == [block]
    mock.will(writes(chunk({"tool_calls": [CALL]}), chunk({}, "tool_calls")))
    deltas = [event["delta"] for event in events_of(post(url, PATH, asks(stream=True)).content) if "delta" in event]
    assert json.loads(deltas[0]["partial_json"]) == {"a": 6}


def test_calls_of_one_index_are_told_apart_by_their_ids(serve: Serve, mock: OpenAiMock) -> None:
    calls = [{"index": 0, "id": name, "function": {"name": "f", "arguments": "{}"}} for name in ("t1", "t2")]
    more = {"index": 0, "function": {"arguments": " "}}
    mock.will(writes(*[chunk({"tool_calls": [call]}) for call in (*calls, more)], chunk({}, "tool_calls")))
    events = events_of(post(serve(build({"m": chat_backend(mock)}).app), PATH, asks(stream=True)).content)
    begun = [event["content_block"]["id"] for event in events if event["type"] == "content_block_start"]
    told = [
        (event["index"], event["delta"]["partial_json"]) for event in events if "index" in event and "delta" in event
    ]
    assert (begun, told) == (["t1", "t2"], [(0, "{}"), (1, "{}"), (1, " ")])


@pytest.mark.parametrize(
    "block",
    [
        {"type": "tool_result", "tool_use_id": "t", "content": 5},
        {"type": "tool_result", "tool_use_id": "t", "content": {"a": 1}},
        {"type": "tool_result", "content": "of nothing"},
        {"type": "image", "source": 5},
        5,
    ],
)
def test_a_block_that_is_none_is_refused_with_its_place(serve: Serve, mock: OpenAiMock, block: object) -> None:
    refused = post(serve(build({"m": chat_backend(mock)}).app), PATH, asks([block]))
    assert (refused.status_code, refused.json()["error"]["type"]) == (400, "invalid_request_error")
    assert "messages.0.content.0" in refused.json()["error"]["message"]
    assert mock.asked == []


def test_what_only_concerns_anthropic_s_servers_is_taken_and_dropped(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    asked = asks(system=[], context_management={"edits": []}, cache_control={"type": "ephemeral"})
    assert post(url, PATH, asked).status_code == 200
    assert mock.asked[0].body["messages"] == [{"role": "user", "content": "hi"}]
