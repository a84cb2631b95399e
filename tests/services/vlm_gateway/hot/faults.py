"""What can go wrong behind the gateway, one at a time, and what its caller sees of it.

    python -m tests.services.vlm_gateway.hot.faults      tries all of it and writes docs/gateway-faults.md

`test_faults.py` checks every one of them.
"""

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import uvicorn
from aiohttp import web

from service_kit.run import server_config
from services.vlm_gateway.cache.redis import RedisCache
from tests.conftest import RedisProcess, free_port
from tests.services.vlm_gateway.kit import build, chat_backend
from tests.services.vlm_gateway.openai_mock import (
    Behaviour,
    OpenAiMock,
    completion,
    cuts,
    hangs,
    says,
    sends,
    status,
)

PATH = "/v1/chat/completions"
TIMEOUT_S = 2.0
OFFSETS = 20
PAGE = Path(__file__).parents[4] / "docs" / "gateway-faults.md"

CHUNKS = [
    {"object": "chat.completion.chunk", "choices": [{"index": 0, "delta": {"content": word}, "finish_reason": None}]}
    for word in ("The ", "window ", "is ", "lit.")
]
LAST = {"object": "chat.completion.chunk", "choices": [{"index": 0, "delta": {}, "finish_reason": "stop"}]}
STREAM = b"".join(b"data: " + json.dumps(event).encode() + b"\n\n" for event in [*CHUNKS, LAST]) + b"data: [DONE]\n\n"


class Seen(NamedTuple):
    """What the caller saw: `word` is an error's code, or `answered`; the longest of its requests in seconds."""

    status: int
    word: str
    took_s: float


class Fault(NamedTuple):
    name: str
    behaviours: tuple[Behaviour, ...]
    status: int
    word: str
    note: str = ""


def drips(body: bytes, pause_s: float) -> Behaviour:
    """Sends a reply byte by byte."""

    async def behave(request: web.Request, _: dict[str, Any]) -> web.StreamResponse:
        response = web.StreamResponse(headers={"Content-Type": "application/json", "Content-Length": str(len(body))})
        await response.prepare(request)
        for at in range(len(body)):
            await response.write(body[at : at + 1])
            await asyncio.sleep(pause_s)
        return response

    return behave


def babbles(raw: bytes) -> Behaviour:
    """Answers with something that is no HTTP."""

    async def behave(request: web.Request, _: dict[str, Any]) -> web.StreamResponse:
        assert request.transport is not None
        request.transport.write(raw)
        request.transport.close()
        raise ConnectionResetError

    return behave


WHOLE = json.dumps(completion("hello")).encode()
REFUSAL = says(None, refusal="I can't help with that.")
FAULTS = [
    Fault("slow first byte", (hangs(),), 504, "model_timeout", f"the model's `timeout_s` is {TIMEOUT_S:g} s here"),
    Fault("dripping reply", (drips(WHOLE, 0.05),), 504, "model_timeout", "the deadline is for the whole reply"),
    Fault("garbage instead of HTTP", (babbles(b"\x16\x03\x01garbage\r\n\r\n"),), 503, "model_unreachable"),
    Fault("HTML in a 200", (sends(b"<html>login</html>", kind="text/html"),), 503, "model_unreachable"),
    Fault("JSON truncated, length right", (sends(WHOLE[:-20]),), 503, "model_unreachable"),
    Fault("JSON truncated, connection cut", (cuts(WHOLE[:-20]),), 503, "model_unreachable"),
    Fault("empty choices", (sends(json.dumps({**completion("x"), "choices": []}).encode()),), 503, "model_unreachable"),
    Fault(
        "error inside a 200",
        (sends(b'{"error": {"message": "rate limit", "type": "rate_limit_error"}}'), says("hello")),
        200,
        "answered",
        "read as what it says, and asked again",
    ),
    Fault("refusal", (REFUSAL,), 200, "answered", "passed on as it is, never cached"),
    Fault("only reasoning", (says(None, reasoning_content="hm"),), 200, "answered", "passed on as it is, never cached"),
    Fault("429, Retry-After: 1", (status(429, retry_after="1"), says("hello")), 200, "answered", "asked again then"),
    Fault(
        "429, Retry-After: 60",
        (status(429, retry_after="60"),),
        429,
        "rate_limit_exceeded",
        "its Retry-After too",
    ),
    Fault("502 once", (status(502), says("hello")), 200, "answered", "asked again"),
    Fault("400", (status(400, message="bad picture"),), 400, "model_rejected", "with the server's words and its code"),
]


def cut_at(offset: int) -> Behaviour:
    """The stream, broken off after so many bytes."""
    return cuts(STREAM[:offset], kind="text/event-stream", length=len(STREAM) + 10)


