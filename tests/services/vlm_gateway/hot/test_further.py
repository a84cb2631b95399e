"""Embeddings, completions and responses, passed through to a mock server over real HTTP."""

import asyncio
import json
import time
from typing import Any

import httpx
import openai
import pytest

from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys, new_key
from tests.conftest import Serve
from tests.services.vlm_gateway.hot.test_streams import data, writes
from tests.services.vlm_gateway.kit import build, chat_backend, metric, post, wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock, hangs, sends, status

EMBEDDING = {
    "object": "list",
    "model": "maker/model-1",
    "data": [{"object": "embedding", "index": 0, "embedding": [0.5, -0.25]}],
    "usage": {"prompt_tokens": 5, "total_tokens": 5},
}
COMPLETION = {
    "id": "cmpl-1",
    "object": "text_completion",
    "created": 1_700_000_000,
    "model": "maker/model-1",
    "choices": [{"index": 0, "text": " world", "finish_reason": "stop", "logprobs": None}],
    "usage": {"prompt_tokens": 2, "completion_tokens": 1, "total_tokens": 3},
}
RESPONSE = {"id": "resp_1", "object": "response", "output": [], "usage": {"input_tokens": 4, "output_tokens": 3}}


def says(body: dict[str, Any]) -> Any:
    return sends(json.dumps(body).encode())


def test_openai_s_client_gets_embeddings_and_completions(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    with openai.OpenAI(base_url=url + "/v1", api_key="none", max_retries=0) as client:
        mock.will(says(EMBEDDING))
        made = client.embeddings.create(model="m", input="a flower pot", encoding_format="float")
        assert made.data[0].embedding == [0.5, -0.25]
        assert (mock.asked[0].target, mock.asked[0].body["model"]) == ("/v1/embeddings", "maker/model-1")
        mock.will(says(COMPLETION))
        assert client.completions.create(model="m", prompt="hello").choices[0].text == " world"
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="prompt") == 7


def test_responses_are_passed_but_nothing_is_kept_at_the_server(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says(RESPONSE))
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, "/v1/responses", {"model": "m", "input": "hi", "store": True, "max_output_tokens": 20})
    assert (answer.status_code, answer.json()["id"], answer.headers["x-model"]) == (200, "resp_1", "m")
    assert mock.asked[0].body == {"model": "maker/model-1", "input": "hi", "store": False, "max_output_tokens": 20}
    assert metric(url, "vlm_gateway_tokens_total", model="m", kind="completion") == 3


@pytest.mark.parametrize(
    ("route", "body", "code"),
    [
        ("embeddings", {"input": "x", "model": 3}, "invalid"),
        ("embeddings", {"model": "m"}, "invalid"),
        ("completions", {"model": "m", "prompt": "x", "n": 5}, "invalid"),
        ("completions", {"model": "m", "prompt": "x", "stream": "yes"}, "invalid"),
        ("embeddings", {"model": "m", "input": "x", "stream": True}, "invalid"),
        ("responses", {"model": "m", "input": "x", "previous_response_id": "resp_1"}, "invalid"),
        (
            "responses",
            {"model": "m", "input": [{"content": [{"type": "input_image", "image_url": "http://169.254.169.254/"}]}]},
            "no_urls",
        ),
    ],
)
def test_what_would_fetch_keep_or_multiply_is_refused(
    serve: Serve, mock: OpenAiMock, route: str, body: dict[str, Any], code: str
) -> None:
    refused = post(serve(build({"m": chat_backend(mock)}).app), f"/v1/{route}", body)
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, code)
    assert mock.asked == []


@pytest.mark.parametrize(
    ("route", "field"),
    [("completions", "max_tokens"), ("responses", "max_output_tokens")],
    ids=["completions", "responses"],
)
@pytest.mark.parametrize("length", [-(10**12), 10**30, "5", 5.0, True])
def test_no_length_gives_room_in_a_budget(
    serve: Serve, mock: OpenAiMock, route: str, field: str, length: object
) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    refused = post(url, f"/v1/{route}", {"model": "m", "prompt": "hi", "input": "hi", field: length})
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "invalid")
    assert mock.asked == []


