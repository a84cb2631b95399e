"""Several servers behind one alias: who is asked, over real HTTP to mock servers."""

import asyncio
import base64
import json
import random
import time
from collections import Counter, OrderedDict
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from aiohttp import web

from services.vlm_gateway.upstream.choice import EndpointChoice, marks_of
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.upstream.endpoint import Endpoint
from tests.conftest import Serve
from tests.services.vlm_gateway.kit import build, chat_backend, chat_settings, closed_port, post, wait_until
from tests.services.vlm_gateway.openai_mock import Behaviour, OpenAiMock, says, status, streams

PATH = "/v1/chat/completions"
HI = {"model": "m", "messages": [{"role": "user", "content": "hi"}]}


@pytest.fixture
def mocks() -> Iterator[list[OpenAiMock]]:
    three = [OpenAiMock().start() for _ in range(3)]
    for mock in three:
        mock.will(says("hello"))
    yield three
    for mock in three:
        mock.stop()


def asked(mocks: list[OpenAiMock]) -> list[int]:
    return [len(mock.asked) for mock in mocks]


def gateway(serve: Serve, servers: list[Any], **model: Any) -> str:
    backend = chat_backend(None, base_url="", base_urls=servers, **{"health_check_s": 0, **model})
    return serve(build({"m": backend}).app)


def test_the_less_busy_server_is_asked(serve: Serve, mocks: list[OpenAiMock]) -> None:
    mocks[0].will(says("slow", after_s=1.0))
    url = gateway(serve, [mock.url for mock in mocks], concurrency=30)
    with httpx.Client(timeout=60) as client:
        for _ in range(3):
            client.post(url + PATH, json=HI)
        for _ in range(20):
            client.post(url + PATH, json=HI)
    slow, *quick = asked(mocks)
    assert slow <= 2
    assert sum(quick) >= 21


def test_weights_share_out_what_comes_at_once(serve: Serve, mocks: list[OpenAiMock]) -> None:
    for mock in mocks:
        mock.will(says("hello", after_s=0.5))
    servers = [{"url": mocks[0].url, "weight": 3.0}, mocks[1].url, {"url": mocks[2].url, "weight": 0.0}]
    url = gateway(serve, servers, concurrency=40, affinity=False)

    async def flood() -> list[int]:
        async with httpx.AsyncClient(timeout=60) as client:
            return [r.status_code for r in await asyncio.gather(*(client.post(url + PATH, json=HI) for _ in range(40)))]

    assert asyncio.run(flood()) == [200] * 40
    heavy, light, drained = asked(mocks)
    assert drained == 0
    assert 27 <= heavy <= 33
    assert heavy + light == 40


def test_what_one_server_does_not_take_another_is_asked_at_once(serve: Serve, mocks: list[OpenAiMock]) -> None:
    mocks[0].will(status(503, retry_after="30"))
    dead = f"http://127.0.0.1:{closed_port()}/v1"
    url = gateway(serve, [dead, mocks[0].url, mocks[1].url], retries=0)
    began = time.monotonic()
    assert [post(url, PATH, HI).status_code for _ in range(12)] == [200] * 12
    assert time.monotonic() - began < 5
    assert asked(mocks)[1] == 12


def test_a_server_that_is_found_dead_gets_no_callers_until_it_is_back(serve: Serve, mocks: list[OpenAiMock]) -> None:
    flaky = OpenAiMock().start()
    flaky.will(says("flaky"))
    port = flaky.port
    backend = chat_backend(None, base_url="", base_urls=[flaky.url, mocks[1].url], health_check_s=0.1, slow_start_s=1.0)
    url = serve(build({"m": backend}).app)
    first, _ = backend.upstream.endpoints
    assert post(url, PATH, HI).status_code == 200
    flaky.stop()
    wait_until(lambda: first.unwell != "")
    before = first.asked
    assert [post(url, PATH, HI).status_code for _ in range(5)] == [200] * 5
    assert first.asked == before
    servers = httpx.get(url + "/v1/status", timeout=60).json()["models"]["m"]["servers"]
    assert [server["state"] for server in servers] == ["unwell", "closed"]
    back = OpenAiMock(port=port).start()
    wait_until(lambda: first.unwell == "")
    assert first.ramp < 1.0
    wait_until(lambda: first.ramp == 1.0)
    back.stop()


def test_a_canary_gets_its_share_and_no_more(serve: Serve, mocks: list[OpenAiMock]) -> None:
    servers = [mocks[0].url, {"url": mocks[1].url, "canary": 0.1}]
    url = gateway(serve, servers)
    with httpx.Client(timeout=60) as client:
        for _ in range(60):
            assert client.post(url + PATH, json=HI).status_code == 200
    assert asked(mocks)[:2] == [54, 6]


def test_a_stream_counts_at_its_server_until_it_is_over(serve: Serve, mocks: list[OpenAiMock]) -> None:
    for mock in mocks:
        mock.will(streams("one", "two", pause_s=0.3))
    backend = chat_backend(None, base_url="", base_urls=[mock.url for mock in mocks], health_check_s=0)
    url = serve(build({"m": backend}).app)
    with httpx.stream("POST", url + PATH, json={**HI, "stream": True}, timeout=60) as answer:
        pieces = answer.iter_bytes()
        next(pieces)
        assert sum(endpoint.running for endpoint in backend.upstream.endpoints) == 1
        assert b"[DONE]" in b"".join(pieces)
    wait_until(lambda: sum(endpoint.running for endpoint in backend.upstream.endpoints) == 0)