def offsets() -> list[int]:
    """Evenly over the stream, its very beginning included and its end left out."""
    return [len(STREAM) * at // OFFSETS for at in range(OFFSETS)]


def chat(**changes: Any) -> dict[str, Any]:
    return {"model": "m", "messages": [{"role": "user", "content": "hello"}], "temperature": 0, **changes}


def ask(url: str, body: dict[str, Any]) -> Seen:
    """One chat. A stream's last event says how it ended."""
    with httpx.Client(base_url=url, timeout=60) as client:
        client.get("/healthz")  # what making a client and a connection costs is not the gateway's
        started = time.perf_counter()
        answer = client.post(PATH, json=body)
        took_s = time.perf_counter() - started
    if answer.status_code != 200:
        return Seen(answer.status_code, answer.json()["error"]["code"], took_s)
    if body.get("stream"):
        events = [line[6:] for line in answer.text.splitlines() if line.startswith("data: ")]
        last = events[-1] if events else ""
        if last != "[DONE]":
            return Seen(200, json.loads(last)["error"]["code"], took_s)
    return Seen(200, "answered", took_s)


def several(url: str, count: int) -> Seen:
    """Different chats one after another: the worst of them."""
    seen = [ask(url, chat(seed=number)) for number in range(count)]
    worst = max(seen, key=lambda one: one.status)
    return Seen(worst.status, worst.word, max(one.took_s for one in seen))


def kill(redis: RedisProcess) -> None:
    redis.stop()


def stop(redis: RedisProcess) -> None:
    redis.process.send_signal(signal.SIGSTOP)


def fill(redis: RedisProcess) -> None:
    for setting in (("maxmemory-policy", "noeviction"), ("maxmemory", "1")):
        _redis(redis, "CONFIG", "SET", *setting)


def flush(redis: RedisProcess) -> None:
    _redis(redis, "FLUSHALL")


REDIS_FAULTS: list[tuple[str, Callable[[RedisProcess], None]]] = [
    ("Redis killed", kill),
    ("Redis stopped (SIGSTOP)", stop),
    ("Redis out of memory", fill),
    ("Redis flushed", flush),
]


def _redis(redis: RedisProcess, *command: str) -> None:
    subprocess.run(["redis-cli", "-p", str(redis.port), *command], check=True, capture_output=True, timeout=60)


@contextmanager
def _gateway(mock: OpenAiMock | None, redis: RedisProcess | None = None) -> Iterator[str]:
    cache = None if redis is None else RedisCache(redis.url, ttl_s=0)
    app = build({"m": chat_backend(mock, timeout_s=TIMEOUT_S if redis is None else 10.0)}, cache=cache).app
    port = free_port()
    server = uvicorn.Server(server_config(app, "127.0.0.1", port, drain_s=2))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(10)


def _cache_in_use(url: str) -> None:
    """Returns once chats are looked up in Redis: on a busy machine its very first reply may have been late."""
    while httpx.get(url + "/v1/status", timeout=60).json()["cache"]["state"] != "ok":
        time.sleep(0.05)


def tried() -> Iterator[tuple[str, str, Seen, str]]:
    """Every fault: its name, whether the chat was streamed, what was seen, a note."""
    with _gateway(None) as url:
        ask(url, chat())
        yield "upstream down", "whole", ask(url, chat()), "one retry included; after five in a row nobody waits"
    mock = OpenAiMock().start()
    try:
        with _gateway(mock) as url:
            yield "nothing, for comparison", "whole", several(url, 20), "the slowest of 20"
        for fault in FAULTS:
            with _gateway(mock) as url:
                mock.will(*fault.behaviours)
                yield fault.name, "whole", ask(url, chat()), fault.note
        for offset in offsets():
            with _gateway(mock) as url:  # one of its own: cut streams open a model's breaker
                mock.will(cut_at(offset))
                seen = ask(url, chat(stream=True))
                yield f"stream cut after {offset} of {len(STREAM)} bytes", "streamed", seen, "not cached"
        mock.will(says("hello"))
        for name, act in REDIS_FAULTS:
            with tempfile.TemporaryDirectory() as folder:
                redis = RedisProcess(Path(folder))
                try:
                    with _gateway(mock, redis) as url:
                        ask(url, chat(seed=-1))
                        _cache_in_use(url)
                        act(redis)
                        yield name, "whole", several(url, 20), "the slowest of the 20 requests that follow"
                finally:
                    with contextlib.suppress(ProcessLookupError):
                        redis.process.send_signal(signal.SIGCONT)
                    redis.stop()
    finally:
        mock.stop()


def main() -> None:
    rows = []
    for name, how, seen, note in tried():
        sys.stderr.write(f"{name}: {seen.status} {seen.word}, {seen.took_s * 1000:.0f} ms\n")
        rows.append(f"| {name} | {how} | {seen.status} `{seen.word}` | {seen.took_s * 1000:.0f} ms | {note} |")
    PAGE.write_text(
        "# What a chat's caller sees when something breaks\n\n"
        "Written by `python -m tests.services.vlm_gateway.hot.faults` over real HTTP, a real redis-server and a mock\n"
        f"model server, with `timeout_s = {TIMEOUT_S:g}`; `tests/services/vlm_gateway/hot/test_faults.py` checks every "
        "row's outcome.\nThe times are this machine's, the caller's and the mock's own share included.\n\n"
        "| what breaks | chat | the caller sees | after | |\n|---|---|---|---|---|\n" + "\n".join(rows) + "\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
