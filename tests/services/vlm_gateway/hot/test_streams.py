"""Streams that fail, over real HTTP: who is asked next, what the caller sees, what is kept, counted and charged."""

import asyncio
import json
import socket
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from aiohttp import web

from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys
from tests.conftest import Serve
from tests.services.vlm_gateway.hot.test_frontend import key
from tests.services.vlm_gateway.kit import build, chat_backend, metric, post, rows, sqlite_cache, wait_until
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, says, status, streams

PATH = "/v1/chat/completions"
USAGE = {"prompt_tokens": 1000, "completion_tokens": 50, "total_tokens": 1050}
COMMENT = b": OPENROUTER PROCESSING\n\n"


def chat(**changes: Any) -> dict[str, Any]:
    return {"model": "m", "messages": [{"role": "user", "content": "hi"}], "stream": True, **changes}


def data(event: object) -> bytes:
    return b"data: " + json.dumps(event).encode() + b"\n\n"


def chunk(delta: dict[str, Any] | None = None, finish_reason: str | None = None, **more: Any) -> bytes:
    return data({"choices": [{"index": 0, "delta": delta or {}, "finish_reason": finish_reason}], **more})


ROLE = chunk({"role": "assistant", "content": ""})
END = chunk({}, "stop") + b"data: [DONE]\n\n"


def writes(*pieces: bytes, pause_s: float = 0.02, then_s: float = 0.0, cut: bool = False) -> Behaviour:
    """A stream of exactly these bytes; then it waits, and ends or is cut."""

    async def behave(request: web.Request, _: dict[str, Any]) -> web.StreamResponse:
        response = web.StreamResponse(headers={"Content-Type": "text/event-stream"})
        await response.prepare(request)
        for piece in pieces:
            await response.write(piece)
            await asyncio.sleep(pause_s)
        await asyncio.sleep(then_s)
        if cut:
            assert request.transport is not None
            request.transport.close()
        return response

    return behave


@pytest.fixture
def other() -> Any:
    """A second model server, which always has an answer."""
    server = OpenAiMock().start()
    server.will(streams("from ", "the ", "fallback"))
    yield server
    server.stop()


ERROR = {"message": "Provider returned error", "code": 502}
FAILURES = [
    ("an error event", data({"error": ERROR})),
    ("an error line", b"error: " + json.dumps(ERROR).encode() + b"\n\n"),
    ("a named error", b"event: error\r\ndata: " + json.dumps(ERROR).encode() + b"\r\n\r\n"),
    ("an object of kind error", data({"object": "error", **ERROR})),
    ("an end without a word", b""),
    ("garbage", b"data: <html>\n\n"),
]


@pytest.mark.parametrize("first", [b"", COMMENT, ROLE, COMMENT + ROLE], ids=["nothing", "comment", "role", "both"])
@pytest.mark.parametrize("failure", [f[1] for f in FAILURES], ids=[f[0] for f in FAILURES])
def test_whatever_fails_before_the_first_word_is_answered_by_the_fallback(
    serve: Serve, mock: OpenAiMock, other: OpenAiMock, first: bytes, failure: bytes
) -> None:
    mock.will(writes(*[piece for piece in (first, failure) if piece]))
    url = serve(build({"m": chat_backend(mock, fallbacks=["n"]), "n": chat_backend(other, alias="n")}).app)
    answer = post(url, PATH, chat())
    assert answer.status_code == 200
    assert "fallback" in answer.text
    assert "error" not in answer.text
    assert len(other.asked) == 1
    assert metric(url, "vlm_gateway_calls_total", role="chat", model="n", outcome="answered") == 1


STATUSES = [
    ({"message": "too long", "code": 400}, 400, "model_rejected"),
    ({"message": "This model's maximum context length is 8192 tokens", "code": 400}, 400, "context_length_exceeded"),
    ({"message": "slow down", "code": 429}, 429, "rate_limit_exceeded"),
    ({"message": "slow down", "type": "rate_limit_error"}, 429, "rate_limit_exceeded"),
    ({"message": "bad key", "code": 401}, 502, "model_rejected"),
    ({"message": "boom", "code": 500}, 503, "model_unreachable"),
    ({"message": "full", "type": "overloaded_error"}, 503, "model_overloaded"),
]


@pytest.mark.parametrize(("error", "code", "word"), STATUSES)
def test_an_error_before_the_first_word_has_its_true_status(
    serve: Serve, mock: OpenAiMock, error: dict[str, Any], code: int, word: str
) -> None:
    mock.will(writes(COMMENT, ROLE, data({"error": error})))
    url = serve(build({"m": chat_backend(mock, retries=0)}).app)
    answer = post(url, PATH, chat())
    assert answer.headers["content-type"] == "application/json"
    assert (answer.status_code, answer.json()["error"]["code"]) == (code, word)