def prefix_cache(size: int, seen: list[tuple[int, int]]) -> Behaviour:
    """A server that remembers `size` pictures, as a model server's caches do; `seen` are the bytes of pictures that it
    had to look at and those that it got, by question."""
    known: OrderedDict[str, None] = OrderedDict()

    async def behave(request: web.Request, body: dict[str, Any]) -> web.StreamResponse:
        parts = body["messages"][0]["content"]
        pictures = [part["image_url"]["url"] for part in parts if part["type"] == "image_url"]
        seen.append((sum(len(one) for one in pictures if one not in known), sum(map(len, pictures))))
        for one in pictures:
            known[one] = None
            known.move_to_end(one)
        while len(known) > size:
            known.popitem(last=False)
        await asyncio.sleep(0.04)  # as long everywhere, so that what else the machine does matters little
        return await says("seen")(request, body)

    return behave


def episodes(count: int, questions: int) -> list[dict[str, Any]]:
    """Questions about the same five pictures an episode, in an order by chance."""
    header = b"\xff\xd8\xff\xc0\0\x0b\x08\0\x40\0\x40\x01\x01\x11\0"  # as much of a JPEG as is looked at here
    chance = random.Random(3)
    asked = []
    for _ in range(count):
        pictures = [
            "data:image/jpeg;base64," + base64.b64encode(header + chance.randbytes(900)).decode() for _ in range(5)
        ]
        parts = [{"type": "image_url", "image_url": {"url": url}} for url in pictures]
        for question in range(questions):
            text = {"type": "text", "text": f"question {question}"}
            asked.append({"model": "m", "messages": [{"role": "user", "content": [*parts, text]}]})
    chance.shuffle(asked)
    return asked


def share_computed(serve: Serve, mocks: list[OpenAiMock], affinity: bool) -> tuple[float, list[int]]:
    """The share of all picture bytes that some server had to look at anew, and how many questions each got."""
    seen: list[tuple[int, int]] = []
    for mock in mocks:
        mock.will(prefix_cache(30, seen))
    url = gateway(serve, [mock.url for mock in mocks], affinity=affinity)
    with httpx.Client(timeout=60) as client:
        for body in episodes(12, 8):
            assert client.post(url + PATH, json=body).status_code == 200
    return sum(new for new, _ in seen) / sum(all_ for _, all_ in seen), asked(mocks)


def test_an_episode_s_pictures_go_where_they_are_known(serve: Serve, mocks: list[OpenAiMock]) -> None:
    """Against the same without affinity, where questions go to whoever is quickest (12 episodes of 8 questions; each
    server keeps the pictures of 6): each picture is looked at about once instead of once in two or three questions."""
    known, spread = share_computed(serve, mocks, affinity=True)
    scattered, _ = share_computed(serve, mocks, affinity=False)
    assert known < 0.25
    assert scattered > 0.45
    assert min(spread) >= 96 / 12  # each has an episode at least, however slow this machine made it look


def endpoints(count: int) -> list[Endpoint]:
    urls = [f"http://127.0.0.1:{closed_port()}/v1" for _ in range(count)]
    return list(Upstream(chat_settings(None, base_url="", base_urls=urls), None, lambda _: None).endpoints)


def test_affinity_gives_way_where_a_server_is_much_busier_than_the_others() -> None:
    servers = endpoints(3)
    choice = EndpointChoice(servers, affinity=True)
    marks = marks_of([json.dumps(episodes(1, 1)[0]).encode()])
    home = choice.pick("", marks)
    assert home is not None
    home.running = 1
    assert choice.pick("", marks) is home
    home.running = 12
    assert choice.pick("", marks) is not home


def test_turns_of_one_conversation_go_to_one_server_and_conversations_are_spread() -> None:
    choice = EndpointChoice(endpoints(3), affinity=True)
    homes: Counter[str] = Counter()
    for conversation in range(30):
        messages = [{"role": "system", "content": f"you are robot {conversation} " + "x" * 400}]
        picked = set()
        for turn in range(4):
            messages.append({"role": "user", "content": f"turn {turn}"})
            endpoint = choice.pick("", choice.marks([json.dumps({"model": "m", "messages": messages}).encode()]))
            assert endpoint is not None
            picked.add(endpoint.url)
            endpoint.asked += 1
            messages.append({"role": "assistant", "content": "yes"})
        assert len(picked) == 1
        homes.update(picked)
    assert min(homes.values()) > 3


def test_azure_s_way_of_keys_and_versions_is_a_matter_of_configuration(serve: Serve, mocks: list[OpenAiMock]) -> None:
    settings = {"key_header": "api-key", "headers": {"x-org": "drones"}, "query": {"api-version": "2024-10-21"}}
    backend = chat_backend(mocks[0], key="sk-azure", **settings)
    assert post(serve(build({"m": backend}).app), PATH, HI).status_code == 200
    told = mocks[0].asked[0].headers
    assert (told["api-key"], told["x-org"], "authorization" in {name.lower() for name in told}) == (
        "sk-azure",
        "drones",
        False,
    )
    assert mocks[0].asked[0].target == "/v1/chat/completions?api-version=2024-10-21"
