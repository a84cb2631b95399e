"""Budgets over real HTTP: reserved before a call, charged for what was relayed, shared, outliving a restart."""

import asyncio
import json
import random
from collections import Counter
from pathlib import Path
from typing import Any

import httpx
import pytest

from services.vlm_gateway.config import KeyConfig
from services.vlm_gateway.keys import Keys
from services.vlm_gateway.upstream.client import MAX_REPLY_BYTES
from services.vlm_gateway.usage.accounts import Price
from services.vlm_gateway.usage.budgets import BudgetConfig
from services.vlm_gateway.usage.port import UsageStore
from services.vlm_gateway.usage.redis import RedisUsage
from services.vlm_gateway.usage.sqlite import SqliteUsage
from tests.conftest import RedisProcess, Serve
from tests.services.vlm_gateway.hot.test_frontend import PATH, ask, chat, key, many
from tests.services.vlm_gateway.hot.test_streams import chunk, writes
from tests.services.vlm_gateway.kit import build, chat_backend, floors_body, metric, post, sqlite_cache, wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock, completion, hangs, says, sends

COST = 107
"""What the mock says that each of its answers used, 100 of them for the request."""


def keys_of(teams: dict[str, BudgetConfig] | None = None, **keys: KeyConfig) -> Keys:
    return Keys({**keys, "boss": key("boss", admin=True)}, teams=teams)


def usage(url: str, secret: str) -> dict[tuple[str, str], dict[str, Any]]:
    answer = httpx.get(url + "/v1/usage", headers={"Authorization": f"Bearer {secret}"}, timeout=60)
    assert answer.status_code == 200, answer.text
    return {(one["kind"], one["name"]): one for one in answer.json()["owners"]}


def spent(url: str, name: str, kind: str = "key") -> tuple[float, float]:
    """Tokens that were used today and tokens that are reserved, by the first of an owner's budgets."""
    one = usage(url, "boss")[kind, name]
    used = sum(model["prompt_tokens"] + model["completion_tokens"] for model in one["today"])
    return used, one["budgets"][0]["reserved"] if one["budgets"] else 0


async def test_parallel_calls_can_not_overdraw_a_budget(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says("hello", after_s=0.3))
    keys = keys_of(k=key("k", tokens_per_day=5 * COST))
    url = serve(build({"m": chat_backend(mock, concurrency=64)}, keys=keys).app)
    async with many(40) as client:

        async def one(number: int) -> int:
            body = chat(seed=number, max_tokens=90)
            async with client.post(url + PATH, json=body, headers={"Authorization": "Bearer k"}) as answer:
                return answer.status

        statuses = Counter(await asyncio.gather(*(one(number) for number in range(40))))
    assert statuses[200] in (4, 5)
    assert statuses[429] == 40 - statuses[200]
    assert await asyncio.to_thread(spent, url, "k") == (COST * statuses[200], 0)


@pytest.mark.parametrize("kind", ["sqlite", "redis"])
def test_budgets_are_shared_by_gateways_and_outlive_them(
    serve: Serve, mock: OpenAiMock, tmp_path: Path, request: pytest.FixtureRequest, kind: str
) -> None:
    redis: RedisProcess | None = request.getfixturevalue("redis_server") if kind == "redis" else None

    def gateway(worker: str) -> str:
        store: UsageStore = (
            SqliteUsage(tmp_path / "usage.sqlite", worker) if redis is None else RedisUsage(redis.url, worker)
        )
        keys = keys_of(k=key("k", tokens_per_day=2 * COST))
        return serve(build({"m": chat_backend(mock)}, keys=keys, usage=store).app)

    first, second = gateway("one"), gateway("two")
    assert ask(first, "k").status_code == 200
    wait_until(lambda: spent(second, "k") == (COST, 0))
    assert ask(second, "k").status_code == 200
    wait_until(lambda: spent(first, "k") == (2 * COST, 0))
    assert [ask(url, "k").status_code for url in (first, second, gateway("three"))] == [429] * 3