def test_after_the_first_word_an_error_ends_the_stream_and_no_other_model_is_asked(
    serve: Serve, mock: OpenAiMock, other: OpenAiMock
) -> None:
    mock.will(writes(COMMENT, chunk({"content": "one"}), data({"error": ERROR}), END))
    url = serve(build({"m": chat_backend(mock, fallbacks=["n"]), "n": chat_backend(other, alias="n")}).app)
    answer = post(url, PATH, chat())
    last = json.loads(answer.text.strip().split("\n\n")[-1].removeprefix("data: "))
    assert answer.status_code == 200
    assert (last["error"]["code"], last["error"]["details"]["upstream_message"]) == (
        "model_unreachable",
        "Provider returned error",
    )
    assert "[DONE]" not in answer.text
    assert other.asked == []
    assert metric(url, "vlm_gateway_calls_total", role="chat", outcome="answered") == 0


@pytest.mark.parametrize("how", ["stalls", "dies"])
def test_streams_that_die_or_stall_after_the_head_open_the_breaker(serve: Serve, mock: OpenAiMock, how: str) -> None:
    mock.will(writes(ROLE, chunk({"content": "x"}), then_s=30) if how == "stalls" else writes(ROLE, cut=True))
    url = serve(build({"m": chat_backend(mock, timeout_s=0.4, retries=0)}).app)
    for _ in range(8):
        post(url, PATH, chat())
    assert len(mock.asked) == 5


def test_comments_alone_do_not_keep_a_stream_alive(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(chunk({"content": "x"}), *[COMMENT] * 100, pause_s=0.05))
    url = serve(build({"m": chat_backend(mock, timeout_s=0.5)}).app)
    text = post(url, PATH, chat()).text
    assert "model_timeout" in text.split("\n\n")[-2]
    assert text.count("PROCESSING") < 40


@pytest.mark.parametrize("secret_at", ["before", "after"])
def test_the_server_s_key_is_masked_in_streams(serve: Serve, mock: OpenAiMock, secret_at: str) -> None:
    secret = "sk-upstream-0123456789"
    error = data({"error": {"message": f"Incorrect API key provided: {secret}", "code": 401}})
    words = chunk({"content": f"your key is {secret}"})
    mock.will(writes(error) if secret_at == "before" else writes(words[:30], words[30:], error))
    url = serve(build({"m": chat_backend(mock, key=secret)}).app)
    answer = post(url, PATH, chat())
    assert secret not in answer.text
    assert "***" in answer.text


@pytest.mark.parametrize("stream", [False, True])
def test_the_server_s_key_is_masked_before_anything_is_cut(serve: Serve, mock: OpenAiMock, stream: bool) -> None:
    secret = "sk-upstream-0123456789abcdefghijklmnopqrstuvwxyz"
    url = serve(build({"m": chat_backend(mock, key=secret)}).app)
    for before in (440, 455, 460, 490):
        mock.will(status(400, message="x" * before + " " + secret + " is not valid"))
        assert secret[:6] not in post(url, PATH, chat(stream=stream)).text


def test_usage_is_asked_for_and_taken_out_again_unless_the_caller_wants_it(serve: Serve, mock: OpenAiMock) -> None:
    events = (chunk({"content": "x"}, usage=None), chunk({}, "stop", usage=None), data({"choices": [], "usage": USAGE}))
    mock.will(writes(*events, b"data: [DONE]\n\n"))
    url = serve(build({"m": chat_backend(mock)}).app)
    plain = [post(url, PATH, chat(**more)).text for more in ({}, {"stream_options": {"include_usage": False}})]
    assert all("usage" not in text and "[DONE]" in text for text in plain)
    wanted = post(url, PATH, chat(stream_options={"include_usage": True})).text
    assert json.dumps(USAGE) in wanted
    assert all(asked.body["stream_options"]["include_usage"] is True for asked in mock.asked)
    assert metric(url, "vlm_gateway_tokens_total", kind="prompt") == 3000
    assert metric(url, "vlm_gateway_tokens_total", kind="completion") == 150


def test_a_server_that_knows_no_stream_options_is_asked_without_them(serve: Serve, mock: OpenAiMock) -> None:
    async def strict(request: web.Request, body: dict[str, Any]) -> web.StreamResponse:
        if "stream_options" in body:
            return await status(422, message="stream_options: extra fields not permitted")(request, body)
        return await streams("one ", "two")(request, body)

    mock.will(strict)
    url = serve(build({"m": chat_backend(mock)}).app)
    assert [post(url, PATH, chat()).status_code for _ in range(2)] == [200, 200]
    assert len(mock.asked) == 3  # it is found out once
    assert post(url, PATH, chat(stream_options={"include_usage": True})).status_code == 422


