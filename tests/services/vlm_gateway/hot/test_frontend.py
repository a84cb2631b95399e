"""Keys and budgets, fallbacks, one call for many, overload, and the openai client: the whole way over real HTTP."""

import asyncio
import hashlib
import threading
from collections import Counter
from itertools import islice
from pathlib import Path
from typing import Any

import aiohttp
import httpx
import openai
import pytest

from services.vlm_gateway.config import ChatLimits, KeyConfig
from services.vlm_gateway.keys import Keys, new_key
from tests.conftest import RedisProcess, Serve
from tests.services.vlm_gateway.kit import build, chat_backend, floors_body, metric, picture_base64, sqlite_cache
from tests.services.vlm_gateway.openai_mock import OpenAiMock, hangs, says, says_when, status, streams

PATH = "/v1/chat/completions"


def chat(**changes: Any) -> dict[str, Any]:
    return {"model": "m", "messages": [{"role": "user", "content": "hello"}], **changes}


def key(secret: str, **limits: Any) -> KeyConfig:
    return KeyConfig(sha256=hashlib.sha256(secret.encode()).hexdigest(), **limits)


def ask(url: str, secret: str | None = None, **changes: Any) -> httpx.Response:
    headers = {"Authorization": f"Bearer {secret}"} if secret else {}
    return httpx.post(url + PATH, json=chat(**changes), headers=headers, timeout=60)


def many(connections: int) -> aiohttp.ClientSession:
    """A client that bears so many at once: httpx looks through all its connections for every request."""
    limit = aiohttp.TCPConnector(limit=connections)
    return aiohttp.ClientSession(connector=limit, timeout=aiohttp.ClientTimeout(total=150))


def test_only_known_keys_are_served_and_none_is_ever_shown(serve: Serve, mock: OpenAiMock) -> None:
    made = new_key()
    keys = Keys({"me": KeyConfig(sha256=made.sha256)}, token="operator-token")
    url = serve(build({"m": chat_backend(mock, key="sk-upstream")}, keys=keys).app)
    assert ask(url, made.key).status_code == 200
    refused = [ask(url), ask(url, "sk-wrong"), ask(url, made.sha256), httpx.get(url + "/v1/models", timeout=60)]
    assert {answer.status_code for answer in refused} == {401}
    assert refused[0].json()["error"]["code"] == "unauthorised"
    mine = {"Authorization": f"Bearer {made.key}"}
    assert httpx.get(url + "/v1/models", headers=mine, timeout=60).status_code == 200
    assert httpx.get(url + "/metrics", headers=mine, timeout=60).status_code == 403
    assert httpx.get(url + "/healthz", timeout=60).status_code == 200
    operator = {"Authorization": "Bearer operator-token"}
    pages = [httpx.get(url + page, headers=operator, timeout=60) for page in ("/metrics", "/v1/status")]
    assert all(page.status_code == 200 for page in pages)
    for secret in (made.key, made.sha256, "sk-upstream", "operator-token", "sk-wrong"):
        assert all(secret not in page.text for page in [*pages, *refused])
    assert 'key="me"' in pages[0].text


def test_a_key_s_budgets_are_kept_and_the_refusal_says_how_long(serve: Serve, mock: OpenAiMock) -> None:
    keys = Keys(
        {
            "few": key("few", requests_per_minute=2),
            "poor": key("poor", tokens_per_minute=100),  # the mock's answer costs 107
            "daily": key("daily", tokens_per_day=100),
            "other": key("other", models=["n"]),
        }
    )
    url = serve(build({"m": chat_backend(mock), "n": chat_backend(mock)}, keys=keys).app)
    assert [ask(url, "few").status_code for _ in range(3)] == [200, 200, 429]
    for name, code in (("poor", "tokens_spent"), ("daily", "tokens_spent"), ("few", "rate_limited")):
        ask(url, name)
        refused = ask(url, name)
        assert (refused.status_code, refused.json()["error"]["code"]) == (429, code)
        assert int(refused.headers["retry-after"]) >= 1
    assert ask(url, "other").status_code == 403
    assert ask(url, "other", model="n").status_code == 200


async def test_a_key_has_no_more_under_way_than_it_may(serve: Serve, mock: OpenAiMock) -> None:
    refused = threading.Event()
    mock.will(says_when(refused, "hello"))
    url = serve(build({"m": chat_backend(mock)}, keys=Keys({"k": key("k", concurrency=2)})).app)
    async with httpx.AsyncClient(headers={"Authorization": "Bearer k"}, timeout=60) as client:
        asking = [asyncio.create_task(client.post(url + PATH, json=chat(seed=n))) for n in range(6)]
        for answered in islice(asyncio.as_completed(asking), 4):
            await answered
        refused.set()
        answers = await asyncio.gather(*asking)
    assert Counter(answer.status_code for answer in answers) == {200: 2, 429: 4}
    assert ask(url, "k").status_code == 200  # and the places were given back


