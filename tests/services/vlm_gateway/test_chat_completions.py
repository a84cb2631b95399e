"""The OpenAI-compatible door: what is passed on, what is refused, what is cached, streams and their ends."""

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.conftest import Serve
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
from tests.services.vlm_gateway.openai_mock import OpenAiMock, completion, cuts, hangs, says, sends, status, streams
from tests.services.vlm_gateway.test_typed_questions import png_bomb

PATH = "/v1/chat/completions"


def chat(**changes: Any) -> dict[str, Any]:
    return {"model": "m", "messages": [{"role": "user", "content": "hello"}], **changes}


def with_picture(url: str) -> dict[str, Any]:
    parts = [{"type": "text", "text": "what is it?"}, {"type": "image_url", "image_url": {"url": url}}]
    return chat(messages=[{"role": "user", "content": parts}])


@pytest.fixture
def url(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> str:
    """A gateway with a cache and one chat model `m`, which also plays the parser."""
    backends = {"m": chat_backend(mock, key="sk-secret")}
    return serve(build(backends, cache=sqlite_cache(tmp_path), roles={"parser": "m"}).app)


@pytest.fixture
def impatient(serve: Serve, mock: OpenAiMock) -> str:
    """A gateway that waits a second for its model."""
    return serve(build({"m": chat_backend(mock, timeout_s=1.0)}).app)


def test_a_chat_is_passed_on_under_the_configured_name_and_comes_back_unchanged(url: str, mock: OpenAiMock) -> None:
    reply = {**completion("hi"), "system_fingerprint": "fp", "x": {"y": [1, 2.5, None]}}
    mock.will(sends(json.dumps(reply).encode()))
    asked = chat(
        temperature=0.3, top_p=0.9, stop=["x"], tools=[{"type": "function", "function": {"name": "f"}}], user="me"
    )
    answer = post(url, PATH, asked)
    assert answer.json() == reply
    assert answer.headers["x-cache"] == "off"
    sent = mock.asked[0]
    assert sent.body["model"] == "maker/model-1"
    assert sent.body["messages"] == asked["messages"]
    assert (sent.body["temperature"], sent.body["stop"]) == (0.3, ["x"])
    assert "user" not in sent.body
    assert sent.headers["Authorization"] == "Bearer sk-secret"


def test_without_a_name_the_parser_answers(url: str, mock: OpenAiMock) -> None:
    assert post(url, PATH, {"messages": chat()["messages"]}).json()["choices"][0]["message"]["content"] == "hello"


@pytest.mark.parametrize("kind", ["jpeg", "png"])
def test_inline_pictures_are_passed_on(url: str, mock: OpenAiMock, kind: str) -> None:
    data = picture_base64()
    if kind == "png":
        png = png_bomb()[:16] + (5).to_bytes(4, "big") * 2 + bytes(40)
        data = base64.b64encode(png).decode()
    body = with_picture(f"data:image/{kind};base64,{data}")
    assert post(url, PATH, body).status_code == 200
    assert mock.asked[0].body["messages"] == body["messages"]


REFUSED = [
    ("an address", with_picture("http://169.254.169.254/latest/meta-data"), "no_urls"),
    ("https", with_picture("https://example.org/a.jpg"), "no_urls"),
    ("a file", with_picture("file:///etc/passwd"), "no_urls"),
    ("an SVG", with_picture("data:image/svg+xml;base64,PHN2Zz4="), "bad_image"),
    ("not base64", with_picture("data:image/png;base64,%%%%"), "bad_image"),
    ("no picture", with_picture("data:image/png;base64,aGVsbG8gd29ybGQ="), "bad_image"),
    ("a PNG bomb", with_picture("data:image/png;base64," + base64.b64encode(png_bomb()).decode()), "bad_image"),
    ("an unknown field", chat(chat_template="{{}}"), "unknown_field"),
    ("an address to call", chat(base_url="http://evil"), "unknown_field"),
    ("many answers", chat(n=50), "invalid"),
    ("endless answers", chat(max_tokens=10_000_000), "invalid"),
    ("no messages", chat(messages=[]), "invalid"),
    ("a wild role", chat(messages=[{"role": "root", "content": "x"}]), "invalid"),
    ("a role that is no text", chat(messages=[{"role": ["user"], "content": "x"}]), "invalid"),
    (
        "a wild part",
        chat(messages=[{"role": "user", "content": [{"type": "hologram", "hologram": {"depth": 3}}]}]),
        "unknown_part",
    ),
    (
        "an address in a wild part",
        chat(messages=[{"role": "user", "content": [{"type": "video_url", "video_url": "x"}]}]),
        "no_urls",
    ),
    ("a part of no kind", chat(messages=[{"role": "user", "content": [{"text": "x"}]}]), "invalid"),
    ("a hot temperature", chat(temperature=9), "invalid"),
    (
        "too many pictures",
        chat(
            messages=[
                {
                    "role": "user",
                    "content": with_picture("data:image/jpeg;base64," + picture_base64())["messages"][0]["content"]
                    * 65,
                }
            ]
        ),
        "invalid",
    ),
    ("a list", [], "invalid"),
]


@pytest.mark.parametrize(("body", "code"), [r[1:] for r in REFUSED], ids=[r[0] for r in REFUSED])
def test_what_is_not_known_or_not_safe_is_refused_and_not_passed_on(
    url: str, mock: OpenAiMock, body: Any, code: str
) -> None:
    answer = post(url, PATH, body)
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, code)
    assert mock.asked == []


