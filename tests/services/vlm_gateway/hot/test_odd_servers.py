"""Servers that do not write as OpenAI's does, over real HTTP: what is understood all the same, and what it costs."""

import asyncio
import json
import time
from typing import Any

import httpx
import pytest
from aiohttp import web

from tests.conftest import Serve
from tests.services.vlm_gateway.hot.test_streams import END, ERROR, PATH, chat, chunk, data, writes
from tests.services.vlm_gateway.kit import build, chat_backend, metric, post
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, completion, sends

BOM = b"\xef\xbb\xbf"
ZEROS = {"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0}


def typed(kind: str | None, body: bytes) -> Behaviour:
    """These bytes under this content type, or without one."""

    async def behave(request: web.Request, _: dict[str, Any]) -> web.StreamResponse:
        response = web.StreamResponse()
        if kind is not None:
            response.headers["Content-Type"] = kind
        await response.prepare(request)
        await response.write(body)
        return response

    return behave


@pytest.mark.parametrize("kind", ["Text/Event-Stream; charset=UTF-8", "text/plain", "application/octet-stream"])
def test_a_stream_is_one_whatever_its_server_calls_it(serve: Serve, mock: OpenAiMock, kind: str) -> None:
    mock.will(typed(kind, chunk({"content": "one"}) + END))
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, PATH, chat())
    assert (answer.status_code, answer.headers["content-type"][:17]) == (200, "text/event-stream")
    assert "one" in answer.text


def test_a_whole_reply_with_a_byte_order_mark_is_understood(serve: Serve, mock: OpenAiMock) -> None:
    body = BOM + json.dumps(completion("hello")).encode()
    mock.will(typed("application/json", body))
    answer = post(serve(build({"m": chat_backend(mock)}).app), PATH, {**chat(), "stream": False})
    assert (answer.status_code, answer.content) == (200, body)


def test_an_error_that_is_no_event_ends_a_stream_with_its_status(serve: Serve, mock: OpenAiMock) -> None:
    bare = json.dumps({"error": {**ERROR, "code": 429}}, indent=1).encode()
    url = serve(build({"m": chat_backend(mock, retries=0)}).app)
    mock.will(writes(chunk({"role": "assistant"}), bare))
    assert post(url, PATH, chat()).status_code == 429
    mock.will(writes(chunk({"content": "one"}), bare + b"\n\n"))
    told = post(url, PATH, chat()).text
    assert '"rate_limit_exceeded"' in told
    assert "[DONE]" not in told


@pytest.mark.parametrize("beat", [b"\n", b"retry: 100\n\n", b"id: 7\n\n"])
def test_what_holds_no_data_keeps_no_stream_alive(serve: Serve, mock: OpenAiMock, beat: bytes) -> None:
    mock.will(writes(chunk({"content": "one"}), *[beat] * 40, pause_s=0.1))
    url = serve(build({"m": chat_backend(mock, timeout_s=0.6)}).app)
    began = time.monotonic()
    assert '"model_timeout"' in post(url, PATH, chat()).text
    assert time.monotonic() - began < 3


def test_a_count_that_is_no_count_makes_no_stream_free(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    mock.will(writes(*[chunk({"content": "word "}, usage=ZEROS) for _ in range(5)], END))
    post(url, PATH, chat())
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 5
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="prompt") > 0


def test_what_comes_after_a_server_s_last_count_is_charged_too(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    first = chunk({"role": "assistant"}, usage={"prompt_tokens": 9, "completion_tokens": 0})
    second = chunk({"content": "word "}, usage={"prompt_tokens": 9, "completion_tokens": 3})
    mock.will(writes(first, second, *[chunk({"content": "word "}) for _ in range(4)], END))
    post(url, PATH, chat())
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 3 + 4
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="prompt") == 9


