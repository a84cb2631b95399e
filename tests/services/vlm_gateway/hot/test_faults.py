"""Every fault of the table in docs/gateway-faults.md, with its outcome."""

import json
import signal
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from services.vlm_gateway.cache.redis import RedisCache
from tests.conftest import RedisProcess, Serve
from tests.services.vlm_gateway.hot.faults import (
    FAULTS,
    PATH,
    REDIS_FAULTS,
    TIMEOUT_S,
    Fault,
    ask,
    chat,
    cut_at,
    offsets,
    several,
)
from tests.services.vlm_gateway.kit import build, chat_backend, sqlite_cache
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says


@pytest.fixture
def url(serve: Serve, mock: OpenAiMock, tmp_path: Path) -> str:
    return serve(build({"m": chat_backend(mock)}, cache=sqlite_cache(tmp_path)).app)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_of_the_server_has_its_outcome(serve: Serve, mock: OpenAiMock, fault: Fault) -> None:
    mock.will(*fault.behaviours)
    # a limit that only those meet who are meant to, however slow the machine is
    settings = {"timeout_s": TIMEOUT_S} if fault.word == "model_timeout" else {}
    url = serve(build({"m": chat_backend(mock, **settings)}).app)
    seen = ask(url, chat())
    assert (seen.status, seen.word) == (fault.status, fault.word)


def test_nobody_there_is_told_as_unreachable(serve: Serve) -> None:
    url = serve(build({"m": chat_backend(None)}).app)
    for _ in range(8):
        seen = ask(url, chat())
        assert (seen.status, seen.word) == (503, "model_unreachable")
    # its pause may be over by now, and then it is half open
    assert httpx.get(url + "/v1/status", timeout=60).json()["models"]["m"]["breaker"] != "closed"


@pytest.mark.parametrize("offset", offsets())
def test_a_stream_cut_anywhere_says_so_and_is_not_kept(url: str, mock: OpenAiMock, offset: int) -> None:
    mock.will(cut_at(offset), says("hello"))
    answer = httpx.post(url + PATH, json=chat(stream=True), timeout=60)
    assert answer.headers.get("x-cache", "miss") == "miss"
    if answer.status_code == 200:
        said = answer.text.split("\n\ndata: ")[-1]
        assert json.loads(said)["error"]["code"] == "model_unreachable"
    else:  # nothing of it had come
        assert (answer.status_code, answer.json()["error"]["code"]) == (503, "model_unreachable")
    again = httpx.post(url + PATH, json=chat(stream=True), timeout=60)
    assert again.headers.get("x-cache") != "hit"


@pytest.mark.parametrize(("name", "act"), REDIS_FAULTS, ids=[name for name, _ in REDIS_FAULTS])
def test_redis_gone_wrong_fails_no_chat(
    serve: Serve, mock: OpenAiMock, redis_server: RedisProcess, name: str, act: Callable[[RedisProcess], None]
) -> None:
    mock.will(says("hello"))
    url = serve(build({"m": chat_backend(mock)}, cache=RedisCache(redis_server.url, ttl_s=0)).app)
    assert ask(url, chat(seed=-1)).status == 200
    act(redis_server)
    try:
        seen = several(url, 10)
    finally:
        if redis_server.process.poll() is None:
            redis_server.process.send_signal(signal.SIGCONT)
    assert (seen.status, seen.word) == (200, "answered")