def test_a_chat_at_temperature_0_is_cached_and_any_other_when_asked_for(url: str, mock: OpenAiMock) -> None:
    def state(body: dict[str, Any], **headers: str) -> str:
        return str(post(url, PATH, body, headers=headers).headers["x-cache"])

    assert [state(chat(temperature=0)) for _ in range(2)] == ["miss", "hit"]
    assert [state(chat(temperature=1)) for _ in range(2)] == ["off", "off"]
    assert [state(chat(temperature=1), **{"x-cache": "on"}) for _ in range(2)] == ["miss", "hit"]
    assert state(chat(temperature=0), **{"x-cache": "off"}) == "off"
    assert state(chat(temperature=0, max_tokens=5)) == "miss"
    assert post(url, PATH, chat(), headers={"x-cache": "maybe"}).status_code == 422


@pytest.mark.parametrize(
    "reply", [says("half an ans", finish_reason="length"), says("", finish_reason="content_filter")]
)
def test_answers_that_were_cut_or_filtered_are_not_cached(url: str, mock: OpenAiMock, reply: Any) -> None:
    mock.will(reply)
    for _ in range(2):
        assert post(url, PATH, chat(temperature=0)).headers["x-cache"] == "miss"


def test_in_replay_no_chat_reaches_a_model(serve: Serve, mock: OpenAiMock, tmp_path: Path, url: str) -> None:
    post(url, PATH, chat(temperature=0))
    wait_until(lambda: rows(tmp_path / "answers.sqlite") == 1)
    asked_before = len(mock.asked)
    replay = build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path), mode="replay")
    replaying = serve(replay.app)
    assert post(replaying, PATH, chat(temperature=0)).headers["x-cache"] == "hit"
    for body in (chat(temperature=0, seed=1), chat(temperature=1), chat(stream=True)):
        answer = post(replaying, PATH, body)
        assert (answer.status_code, answer.json()["error"]["code"]) == (404, "not_recorded")
    assert len(mock.asked) == asked_before


FAULTS = [
    ("HTML in a 200", sends(b"<html>login</html>", kind="text/html"), 503, "model_unreachable"),
    ("empty choices", sends(json.dumps({**completion("x"), "choices": []}).encode()), 503, "model_unreachable"),
    (
        "error in a 200",
        sends(b'{"error": {"message": "rate limit", "type": "rate_limit_error"}}'),
        429,
        "model_overloaded",
    ),
    ("JSON cut off", cuts(b'{"choices": ['), 503, "model_unreachable"),
    ("429", status(429, retry_after="60"), 429, "model_overloaded"),
    ("400", status(400, message="bad picture"), 400, "model_rejected"),
]


@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize(("behaviour", "code", "word"), [f[1:] for f in FAULTS], ids=[f[0] for f in FAULTS])
def test_a_server_s_fault_is_a_typed_error_streamed_or_not(
    url: str, mock: OpenAiMock, behaviour: Any, code: int, word: str, stream: bool
) -> None:
    mock.will(behaviour)
    answer = post(url, PATH, chat(stream=stream))
    assert answer.status_code == code
    assert answer.json()["error"]["code"] == ("rate_limit_exceeded" if code == 429 else word)
    assert "sk-secret" not in answer.text
    assert metric(url, "vlm_gateway_calls_total", role="chat", outcome=word) == 1