def test_a_key_sees_its_own_usage_and_its_team_s_and_an_operator_everybody_s(serve: Serve, mock: OpenAiMock) -> None:
    teams = {"t": BudgetConfig(tokens_per_month=1_000_000, usd_per_month=5.0)}
    keys = keys_of(teams, a=key("a", team="t", usd_per_day=1.0), b=key("b", team="t"), c=key("c"))
    prices = {"m": Price(prompt=2.0, completion=10.0)}
    url = serve(build({"m": chat_backend(mock)}, keys=keys, prices=prices).app)
    cost = 100 * 2e-6 + 7 * 10e-6
    for name in "aabc":
        answer = ask(url, name)
        assert (answer.status_code, float(answer.headers["x-cost-usd"])) == (200, pytest.approx(cost))
    mine = usage(url, "a")
    assert list(mine) == [("key", "a"), ("team", "t")]
    assert mine["key", "a"]["today"] == [
        {"model": "m", "calls": 2, "prompt_tokens": 200, "completion_tokens": 14, "usd": pytest.approx(2 * cost)}
    ]
    (budget,) = mine["key", "a"]["budgets"]
    assert (budget["period"], budget["unit"], budget["limit"], budget["reserved"]) == ("day", "usd", 1.0, 0.0)
    assert budget["left"] == pytest.approx(1.0 - 2 * cost)
    assert budget["resets_at"].endswith("T00:00:00Z")
    assert [one["spent"] for one in mine["team", "t"]["budgets"]] == [3 * COST, pytest.approx(3 * cost)]
    assert set(usage(url, "boss")) == {("key", name) for name in ("a", "b", "c", "boss")} | {("team", "t")}
    assert list(usage(url, "c")) == [("key", "c")]
    assert httpx.get(url + "/v1/usage", timeout=60).status_code == 401


def test_a_budget_of_money_or_of_the_team_that_is_spent_refuses_with_its_own_words(
    serve: Serve, mock: OpenAiMock
) -> None:
    teams = {"t": BudgetConfig(tokens_per_day=50)}
    keys = keys_of(teams, rich=key("rich", usd_per_day=0.0001), member=key("member", team="t"))
    url = serve(build({"m": chat_backend(mock)}, keys=keys, prices={"m": Price(2.0, 10.0)}).app)
    for name, code, word in (("rich", "money_spent", "US dollars"), ("member", "tokens_spent", "team 't'")):
        assert ask(url, name).status_code == 200
        refused = ask(url, name)
        assert (refused.status_code, refused.json()["error"]["code"]) == (429, code)
        assert word in refused.json()["error"]["message"]
        assert int(refused.headers["retry-after"]) >= 1


def test_answers_out_of_the_cache_are_free_even_where_the_budget_is_spent(
    serve: Serve, mock: OpenAiMock, tmp_path: Path
) -> None:
    keys = keys_of(k=key("k", tokens_per_day=COST))
    prices = {"m": Price(prompt=2.0, completion=10.0)}
    url = serve(build({"m": chat_backend(mock)}, keys=keys, cache=sqlite_cache(tmp_path), prices=prices).app)
    answers = [ask(url, "k", temperature=0, seed=seed) for seed in (1, 1, 2)]
    assert [answer.status_code for answer in answers] == [200, 200, 429]
    assert ["x-cost-usd" in answer.headers for answer in answers] == [True, False, False]
    assert spent(url, "k") == (COST, 0)


def test_typed_questions_are_charged_and_bounded_too(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says('{"floors": 3}'))
    keys = keys_of(k=key("k", tokens_per_day=COST))
    url = serve(build({"m": chat_backend(mock)}, keys=keys).app)
    mine = {"headers": {"Authorization": "Bearer k"}}
    assert [post(url, "/v1/floor-count", floors_body(), **mine).status_code for _ in range(2)] == [200, 429]
    assert spent(url, "k") == (COST, 0)


