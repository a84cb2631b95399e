"""Redis killed, stopped, full, flushed, wrong: no request fails, none waits long, and it comes back by itself."""

import signal
import subprocess

import httpx
import pytest

from service_kit.settings import BadSetting
from services.vlm_gateway.cache.redis import RedisCache
from tests.conftest import RedisProcess, Serve, free_port
from tests.services.vlm_gateway.kit import build, chat_backend, floors_body, metric, post, wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says

PATH = "/v1/floor-count"


@pytest.fixture
def url(serve: Serve, mock: OpenAiMock, redis_server: RedisProcess) -> str:
    mock.will(says('{"floors": 3}'))
    cache = RedisCache(redis_server.url, ttl_s=0, timeout_s=0.05)
    return serve(build({"m": chat_backend(mock)}, cache=cache).app)


def state(url: str) -> str:
    return str(httpx.get(url + "/v1/status", timeout=60).json()["cache"]["state"])


def asked_until_hit(url: str, shade: int) -> None:
    """A busy machine may take longer than 50 ms for one look-up, so a hit is waited for rather than counted on."""
    wait_until(lambda: post(url, PATH, floors_body(shade)).json()["cache"] == "hit")


def all_answered(url: str, shades: range) -> None:
    """Asks a question per shade."""
    for shade in shades:
        answer = post(url, PATH, floors_body(shade))
        assert (answer.status_code, answer.json()["floors"]) == (200, 3)


def reads_failed(url: str) -> float:
    return metric(url, "vlm_gateway_cache_failures_total", operation="get")


def test_answers_are_kept_in_redis(url: str, redis_server: RedisProcess) -> None:
    asked_until_hit(url, 1)


def test_killed_and_started_again(url: str, redis_server: RedisProcess) -> None:
    asked_until_hit(url, 1)
    redis_server.stop()
    all_answered(url, range(10, 20))
    assert state(url) == "down"
    assert metric(url, "vlm_gateway_cache_failures_total", kind="down") >= 1
    ready = httpx.get(url + "/readyz", timeout=60)
    assert ready.status_code == 200
    assert ready.json()["checks"]["cache"] != "ok"
    redis_server.restart()
    wait_until(lambda: state(url) == "ok")
    asked_until_hit(url, 2)


def test_stopped_in_its_tracks_one_request_waits_and_the_others_do_not_ask(
    url: str, redis_server: RedisProcess
) -> None:
    asked_until_hit(url, 1)
    wait_until(lambda: state(url) == "ok")
    before = reads_failed(url)
    redis_server.process.send_signal(signal.SIGSTOP)
    try:
        all_answered(url, range(10, 30))
        assert state(url) == "down"
        assert reads_failed(url) == before + 1  # one request waited; the other 19 did not ask at all
    finally:
        redis_server.process.send_signal(signal.SIGCONT)
    wait_until(lambda: state(url) == "ok")
    asked_until_hit(url, 1)


def test_full_takes_nothing_more_and_what_it_holds_can_still_be_read(url: str, redis_server: RedisProcess) -> None:
    asked_until_hit(url, 1)
    configure(redis_server, "CONFIG", "SET", "maxmemory-policy", "noeviction")
    configure(redis_server, "CONFIG", "SET", "maxmemory", "1")
    all_answered(url, range(10, 15))
    wait_until(lambda: metric(url, "vlm_gateway_cache_failures_total", operation="put", kind="full") >= 1)
    asked_until_hit(url, 1)


def test_flushed_in_use_asks_anew(url: str, redis_server: RedisProcess, mock: OpenAiMock) -> None:
    asked_until_hit(url, 1)
    asked = len(mock.asked)
    configure(redis_server, "FLUSHALL")
    all_answered(url, range(1, 2))
    assert len(mock.asked) == asked + 1
    asked_until_hit(url, 1)


def test_never_there_at_all_the_gateway_starts_and_answers(serve: Serve, mock: OpenAiMock) -> None:
    mock.will(says('{"floors": 3}'))
    cache = RedisCache(f"redis://127.0.0.1:{free_port()}/0", ttl_s=0)
    url = serve(build({"m": chat_backend(mock)}, cache=cache).app)
    all_answered(url, range(5))
    assert state(url) == "down"


def test_in_replay_a_lost_recording_is_said_and_makes_the_gateway_unready(serve: Serve, mock: OpenAiMock) -> None:
    cache = RedisCache(f"redis://127.0.0.1:{free_port()}/0", ttl_s=0)
    url = serve(build({"m": chat_backend(mock)}, cache=cache, mode="replay").app)
    answer = post(url, PATH, floors_body())
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "cache_unavailable")
    assert httpx.get(url + "/readyz", timeout=60).status_code == 503
    assert mock.asked == []


def test_a_password_is_never_shown(serve: Serve, mock: OpenAiMock) -> None:
    port = free_port()
    cache = RedisCache(f"redis://me:hunter2@127.0.0.1:{port}/0", ttl_s=0)
    url = serve(build({"m": chat_backend(mock)}, cache=cache, mode="replay").app)
    told = [httpx.get(url + page, timeout=60) for page in ("/v1/status", "/readyz", "/metrics")]
    pages = [post(url, PATH, floors_body()), *told]
    assert all("hunter2" not in page.text for page in pages)
    with pytest.raises(BadSetting) as raised:
        RedisCache("tcp://me:hunter2@host", ttl_s=0)
    assert "hunter2" not in str(raised.value)


def configure(server: RedisProcess, *command: str) -> None:
    done = subprocess.run(["redis-cli", "-p", str(server.port), *command], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "OK", done.stdout + done.stderr