def test_tenants_share_answers_and_no_two_do(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> None:
    keys = Keys(
        {"a": key("a", tenant="x"), "b": key("b", tenant="x"), "c": key("c"), "d": key("d", tenant="x", models=["m"])}
    )
    url = serve(build({"m": chat_backend(mock)}, keys=keys, cache=sqlite_cache(tmp_path)).app)
    assert [ask(url, name, temperature=0).headers["x-cache"] for name in "abcd"] == ["miss", "hit", "miss", "miss"]


@pytest.mark.parametrize("stream", [False, True])
async def test_two_hundred_who_ask_the_same_make_one_call(
    serve: Serve, mock: OpenAiMock, redis_server: RedisProcess, stream: bool
) -> None:
    from services.vlm_gateway.cache.redis import RedisCache

    mock.will(streams("one ", "two", pause_s=0.5) if stream else says("hello", after_s=1.0))
    url = serve(build({"m": chat_backend(mock)}, cache=RedisCache(redis_server.url, ttl_s=0, timeout_s=5.0)).app)
    async with many(200) as client:

        async def one() -> tuple[int, bytes, str]:
            async with client.post(url + PATH, json=chat(temperature=0, stream=stream)) as answer:
                return answer.status, await answer.read(), answer.headers["x-cache"]

        answers = await asyncio.gather(*(one() for _ in range(200)))
    assert {status for status, _, _ in answers} == {200}
    assert len({body for _, body, _ in answers}) == 1
    assert len(mock.asked) == 1
    assert Counter(cache for _, _, cache in answers) == {"miss": 1, "hit": 199}


async def test_the_first_of_many_may_leave_and_the_others_are_answered(
    serve: Serve, mock: OpenAiMock, tmp_path: Path
) -> None:
    mock.will(says("hello", after_s=1.5))
    url = serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)
    async with httpx.AsyncClient(timeout=60) as client:
        first = asyncio.create_task(client.post(url + PATH, json=chat(temperature=0)))
        await asyncio.sleep(0.5)
        others = [asyncio.create_task(client.post(url + PATH, json=chat(temperature=0))) for _ in range(3)]
        await asyncio.sleep(0.3)
        first.cancel()
        assert [(await other).status_code for other in others] == [200] * 3
    assert len(mock.asked) == 1


@pytest.mark.parametrize("stream", [False, True])
def test_where_a_model_is_down_the_next_one_answers_and_is_not_kept(
    serve: Serve, mock: OpenAiMock, tmp_path: Path, stream: bool
) -> None:
    mock.will(streams("one") if stream else says("hello"))
    down = chat_backend(None, fallbacks=["also-down", "up"], retries=0)
    down_too = chat_backend(None, alias="also-down", retries=0)
    backends = {"m": down, "also-down": down_too, "up": chat_backend(mock, alias="up", model="maker/other")}
    url = serve(build(backends, cache=sqlite_cache(tmp_path)).app)
    answers = [ask(url, temperature=0, stream=stream) for _ in range(2)]
    assert [(answer.status_code, answer.headers["x-cache"]) for answer in answers] == [(200, "miss")] * 2
    assert [asked.body["model"] for asked in mock.asked] == ["maker/other"] * 2
    assert metric(url, "vlm_gateway_fallbacks_total", to="up") == 2