def test_a_reply_that_is_too_large_is_paid_for(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(sends(json.dumps(completion("x" * (MAX_REPLY_BYTES + 1))).encode()))
    url = serve(build({"m": chat_backend(mock)}, keys=keys_of(k=key("k", tokens_per_day=10_000))).app)
    assert ask(url, "k", max_tokens=500).status_code == 503
    used, reserved = spent(url, "k")
    assert (used > 500, reserved) == (True, 0)


def test_a_stream_that_breaks_is_paid_for_as_far_as_it_came(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(writes(*[chunk({"content": "w "}) for _ in range(30)], pause_s=0.0, cut=True))
    url = serve(build({"m": chat_backend(mock)}, keys=keys_of(k=key("k", tokens_per_day=10_000))).app)
    ask(url, "k", stream=True)
    (model,) = usage(url, "boss")["key", "k"]["today"]
    assert model["completion_tokens"] == 30
    assert 10 <= model["prompt_tokens"] <= 60  # the request as it was estimated


def test_whoever_leaves_before_the_answer_pays_for_the_request_and_failures_cost_nothing(
    serve: Serve, mock: OpenAiMock
) -> None:
    mock.will(hangs())
    url = serve(build({"m": chat_backend(mock)}, keys=keys_of(k=key("k", tokens_per_day=10_000))).app)
    with pytest.raises(httpx.ReadTimeout):
        httpx.post(url + PATH, json=chat(), headers={"Authorization": "Bearer k"}, timeout=httpx.Timeout(60, read=0.5))
    wait_until(lambda: spent(url, "k")[1] == 0)
    charged, _ = spent(url, "k")
    assert 10 <= charged <= 60
    mock.will(sends(b"<html>", kind="text/html"))
    assert ask(url, "k").status_code == 503
    assert spent(url, "k") == (charged, 0)


async def test_after_hundreds_of_cancels_and_faults_nothing_is_held_and_every_token_is_accounted_for(
    serve: Serve, mock: OpenAiMock
) -> None:
    rng = random.Random(17)
    words = [chunk({"content": "w "}) for _ in range(10)]
    usage_event = b'data: {"choices": [], "usage": {"prompt_tokens": 5, "completion_tokens": 10}}\n\n'
    end = chunk({}, "stop") + usage_event + b"data: [DONE]\n\n"
    faults = [
        writes(*words, end, pause_s=0.002),
        writes(*words, pause_s=0.0, cut=True),
        writes(b": comment\n\n", pause_s=0.0, then_s=2.0),
        sends(b'{"error": {"message": "boom"}}'),
        says("hello", after_s=0.02),
    ]
    mock.will(*(rng.choice(faults) for _ in range(400)), says("hello"))
    keys = keys_of(k=key("k", tokens_per_day=10_000_000, tokens_per_minute=100_000_000))
    backend = chat_backend(mock, concurrency=8, queue=1000, timeout_s=0.5, retries=0)
    url = serve(build({"m": backend}, keys=keys).app)
    async with many(50) as client:

        async def one(number: int) -> None:
            body = chat(seed=number, stream=rng.random() < 0.7)
            asking = asyncio.create_task(client.post(url + PATH, json=body, headers={"Authorization": "Bearer k"}))
            await asyncio.sleep(rng.random() * 0.1)
            if rng.random() < 0.5:
                asking.cancel()
            answer = (await asyncio.gather(asking, return_exceptions=True))[0]
            if not isinstance(answer, BaseException):
                await answer.read()

        for batch in range(10):
            await asyncio.gather(*(one(batch * 30 + number) for number in range(30)))

    def settled() -> bool:
        return spent(url, "k")[1] == 0 and backend.upstream.admission.running == 0

    await asyncio.to_thread(wait_until, settled)
    boss = {"Authorization": "Bearer boss"}
    page = (await asyncio.to_thread(httpx.get, url + "/metrics", headers=boss, timeout=60)).text
    lines = [line for line in page.splitlines() if line.startswith("vlm_gateway_tokens_total")]
    counted = sum(float(line.rsplit(" ", 1)[1]) for line in lines if 'key="k"' in line)
    used, reserved = await asyncio.to_thread(spent, url, "k")
    assert (used, reserved) == (counted, 0)
    assert backend.upstream.admission.waiting == 0


def test_a_store_of_usage_that_is_gone_fails_no_chat(
    serve: Serve, mock: OpenAiMock, redis_server: RedisProcess
) -> None:
    keys = keys_of(k=key("k", tokens_per_day=10 * COST))
    store = RedisUsage(redis_server.url, "one")
    url = serve(build({"m": chat_backend(mock)}, keys=keys, usage=store).app)
    assert ask(url, "k").status_code == 200
    redis_server.stop()
    assert [ask(url, "k", seed=seed).status_code for seed in range(3)] == [200] * 3
    answer = httpx.get(url + "/v1/usage", headers={"Authorization": "Bearer k"}, timeout=60)
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "usage_unavailable")


def test_without_keys_usage_is_counted_for_everybody(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}).app)
    assert ask(url).status_code == 200
    (one,) = httpx.get(url + "/v1/usage", timeout=60).json()["owners"]
    assert (one["name"], one["today"][0]["prompt_tokens"], one["budgets"]) == ("", 100, [])
    assert metric(url, "vlm_gateway_tokens_total", kind="prompt") == 100