@pytest.mark.parametrize("stream", [False, True])
def test_a_server_that_hangs_ends_in_a_timeout_streamed_or_not(impatient: str, mock: OpenAiMock, stream: bool) -> None:
    mock.will(hangs())
    answer = post(impatient, PATH, chat(stream=stream))
    assert (answer.status_code, answer.json()["error"]["code"]) == (504, "model_timeout")
    assert metric(impatient, "vlm_gateway_calls_total", role="chat", outcome="model_timeout") == 1


def test_only_reasoning_is_passed_on_as_it_is(url: str, mock: OpenAiMock) -> None:
    mock.will(says(None, reasoning_content="hm"))
    assert post(url, PATH, chat()).json()["choices"][0]["message"]["reasoning_content"] == "hm"


def events(text: str) -> Iterator[Any]:
    for line in text.splitlines():
        if line.startswith("data: "):
            data = line.removeprefix("data: ")
            yield data if data == "[DONE]" else json.loads(data)


def words(text: str) -> str:
    chunks = [event for event in events(text) if isinstance(event, dict) and "choices" in event]
    return "".join(chunk["choices"][0]["delta"].get("content", "") for chunk in chunks)


def test_a_stream_arrives_piece_by_piece_to_its_end(url: str, mock: OpenAiMock) -> None:
    mock.will(streams("one ", "two ", "three", pause_s=0.05))
    pieces = []
    with httpx.stream("POST", url + PATH, json=chat(stream=True), timeout=60) as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        pieces = list(response.iter_text())
    assert len(pieces) >= 3
    assert words("".join(pieces)) == "one two three"
    assert list(events("".join(pieces)))[-1] == "[DONE]"
    assert mock.asked[0].body["stream"] is True


@pytest.mark.parametrize("cut", [True, False])
def test_a_stream_without_its_end_says_so_in_a_last_event(url: str, mock: OpenAiMock, cut: bool) -> None:
    mock.will(streams("one ", "two", done=False, cut=cut))
    text = post(url, PATH, chat(stream=True, temperature=0)).text
    assert words(text) == "one two"
    last = list(events(text))[-1]
    assert (last["error"]["code"], last["error"]["details"]["reason"]) == ("model_unreachable", "cut")


def test_a_stream_that_dries_up_ends_with_a_timeout(impatient: str, mock: OpenAiMock) -> None:
    mock.will(streams("one", "never", pause_s=30))
    text = post(impatient, PATH, chat(stream=True)).text
    assert words(text) == "one"
    assert list(events(text))[-1]["error"]["code"] == "model_timeout"


def test_a_stream_is_cached_whole_or_not_at_all(url: str, mock: OpenAiMock) -> None:
    mock.will(streams("one ", "two", done=False, cut=True), streams("one ", "two ", "three"), says("whole"))
    broken, first, second = (post(url, PATH, chat(stream=True, temperature=0)) for _ in range(3))
    assert [a.headers["x-cache"] for a in (broken, first, second)] == ["miss", "miss", "hit"]
    assert first.text == second.text
    assert words(second.text) == "one two three"
    assert post(url, PATH, chat(temperature=0)).headers["x-cache"] == "miss"


@pytest.mark.parametrize("cached", [True, False])
def test_a_client_that_leaves_ends_the_call_it_alone_waited_for(url: str, mock: OpenAiMock, cached: bool) -> None:
    mock.will(hangs())
    with pytest.raises(httpx.ReadTimeout):
        httpx.post(url + PATH, json=chat(temperature=0 if cached else 1), timeout=httpx.Timeout(60, read=2))
    wait_until(lambda: mock.broken_off == 1)
    wait_until(lambda: httpx.get(url + "/v1/status", timeout=60).json()["models"]["m"]["running"] == 0)
    wait_until(lambda: metric(url, "http_requests_total", status="499") == 1)
    assert metric(url, "vlm_gateway_calls_total", outcome="model_timeout") == 0  # it was not the deadline


def test_a_client_that_leaves_a_stream_ends_it_at_the_server_too(url: str, mock: OpenAiMock) -> None:
    mock.will(streams(*["word "] * 400, pause_s=0.05))
    with httpx.stream("POST", url + PATH, json=chat(stream=True), timeout=60) as response:
        next(response.iter_text())
    wait_until(lambda: mock.broken_off == 1)
    wait_until(lambda: httpx.get(url + "/v1/status", timeout=60).json()["models"]["m"]["running"] == 0)
