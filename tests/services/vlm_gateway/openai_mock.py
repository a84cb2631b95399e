"""A model server of the OpenAI kind for tests: real HTTP, says what a test tells it to, remembers what it was asked.

    mock.will(says('{"floors": 3}'), status(503, retry_after="1"), says("again"))

Each request takes the next behaviour; the last one is kept for all that follow.
"""

import asyncio
import json
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple, Self

from aiohttp import web

Behaviour = Callable[[web.Request, dict[str, Any]], Awaitable[web.StreamResponse]]


class Asked(NamedTuple):
    """One request: when it came (monotonic seconds), its parsed body, its headers, its path with the query."""

    at_s: float
    body: dict[str, Any]
    headers: dict[str, str]
    target: str = ""


def completion(content: object, **message: Any) -> dict[str, Any]:
    """A chat completion's body; `message` adds to or replaces the message's fields."""
    finish = message.pop("finish_reason", "stop")
    return {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 1_700_000_000,
        "model": "mock",
        "choices": [
            {"index": 0, "message": {"role": "assistant", "content": content, **message}, "finish_reason": finish}
        ],
        "usage": {"prompt_tokens": 100, "completion_tokens": 7, "total_tokens": 107},
    }


def says(content: object, *, after_s: float = 0.0, **message: Any) -> Behaviour:
    """Answers with this content, after a while."""
    return sends(json.dumps(completion(content, **message)).encode(), after_s=after_s)


def says_when(told: threading.Event, content: object) -> Behaviour:
    """Answers with this content once it is told to."""

    async def behave(request: web.Request, body: dict[str, Any]) -> web.StreamResponse:
        await asyncio.to_thread(told.wait, 60)
        return await says(content)(request, body)

    return behave


def sends(body: bytes, *, status: int = 200, kind: str = "application/json", after_s: float = 0.0) -> Behaviour:
    """Answers with these bytes."""

    async def behave(_: web.Request, __: dict[str, Any]) -> web.StreamResponse:
        if after_s:
            await asyncio.sleep(after_s)
        return web.Response(body=body, status=status, content_type=kind)

    return behave


def status(code: int, *, message: str = "no", retry_after: str | None = None) -> Behaviour:
    """Refuses in OpenAI's error shape."""

    async def behave(_: web.Request, __: dict[str, Any]) -> web.StreamResponse:
        headers = {"Retry-After": retry_after} if retry_after is not None else {}
        body = {"error": {"message": message, "type": "mock", "code": None}}
        return web.json_response(body, status=code, headers=headers)

    return behave


def hangs() -> Behaviour:
    """Takes the request and says nothing for a minute."""

    async def behave(_: web.Request, __: dict[str, Any]) -> web.StreamResponse:
        await asyncio.sleep(60)
        return web.Response()

    return behave


def cuts(body: bytes, *, kind: str = "application/json", length: int | None = None) -> Behaviour:
    """Promises `length` bytes (twice what there is, if not given), sends `body`, and drops the connection."""

    async def behave(request: web.Request, _: dict[str, Any]) -> web.StreamResponse:
        response = web.StreamResponse(
            headers={"Content-Type": kind, "Content-Length": str(length or 2 * len(body) + 1)}
        )
        await response.prepare(request)
        await response.write(body)
        assert request.transport is not None
        request.transport.close()
        return response

    return behave


def streams(*words: str, done: bool = True, pause_s: float = 0.0, cut: bool = False) -> Behaviour:
    """Sends each word as an event; ends as servers do if `done`, by dropping the connection if `cut`."""

    async def behave(request: web.Request, _: dict[str, Any]) -> web.StreamResponse:
        response = web.StreamResponse(headers={"Content-Type": "text/event-stream"})
        await response.prepare(request)
        for word in words:
            event = {"object": "chat.completion.chunk", "choices": [{"index": 0, "delta": {"content": word}}]}
            await response.write(b"data: " + json.dumps(event).encode() + b"\n\n")
            await asyncio.sleep(pause_s)
        if done:
            last = {"object": "chat.completion.chunk", "choices": [{"index": 0, "delta": {}, "finish_reason": "stop"}]}
            await response.write(b"data: " + json.dumps(last).encode() + b"\n\ndata: [DONE]\n\n")
        if cut:
            assert request.transport is not None
            request.transport.close()
        return response

    return behave


class OpenAiMock:
    """Runs in a thread of its own between `start` and `stop`."""

    def __init__(self, port: int = 0) -> None:
        self.asked: list[Asked] = []
        self.broken_off = 0
        self._behaviours: deque[Behaviour] = deque([says("hello")])
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._runner: web.AppRunner | None = None
        self.port = port

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/v1"

    def will(self, *behaviours: Behaviour) -> None:
        """Forgets what was asked and behaves like this from now on."""
        self.asked.clear()
        self.broken_off = 0
        self._behaviours = deque(behaviours)

    def start(self) -> Self:
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._serve(), self._loop).result(10)
        return self

    def stop(self) -> None:
        async def clean() -> None:
            if self._runner is not None:
                await self._runner.cleanup()

        asyncio.run_coroutine_threadsafe(clean(), self._loop).result(10)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    async def _serve(self) -> None:
        app = web.Application(client_max_size=64 * 1024 * 1024)
        for route in ("chat/completions", "embeddings", "completions", "responses"):
            app.router.add_post("/v1/" + route, self._answer)
        self._runner = web.AppRunner(app, shutdown_timeout=0.2, handler_cancellation=True)
        await self._runner.setup()
        site = web.TCPSite(self._runner, "127.0.0.1", self.port, reuse_address=True)
        await site.start()
        self.port = self._runner.addresses[0][1]

    async def _answer(self, request: web.Request) -> web.StreamResponse:
        body = json.loads(await request.read())
        self.asked.append(Asked(time.monotonic(), body, dict(request.headers), request.raw_path))
        behave = self._behaviours.popleft() if len(self._behaviours) > 1 else self._behaviours[0]
        try:
            return await behave(request, body)
        except (asyncio.CancelledError, ConnectionError):
            self.broken_off += 1
            raise