def test_whoever_hangs_up_pays_for_what_came(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(*[chunk({"content": f"w{number} "}) for number in range(50)], pause_s=0.0, then_s=30))
    keys = Keys({"k": key("k"), "boss": key("boss", admin=True)})
    url = serve(build({"m": chat_backend(mock)}, keys=keys).app)
    host, port = url.removeprefix("http://").split(":")
    body = json.dumps(chat()).encode()
    with socket.create_connection((host, int(port)), timeout=60) as caller:
        head = f"POST {PATH} HTTP/1.1\r\nhost: x\r\nauthorization: Bearer k\r\ncontent-length: {len(body)}\r\n\r\n"
        caller.sendall(head.encode() + body)
        seen = b""
        while b"w49" not in seen:
            seen += caller.recv(65536)
    boss = {"authorization": "Bearer boss"}

    def charged() -> float:
        page = httpx.get(url + "/metrics", headers=boss, timeout=60).text
        lines = [line for line in page.splitlines() if line.startswith("vlm_gateway_tokens_total")]
        return sum(float(line.rsplit(" ", 1)[1]) for line in lines if 'kind="completion"' in line and 'key="k"' in line)

    wait_until(lambda: charged() == 50)


NOT_KEPT = [
    ("no reason to end", (chunk({"content": "x"}), b"data: [DONE]\n\n"), "unfinished"),
    ("no words", (ROLE, END), "empty"),
    ("a refusal", (chunk({"refusal": "no"}), END), "refused"),
    ("cut at a limit", (chunk({"content": "x"}), chunk({}, "length"), b"data: [DONE]\n\n"), "truncated"),
    ("filtered", (chunk({"content": "x"}), chunk({}, "content_filter"), b"data: [DONE]\n\n"), "refused"),
]


@pytest.mark.parametrize(("pieces", "outcome"), [n[1:] for n in NOT_KEPT], ids=[n[0] for n in NOT_KEPT])
def test_what_did_not_end_well_is_passed_on_and_neither_kept_nor_counted_as_answered(
    serve: Serve, mock: OpenAiMock, tmp_path: Path, pieces: tuple[bytes, ...], outcome: str
) -> None:
    mock.will(writes(*pieces))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    answers = [post(url, PATH, chat(temperature=0)) for _ in range(2)]
    assert [answer.text for answer in answers] == [b"".join(pieces).decode()] * 2
    assert [answer.headers["x-cache"] for answer in answers] == ["miss", "miss"]
    assert metric(url, "vlm_gateway_calls_total", role="chat", outcome=outcome) == 2
    assert rows(tmp_path / "answers.sqlite") == 0


def test_an_answer_cut_where_the_caller_wants_it_cut_is_an_answer(
    serve: Serve, mock: OpenAiMock, tmp_path: Path
) -> None:
    mock.will(writes(chunk({"content": "x"}), chunk({}, "length"), b"data: [DONE]\n\n"), says("no"))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    answers = [post(url, PATH, chat(temperature=0, max_tokens=1)) for _ in range(2)]
    assert [answer.headers["x-cache"] for answer in answers] == ["miss", "hit"]


def test_a_connection_left_open_after_the_end_holds_nobody_for_long(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(chunk({"content": "x"}), END, then_s=30))
    url = serve(build({"m": chat_backend(mock, timeout_s=60.0)}).app)
    started = time.monotonic()
    assert post(url, PATH, chat()).text.endswith("data: [DONE]\n\n")
    assert time.monotonic() - started < 10


def test_one_caller_s_bad_pictures_leave_the_model_to_the_others(serve: Serve, mock: OpenAiMock) -> None:
    async def chokes(request: web.Request, body: dict[str, Any]) -> web.StreamResponse:
        bad = "poison" in json.dumps(body)
        return await (status(500) if bad else says("hello"))(request, body)

    mock.will(chokes)
    keys = Keys({name: KeyConfig(sha256=key(name).sha256) for name in ("a", "b")})
    url = serve(build({"m": chat_backend(mock, retries=0)}, keys=keys).app)

    def ask(name: str, words: str) -> int:
        body = {"model": "m", "messages": [{"role": "user", "content": words}]}
        return post(url, PATH, body, headers={"authorization": f"Bearer {name}"}).status_code

    assert {ask("a", "poison") for _ in range(8)} == {503}
    assert [ask("b", "good") for _ in range(5)] == [200] * 5
    assert len(mock.asked) == 5 + 5