@pytest.mark.parametrize("count", [None, {}, ZEROS], ids=["null", "empty", "zeros"])
def test_an_answer_that_its_server_did_not_count_is_charged_by_its_length(
    serve: Serve, mock: OpenAiMock, count: object
) -> None:
    mock.will(sends(json.dumps({**completion("word " * 80), "usage": count}).encode()))
    url = serve(build({"m": chat_backend(mock)}).app)
    post(url, PATH, chat(stream=False))
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 100
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="prompt") > 0


def test_half_a_character_at_an_answer_s_end_is_passed_on_as_it_came(serve: Serve, mock: OpenAiMock) -> None:
    body = json.dumps(completion("cut \ud83d")).encode()
    mock.will(sends(body))
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, PATH, chat(stream=False))
    assert (answer.status_code, answer.content) == (200, body)
    mock.will(writes(chunk({"content": "\ud83d"}), END))
    assert "\\ud83d" in post(url, PATH, chat()).text
    assert metric(url, "vlm_gateway_calls_total", model="m", outcome="answered") == 2


def test_a_byte_order_mark_before_a_stream_hides_no_count(serve: Serve, mock: OpenAiMock) -> None:
    counted = chunk({"content": "one"}, usage={"prompt_tokens": 9, "completion_tokens": 3})
    mock.will(writes(BOM + counted, END))
    url = serve(build({"m": chat_backend(mock)}).app)
    told = post(url, PATH, chat()).text
    assert "usage" not in told
    assert told.count("one") == 1
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 3


@pytest.mark.parametrize(
    "part",
    [
        {"type": "video_url", "video_url": "http://127.0.0.1/v.mp4"},
        {"type": "file", "file": {"source": {"file_url": "ftp://127.0.0.1/f"}}},
        {"type": "audio_url", "audio_url": [{"url": "http://127.0.0.1/a"}]},
    ],
)
def test_no_part_makes_a_server_fetch_an_address(serve: Serve, mock: OpenAiMock, part: dict[str, Any]) -> None:
    url = serve(build({"m": chat_backend(mock, part_types=["*"])}).app)
    refused = post(url, PATH, chat(messages=[{"role": "user", "content": [part]}]))
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "no_urls")
    assert mock.asked == []


def test_what_an_assistant_cited_is_no_address_to_fetch(serve: Serve, mock: OpenAiMock) -> None:
    cited = {"type": "output_text", "text": "x", "annotations": [{"type": "url_citation", "url": "http://a/"}]}
    url = serve(build({"m": chat_backend(mock, part_types=["*"])}).app)
    messages = [{"role": "assistant", "content": [cited]}, {"role": "user", "content": "go on"}]
    assert post(url, PATH, chat(stream=False, messages=messages)).status_code == 200


async def test_data_after_an_odd_event_still_counts_as_life(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(chunk({"content": "one"}), *[data({"ping": 1})] * 10, END, pause_s=0.1))
    url = serve(build({"m": chat_backend(mock, timeout_s=0.6)}).app)
    assert "[DONE]" in (await asyncio.to_thread(post, url, PATH, chat())).text


def test_stream_options_that_are_no_object_are_refused(serve: Serve, mock: OpenAiMock) -> None:
    refused = post(serve(build({"m": chat_backend(mock)}).app), PATH, chat(stream_options=5))
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "invalid")


def test_a_count_that_can_t_be_one_is_none_and_stops_no_account(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    for count in (10**30, -5, 0.5, True):
        usage = {"prompt_tokens": count, "completion_tokens": count}
        mock.will(sends(json.dumps(completion("hello") | {"usage": usage}).encode()))
        assert post(url, PATH, chat(stream=False)).status_code == 200
    mock.will(sends(json.dumps(completion("hello") | {"usage": {"prompt_tokens": 30.0}}).encode()))
    assert post(url, PATH, chat(stream=False)).status_code == 200
    (owner,) = httpx.get(url + "/v1/usage", timeout=60).json()["owners"]
    (used,) = owner["today"]
    assert used["calls"] == 5
    assert 30 < used["prompt_tokens"] < 200
