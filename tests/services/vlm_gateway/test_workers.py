"""A gateway of two processes: one port, and limits that are one for both."""

import asyncio
import contextlib
import hashlib
import os
import signal
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from aiohttp import web

from tests.conftest import RedisProcess
from tests.load.processes import Running, service
from tests.services.vlm_gateway.kit import wait_until
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, says

PATH = "/v1/chat/completions"
HI = {"model": "m", "messages": [{"role": "user", "content": "hi"}]}


def workers_of(gateway: Running) -> set[int]:
    children = Path(f"/proc/{gateway.process.pid}/task/{gateway.process.pid}/children").read_text()
    return {int(child) for child in children.split()}


@pytest.fixture
def gateway(mock: OpenAiMock, tmp_path: Path) -> Iterator[Running]:
    file = tmp_path / "gateway.toml"
    digest = {name: hashlib.sha256(f"sk-{name}".encode()).hexdigest() for name in ("wide", "narrow")}
    file.write_text(
        f'[models.m]\nbackend = "chat"\npreset = "gpt-4o"\nbase_url = "{mock.url}"\nmodel = "x"\nconcurrency = 2\n'
        f'[keys.wide]\nsha256 = "{digest["wide"]}"\nadmin = true\n'
        f'[keys.narrow]\nsha256 = "{digest["narrow"]}"\nrequests_per_minute = 6\n'
    )
    environment = {
        "WORKERS": "2",
        "GATEWAY_CONFIG": str(file),
        "CACHE_PATH": str(tmp_path / "answers.sqlite"),
        "REQUEST_LOG_SHARE": "0",
    }
    with service("services.vlm_gateway", environment) as running:
        yield running


def all_serve(gateway: Running) -> None:
    """Waits until each worker has answered."""
    seen: set[int] = set()

    def another() -> bool:
        with contextlib.suppress(httpx.TransportError):
            told = httpx.get(gateway.url + "/v1/status", headers={"authorization": "Bearer sk-wide"}, timeout=60)
            seen.add(told.json()["worker"]["number"])
        return seen == {0, 1}

    wait_until(another)


def at_once(gateway: Running, key: str, count: int) -> Counter[int]:
    """Statuses of so many chats, each on a connection of its own, all at the same time."""

    async def ask() -> int:
        async with httpx.AsyncClient(timeout=60) as client:
            answer = await client.post(gateway.url + PATH, json=HI, headers={"authorization": f"Bearer sk-{key}"})
            return answer.status_code

    async def all_() -> list[int]:
        return list(await asyncio.gather(*(ask() for _ in range(count))))

    return Counter(asyncio.run(all_()))


def counting(most: list[int]) -> Behaviour:
    running = 0

    async def behave(request: web.Request, body: dict[str, Any]) -> web.StreamResponse:
        nonlocal running
        running += 1
        most.append(running)
        await asyncio.sleep(0.1)
        running -= 1
        return await says("hello")(request, body)

    return behave


def test_the_places_of_a_model_are_one_for_all_workers(gateway: Running, mock: OpenAiMock) -> None:
    all_serve(gateway)
    most: list[int] = []
    mock.will(counting(most))
    assert at_once(gateway, "wide", 24) == {200: 24}
    assert max(most) == 2
    assert len(workers_of(gateway)) == 2


def test_a_key_s_rate_is_one_for_all_workers(gateway: Running) -> None:
    all_serve(gateway)
    assert at_once(gateway, "narrow", 20) == {200: 6, 429: 14}


def test_a_worker_that_dies_is_replaced_and_gives_back_what_it_held(gateway: Running, mock: OpenAiMock) -> None:
    all_serve(gateway)
    assert at_once(gateway, "wide", 10) == {200: 10}
    before = workers_of(gateway)
    wait_until(lambda: answered(gateway) == 10)
    time.sleep(1.5)  # what a worker counted in its last second may die with it
    os.kill(min(before), signal.SIGKILL)
    wait_until(lambda: len(workers_of(gateway) - before) == 1)
    all_serve(gateway)
    most: list[int] = []
    mock.will(counting(most))
    assert at_once(gateway, "wide", 10) == {200: 10}
    assert max(most) == 2
    wait_until(lambda: answered(gateway) == 20)


def answered(gateway: Running) -> float:
    """What all workers have answered, by the page of figures of whichever is asked."""
    page = httpx.get(gateway.url + "/metrics", headers={"authorization": "Bearer sk-wide"}, timeout=60).text
    lines = [line for line in page.splitlines() if line.startswith("vlm_gateway_calls_total{")]
    return sum(float(line.rsplit(" ", 1)[1]) for line in lines)


def test_the_end_is_the_end_of_all(gateway: Running) -> None:
    workers = workers_of(gateway)
    gateway.process.terminate()
    assert gateway.process.wait(20) == 0
    assert not any(Path(f"/proc/{worker}").exists() for worker in workers)


@pytest.fixture
def with_redis(mock: OpenAiMock, tmp_path: Path, redis_server: RedisProcess) -> Iterator[Running]:
    file = tmp_path / "gateway.toml"
    file.write_text(
        f'[models.m]\nbackend = "chat"\npreset = "gpt-4o"\nbase_url = "{mock.url}"\nmodel = "x"\nconcurrency = 64\n'
        f'[keys.wide]\nsha256 = "{hashlib.sha256(b"sk-wide").hexdigest()}"\nadmin = true\n'
    )
    environment = {
        "WORKERS": "2",
        "GATEWAY_CONFIG": str(file),
        "REDIS_URL": redis_server.url,
        "CACHE_TIMEOUT_S": "5",
        "REQUEST_LOG_SHARE": "0",
    }
    with service("services.vlm_gateway", environment) as running:
        yield running


def test_200_identical_chats_in_two_workers_make_one_call(with_redis: Running, mock: OpenAiMock) -> None:
    all_serve(with_redis)
    mock.will(says("hello", after_s=1.0))

    async def ask(client: httpx.AsyncClient) -> str:
        chat = HI | {"temperature": 0}
        answer = await client.post(with_redis.url + PATH, json=chat, headers={"authorization": "Bearer sk-wide"})
        return str(answer.json()["choices"][0]["message"]["content"])

    async def all_() -> list[str]:
        limits = httpx.Limits(max_connections=200)
        async with httpx.AsyncClient(timeout=60, limits=limits) as client:
            return list(await asyncio.gather(*(ask(client) for _ in range(200))))

    assert asyncio.run(all_()) == ["hello"] * 200
    assert len(mock.asked) == 1


def test_an_answer_that_is_not_kept_lets_the_next_worker_ask(with_redis: Running, mock: OpenAiMock) -> None:
    all_serve(with_redis)
    mock.will(says("cut", after_s=0.3, finish_reason="length"))

    async def ask() -> int:
        async with httpx.AsyncClient(timeout=60) as client:
            chat = HI | {"temperature": 0}
            headers = {"authorization": "Bearer sk-wide"}
            return (await client.post(with_redis.url + PATH, json=chat, headers=headers)).status_code

    async def all_() -> list[int]:
        return list(await asyncio.gather(*(ask() for _ in range(20))))

    assert asyncio.run(all_()) == [200] * 20
    assert len(mock.asked) <= 4