def test_keys_and_fallbacks_are_those_of_chats(serve: Serve, mock: OpenAiMock) -> None:
    made = new_key()
    keys = Keys({"k": KeyConfig(sha256=made.sha256, models=("m", "other"))})
    backends = {
        "m": chat_backend(None, retries=0, fallbacks=["other"]),
        "other": chat_backend(mock, alias="other"),
        "secret": chat_backend(mock, alias="secret"),
    }
    url = serve(build(backends, keys=keys).app)
    mine = {"authorization": f"Bearer {made.key}"}
    assert post(url, "/v1/embeddings", {"model": "m", "input": "x"}).status_code == 401
    assert post(url, "/v1/embeddings", {"model": "secret", "input": "x"}, headers=mine).status_code == 403
    assert post(url, "/v1/embeddings", {"model": "gpt-9", "input": "x"}, headers=mine).status_code == 404
    mock.will(says(EMBEDDING))
    answer = post(url, "/v1/embeddings", {"model": "m", "input": "x"}, headers=mine)
    assert (answer.status_code, answer.headers["x-model"]) == (200, "other")
    mock.will(status(400))
    assert post(url, "/v1/embeddings", {"model": "other", "input": "x"}, headers=mine).status_code == 400


def text(words: str, finish_reason: str | None = None, **more: Any) -> bytes:
    choices = [{"index": 0, "text": words, "finish_reason": finish_reason, "logprobs": None}]
    return data({"id": "cmpl-1", "object": "text_completion", "choices": choices, **more})


def named(kind: str, **fields: Any) -> bytes:
    return f"event: {kind}\n".encode() + data({"type": kind, "sequence_number": 1, **fields})


CREATED = named("response.created", response={"id": "resp_1", "status": "in_progress", "error": None})
ADDED = named("response.output_item.added", item={"type": "message", "content": []}, output_index=0)
COUNTED = {"input_tokens": 11, "output_tokens": 3, "total_tokens": 14}
DONE = named("response.completed", response={"id": "resp_1", "status": "completed", "usage": COUNTED, "output": []})


def delta(words: str) -> bytes:
    return named("response.output_text.delta", delta=words, item_id="i", output_index=0, content_index=0)


def spent(url: str) -> tuple[float, float]:
    kinds = ("prompt", "completion")
    prompt, completion = (metric(url, "vlm_gateway_tokens_total", model="m", kind=kind) for kind in kinds)
    return prompt, completion


def test_a_completion_s_stream_reaches_openai_s_client_and_is_counted(serve: Serve, mock: OpenAiMock) -> None:
    usage = data({"id": "cmpl-1", "choices": [], "usage": {"prompt_tokens": 9, "completion_tokens": 2}})
    mock.will(writes(text("a "), text("flower"), text("", "stop"), usage, b"data: [DONE]\n\n"))
    url = serve(build({"m": chat_backend(mock)}).app)
    with openai.OpenAI(base_url=url + "/v1", api_key="none", max_retries=0) as client:
        pieces = list(client.completions.create(model="m", prompt="hello", stream=True))
    assert "".join(piece.choices[0].text for piece in pieces) == "a flower"
    assert [piece.usage for piece in pieces] == [None] * 3
    assert mock.asked[0].body["stream_options"] == {"include_usage": True}
    assert spent(url) == (9, 2)
    post(url, "/v1/completions", {"model": "m", "prompt": "hello", "stream": True})
    wait_until(lambda: metric(url, "vlm_gateway_calls_total", role="completions", outcome="answered") == 1)


def test_a_response_s_stream_is_passed_byte_for_byte_and_counted_by_its_last_event(
    serve: Serve, mock: OpenAiMock
) -> None:
    events = [CREATED, ADDED, delta("third "), delta("floor"), DONE]
    mock.will(writes(*events))
    url = serve(build({"m": chat_backend(mock)}).app)
    answer = post(url, "/v1/responses", {"model": "m", "input": "hi", "stream": True})
    assert (answer.status_code, answer.content) == (200, b"".join(events))
    assert "stream_options" not in mock.asked[0].body
    assert spent(url) == (11, 3)
    wait_until(lambda: metric(url, "vlm_gateway_calls_total", role="responses", outcome="answered") == 1)


def test_openai_s_client_reads_a_response_s_stream(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(CREATED, ADDED, delta("third "), delta("floor"), DONE))
    url = serve(build({"m": chat_backend(mock)}).app)
    with openai.OpenAI(base_url=url + "/v1", api_key="none", max_retries=0) as client:
        events = list(client.responses.create(model="m", input="hi", stream=True))
    assert "".join(event.delta for event in events if event.type == "response.output_text.delta") == "third floor"