def test_the_model_s_own_refusal_of_a_request_is_not_another_model_s_affair(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(status(400, message="bad"))
    backends = {"m": chat_backend(mock, fallbacks=["n"]), "n": chat_backend(mock)}
    url = serve(build(backends).app)
    assert ask(url).status_code == 400
    assert len(mock.asked) == 1


async def test_at_three_times_what_a_model_can_do_most_is_still_done_and_the_rest_refused_at_once(
    serve: Serve, mock: OpenAiMock
) -> None:
    mock.will(says("hello", after_s=0.2))
    url = serve(build({"m": chat_backend(mock, concurrency=4, queue=8)}).app)
    done = refused = 0
    async with many(36) as client:

        async def caller(number: int) -> None:
            nonlocal done, refused
            for turn in range(6):
                async with client.post(url + PATH, json=chat(seed=100 * number + turn)) as answer:
                    told = await answer.json()
                if answer.status == 200:
                    done += 1
                else:
                    assert (answer.status, told["error"]["code"]) == (503, "model_overloaded")
                    assert int(answer.headers["retry-after"]) >= 1
                    refused += 1
                    await asyncio.sleep(0.1)

        await asyncio.gather(*(caller(number) for number in range(36)))
    assert refused >= 1
    assert done >= 12  # at the least all places and all of the queue, once
    assert len(mock.asked) == done  # nobody was asked in vain


def test_the_caller_s_deadline_ends_the_call(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(hangs())
    url = serve(build({"m": chat_backend(mock, timeout_s=60.0)}).app)
    answer = httpx.post(url + PATH, json=chat(), headers={"x-timeout-s": "0.5"}, timeout=60)
    assert (answer.status_code, answer.json()["error"]["code"]) == (504, "model_timeout")
    assert httpx.post(url + PATH, json=chat(), headers={"x-timeout-s": "soon"}).status_code == 422


def test_a_trace_goes_on_and_what_was_spent_is_counted(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock, server="vllm")}).app)
    trace = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
    for given in (trace, "00-nonsense"):
        httpx.post(url + PATH, json=chat(), headers={"traceparent": given}, timeout=60)
    assert [asked.headers.get("traceparent") for asked in mock.asked] == [trace, None]
    labels = {"gen_ai_provider_name": "vllm", "gen_ai_request_model": "m"}
    assert metric(url, "gen_ai_client_operation_duration_seconds_count", **labels) == 2
    assert metric(url, "gen_ai_client_token_usage_sum", gen_ai_token_type="output", **labels) == 14
    assert metric(url, "vlm_gateway_tokens_total", kind="prompt") == 200


def test_bodies_are_bounded_while_they_come_in(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}, limits=ChatLimits(body_bytes=10_000)).app)
    stated = httpx.post(url + PATH, content=b"x" * 20_000, timeout=60)

    def endless() -> Any:
        while True:
            yield b"x" * 4096

    assert (stated.status_code, stated.json()["error"]["code"]) == (413, "body_too_large")
    try:
        streamed = httpx.post(url + PATH, content=endless(), timeout=60)
    except httpx.TransportError:
        return  # the connection was closed while more was on its way
    assert streamed.status_code == 413


def test_the_openai_client_works_unchanged(serve: Serve, mock: OpenAiMock) -> None:
    keys = Keys({"me": key("sk-mine")})
    url = serve(build({"m": chat_backend(mock)}, keys=keys).app)
    with openai.OpenAI(base_url=url + "/v1", api_key="sk-mine", max_retries=0) as client:
        assert [model.id for model in client.models.list()] == ["m"]
        parts: list[Any] = [
            {"type": "text", "text": "what is it?"},
            {"type": "image_url", "image_url": {"url": f"data:image/jpeg;base64,{picture_base64()}", "detail": "low"}},
        ]
        answer = client.chat.completions.create(model="m", messages=[{"role": "user", "content": parts}], max_tokens=9)
        assert answer.choices[0].message.content == "hello"
        assert answer.usage is not None
        assert answer.usage.completion_tokens == 7
        assert mock.asked[0].body["messages"][0]["content"] == parts
        mock.will(streams("one ", "two"))
        with client.chat.completions.create(
            model="m", messages=[{"role": "user", "content": "hi"}], stream=True
        ) as stream:
            assert "".join(chunk.choices[0].delta.content or "" for chunk in stream) == "one two"
        with pytest.raises(openai.NotFoundError) as refused:
            client.chat.completions.create(model="gpt-9", messages=[{"role": "user", "content": "hi"}])
        assert refused.value.code == "model_not_found"
        mock.will(status(429, retry_after="7"))
        with pytest.raises(openai.RateLimitError) as limited:
            client.chat.completions.create(model="m", messages=[{"role": "user", "content": "hi"}])
        assert limited.value.response.headers["retry-after"] == "7"
    with pytest.raises(openai.AuthenticationError):
        openai.OpenAI(base_url=url + "/v1", api_key="sk-wrong", max_retries=0).models.list()


def test_a_key_sees_and_asks_only_its_own_models(serve: Serve, mock: OpenAiMock) -> None:
    made = new_key()
    keys = Keys({"k": KeyConfig(sha256=made.sha256, models=("m",))})
    backends = {"m": chat_backend(mock), "secret": chat_backend(mock, alias="secret")}
    url = serve(build(backends, roles={"floors": "secret"}, keys=keys).app)
    mine = {"authorization": f"Bearer {made.key}"}
    listed = httpx.get(url + "/v1/models", headers=mine, timeout=60).json()["data"]
    assert [model["id"] for model in listed] == ["m"]
    assert httpx.get(url + "/v1/models/secret", headers=mine, timeout=60).status_code == 404
    typed = httpx.post(url + "/v1/floor-count", json=floors_body(), headers=mine, timeout=60)
    assert (typed.status_code, typed.json()["error"]["code"]) == (403, "forbidden")
