"""`POST /v1/chat/completions`: checked, cached where that is right, and otherwise passed on and back unchanged."""

import asyncio
import time
from typing import NamedTuple

from fastapi.responses import Response
from pydantic_core import to_json
from starlette.types import Receive, Scope, Send

from contracts.errors import ErrorBody, ErrorDetail
from contracts.vlm_gateway import CacheResult
from service_kit.errors import BadQuestion, ServiceError, error_response
from services.vlm_gateway.backends.chat import ChatBackend
from services.vlm_gateway.cache.guard import MAX_VALUE_BYTES, GuardedCache
from services.vlm_gateway.cache.keys import answer_key
from services.vlm_gateway.cache.port import CacheDown
from services.vlm_gateway.chat.request import ChatAsk
from services.vlm_gateway.errors import CacheUnavailable, ModelUnreachable, NotRecorded
from services.vlm_gateway.flights import Flights
from services.vlm_gateway.gateway import Gateway

_ENDS = (b"\ndata: [DONE]", b"\ndata:[DONE]")


class _Found(NamedTuple):
    body: bytes
    recorded: bool


class Passthrough:
    """Chats with the gateway's `chat` back ends. Answers are cached at temperature 0, or where the caller asks for it
    (`wanted`); in replay mode all of them must be recorded."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._flights: Flights[_Found] = Flights()

    async def answer(self, ask: ChatAsk, wanted: bool | None) -> Response:
        """`wanted`: True to cache at any temperature, False never to, None to go by the temperature. Raises
        ServiceError."""
        alias, backend = self._backend(ask.alias)
        cache = self._cache(ask, wanted)
        body = self._body(ask, backend)
        if ask.stream:
            return ChatStream(self, alias, backend, cache, body)
        started = time.perf_counter()
        try:
            found, result = await self._found(alias, backend, cache, body)
        except ServiceError as error:
            self.count(alias, error.code, "off" if cache is None else "miss", started)
            raise
        self.count(alias, "answered", result, started)
        return Response(found, media_type="application/json", headers={"x-cache": result})

    def count(self, alias: str, outcome: str, cache: CacheResult, started: float) -> None:
        self._gateway.metrics.called("chat", "chat", alias, outcome, cache, time.perf_counter() - started)

    def key(self, backend: ChatBackend, body: bytes) -> str:
        return answer_key({"question": "chat", "revision": backend.settings.config.revision}, [body])

    async def look_up(self, key: str, alias: str, cache: GuardedCache) -> bytes | None:
        """Raises NotRecorded or CacheUnavailable in replay mode."""
        try:
            stored = await cache.get(key)
        except CacheDown as error:
            raise CacheUnavailable(f"the recording can't be read: {error}") from None
        if stored is None and cache.mode == "replay":
            message = f"this chat with model {alias!r} is not in the recording at {cache.place}"
            raise NotRecorded(message, details={"key": key})
        return stored

    async def _found(
        self, alias: str, backend: ChatBackend, cache: GuardedCache | None, body: bytes
    ) -> tuple[bytes, CacheResult]:
        if cache is None:
            return await self._ask(alias, backend, body, None, ""), "off"
        key, store = self.key(backend, body), cache

        async def look_up_or_ask() -> _Found:
            if (known := await self.look_up(key, alias, store)) is not None:
                return _Found(known, True)
            return _Found(await self._ask(alias, backend, body, store, key), False)

        landed = await self._flights.share(key, look_up_or_ask)
        return landed.value.body, "hit" if landed.value.recorded or landed.shared else "miss"

    async def _ask(self, alias: str, backend: ChatBackend, body: bytes, cache: GuardedCache | None, key: str) -> bytes:
        completion = await backend.upstream.complete(body)
        if completion.message is None:
            message = f"the server of model {alias!r} sent a reply without a choice"
            raise ModelUnreachable(message, details={"model": alias, "reason": "empty_choices"})
        self._gateway.metrics.spent(alias, completion.tokens)
        if cache is not None and completion.finish_reason in ("stop", "tool_calls"):
            cache.put(key, completion.body)
        return completion.body

    def _backend(self, named: str | None) -> tuple[str, ChatBackend]:
        chats = sorted(alias for alias, backend in self._gateway.backends.items() if isinstance(backend, ChatBackend))
        alias = named or self._gateway.roles.get("parser")
        backend = None if alias is None else self._gateway.backends.get(alias)
        if alias is None or not isinstance(backend, ChatBackend):
            known = ", ".join(chats) or "none; configure one with backend 'chat'"
            why = "no model is named and none has the role 'parser'" if alias is None else f"no chat model {alias!r}"
            if backend is not None:
                why = f"model {alias!r} ({backend.kind}) answers typed questions only"
            raise BadQuestion(f"{why}; chat models: {known}", code="unknown_model", details={"models": chats})
        return alias, backend

    def _cache(self, ask: ChatAsk, wanted: bool | None) -> GuardedCache | None:
        cache = self._gateway.cache
        if cache is None or cache.mode == "replay":
            return cache
        return cache if (ask.deterministic if wanted is None else wanted) else None

    @staticmethod
    def _body(ask: ChatAsk, backend: ChatBackend) -> bytes:
        settings = backend.settings
        body = {**settings.config.extra, **ask.body, "model": settings.config.model}
        limit = body.pop("max_tokens", None) or body.pop("max_completion_tokens", None)
        body.pop("max_completion_tokens", None)
        if limit is not None:
            body[settings.server.max_tokens_field] = limit
        if ask.stream:
            body["stream"] = True
        return to_json(dict(sorted(body.items())))


class ChatStream(Response):
    """A stream of server-sent events, relayed as they come. Everything happens while it is being sent: errors before
    the first event leave as ordinary error answers, one in the middle as a last event; when the client goes away the
    server's stream is closed. A stream is cached whole, with its end seen, or not at all."""

    def __init__(
        self, owner: Passthrough, alias: str, backend: ChatBackend, cache: GuardedCache | None, body: bytes
    ) -> None:
        super().__init__(media_type="text/event-stream")
        self._owner = owner
        self._alias = alias
        self._backend = backend
        self._cache = cache
        self._request = body
        self._started = time.perf_counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        relay = asyncio.ensure_future(self._relay(scope, receive, send))
        leaving = asyncio.ensure_future(gone(receive))
        try:
            await asyncio.wait({relay, leaving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (relay, leaving):
                if not task.done():
                    task.cancel()
            results = await asyncio.gather(relay, leaving, return_exceptions=True)
        if isinstance(results[0], Exception):
            raise results[0]

    async def _relay(self, scope: Scope, receive: Receive, send: Send) -> None:
        result: CacheResult = "off" if self._cache is None else "miss"
        key = self._owner.key(self._backend, self._request)
        started = False
        outcome = "gone"
        try:
            known = None if self._cache is None else await self._owner.look_up(key, self._alias, self._cache)
            if known is not None:
                result, outcome, started = "hit", "answered", True
                await self._start(send, result)
                await send({"type": "http.response.body", "body": known})
                return
            async with self._backend.upstream.stream(self._request) as chunks:
                kept = _Kept()
                async for piece in chunks:
                    if not started:
                        started = True
                        await self._start(send, result)
                    kept.add(piece)
                    await send({"type": "http.response.body", "body": piece, "more_body": True})
            if not kept.finished:
                raise ModelUnreachable(
                    f"the stream of model {self._alias!r} ended before its end",
                    details={"model": self._alias, "reason": "cut"},
                )
            if self._cache is not None and kept.whole is not None:
                self._cache.put(key, kept.whole)
            outcome = "answered"
            await send({"type": "http.response.body", "body": b""})
        except ServiceError as error:
            outcome = error.code
            await self._tell(error, started, scope, receive, send)
        finally:
            self._owner.count(self._alias, outcome, result, self._started)

    async def _start(self, send: Send, result: CacheResult) -> None:
        headers = [
            (b"content-type", b"text/event-stream; charset=utf-8"),
            (b"cache-control", b"no-store"),
            (b"x-cache", result.encode()),
        ]
        await send({"type": "http.response.start", "status": 200, "headers": headers})

    async def _tell(self, error: ServiceError, started: bool, scope: Scope, receive: Receive, send: Send) -> None:
        if not started:
            answer = error_response(error.status, error.code, error.message, error.details, error.headers)
            await answer(scope, receive, send)
            return
        body = ErrorBody(error=ErrorDetail(code=error.code, message=error.message, details=error.details))
        event = b"\n\ndata: " + body.model_dump_json().encode() + b"\n\n"  # first ends whatever line was cut
        await send({"type": "http.response.body", "body": event})


class _Kept:
    """What went by of a stream: whether its end was seen, and all of it where that is small enough to keep."""

    def __init__(self) -> None:
        self.finished = False
        self._pieces: list[bytes] | None = []
        self._size = 0
        self._tail = b"\n"

    def add(self, piece: bytes) -> None:
        self._tail = (self._tail + piece)[-256:]
        self.finished = self.finished or any(end in self._tail for end in _ENDS)
        self._size += len(piece)
        if self._size > MAX_VALUE_BYTES:
            self._pieces = None
        if self._pieces is not None:
            self._pieces.append(piece)

    @property
    def whole(self) -> bytes | None:
        return b"".join(self._pieces) if self.finished and self._pieces is not None else None


async def gone(receive: Receive) -> None:
    """Returns when the client has left. To be asked once the request's body was read."""
    while (await receive())["type"] != "http.disconnect":
        pass