@pytest.mark.parametrize(
    ("events", "code"),
    [
        ((CREATED, named("error", code="server_error", message="out of memory", param=None)), 503),
        ((CREATED, ADDED, named("response.failed", response={"error": {"code": "rate_limit_exceeded"}})), 429),
        ((CREATED, ADDED), 503),
        ((text(""), data({"error": {"message": "no", "code": 500}})), 503),
    ],
)
def test_a_stream_that_fails_before_its_first_words_has_its_status_or_a_fallback(
    serve: Serve, mock: OpenAiMock, events: tuple[bytes, ...], code: int
) -> None:
    route = "completions" if events[0] == text("") else "responses"
    body = {"model": "m", "prompt" if route == "completions" else "input": "x", "stream": True}
    mock.will(writes(*events))
    url = serve(build({"m": chat_backend(mock, retries=0)}).app)
    assert post(url, f"/v1/{route}", body).status_code == code
    assert spent(url) == (0, 0)
    backends = {
        "m": chat_backend(mock, retries=0, fallbacks=["other"]),
        "other": chat_backend(mock, alias="other"),
    }
    good = (text("x", "stop"),) if route == "completions" else (delta("x"), DONE)
    mock.will(writes(*events), writes(*good))
    answer = post(serve(build(backends).app), f"/v1/{route}", body)
    assert (answer.status_code, answer.content) == (200, b"".join(good))
    assert answer.headers["x-model"] == "other"


def test_a_response_that_breaks_in_the_middle_ends_with_an_error_and_is_charged(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(CREATED, delta("third "), delta("floor"), cut=True))
    url = serve(build({"m": chat_backend(mock, retries=0)}).app)
    body = {"model": "m", "input": "x" * 400, "stream": True}
    with (
        openai.OpenAI(base_url=url + "/v1", api_key="none", max_retries=0) as client,
        pytest.raises(openai.APIError, match="broke off"),
    ):
        list(client.responses.create(**body))
    prompt, completion = spent(url)
    assert prompt > 100
    assert completion == 2
    wait_until(lambda: metric(url, "vlm_gateway_calls_total", role="responses", outcome="model_unreachable") == 1)


def test_a_response_that_is_cut_at_its_length_is_no_whole_answer(serve: Serve, mock: OpenAiMock) -> None:
    incomplete = {"status": "incomplete", "incomplete_details": {"reason": "max_output_tokens"}, "usage": COUNTED}
    mock.will(writes(delta("thi"), named("response.incomplete", response=incomplete)))
    url = serve(build({"m": chat_backend(mock)}).app)
    assert post(url, "/v1/responses", {"model": "m", "input": "x", "stream": True}).status_code == 200
    wait_until(lambda: metric(url, "vlm_gateway_calls_total", role="responses", outcome="truncated") == 1)


@pytest.mark.parametrize("route", ["embeddings", "completions", "responses"])
def test_no_route_waits_longer_than_its_caller(serve: Serve, mock: OpenAiMock, route: str) -> None:
    mock.will(hangs())
    backend = chat_backend(mock)
    url = serve(build({"m": backend}).app)
    body = {"model": "m", "input": "x", "prompt": "x"}
    began = time.monotonic()
    late = post(url, f"/v1/{route}", body, headers={"x-timeout-s": "1"})
    assert (late.status_code, late.json()["error"]["code"]) == (504, "model_timeout")
    assert time.monotonic() - began < 20
    wait_until(lambda: mock.broken_off == len(mock.asked))
    assert backend.upstream.admission.running == 0


@pytest.mark.parametrize("route", ["embeddings", "completions", "responses"])
async def test_a_caller_who_leaves_ends_the_call_and_pays_for_what_was_asked(
    serve: Serve, mock: OpenAiMock, route: str
) -> None:
    mock.will(hangs())
    backend = chat_backend(mock)
    url = serve(build({"m": backend}).app)
    body = {"model": "m", "input": "x" * 400, "prompt": "x"}
    async with httpx.AsyncClient() as caller:
        task = asyncio.create_task(caller.post(f"{url}/v1/{route}", json=body, timeout=30))
        await asyncio.to_thread(wait_until, lambda: bool(mock.asked))
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    await asyncio.to_thread(wait_until, lambda: mock.broken_off == 1)
    await asyncio.to_thread(wait_until, lambda: backend.upstream.admission.running == 0)
    prompt, completion = await asyncio.to_thread(spent, url)
    assert prompt > 100
    assert completion == 0


def test_a_key_s_concurrency_holds_over_all_routes(serve: Serve, mock: OpenAiMock) -> None:
    made = new_key()
    mock.will(hangs())
    url = serve(build({"m": chat_backend(mock)}, keys=Keys({"k": KeyConfig(sha256=made.sha256, concurrency=1)})).app)
    mine = {"authorization": f"Bearer {made.key}"}

    async def two() -> int:
        async with httpx.AsyncClient(headers=mine, timeout=30) as client:
            first = asyncio.create_task(client.post(url + "/v1/embeddings", json={"model": "m", "input": "x"}))
            await asyncio.to_thread(wait_until, lambda: bool(mock.asked))
            second = await client.post(url + "/v1/completions", json={"model": "m", "prompt": "x"})
            first.cancel()
            await asyncio.gather(first, return_exceptions=True)
            return second.status_code

    assert asyncio.run(two()) == 429
