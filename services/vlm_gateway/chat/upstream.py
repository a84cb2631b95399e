"""The wire to one OpenAI-compatible server: deadlines, one retry, bounded replies, and typed errors for everything
that such servers and the proxies in front of them really send."""

import asyncio
import random
import time
from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple, TypeVar

import aiohttp

from contracts.vlm_gateway import Tokens
from service_kit.errors import ServiceError
from services.vlm_gateway.admission import Admission
from services.vlm_gateway.breaker import Breaker
from services.vlm_gateway.chat.dialects import Call
from services.vlm_gateway.chat.replies import Api, ReplyReader
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout, ModelUnreachable

T = TypeVar("T")
MAX_REPLY_BYTES = 8 * 1024 * 1024
MAX_ERROR_BYTES = 64 * 1024
LONGEST_PAUSE_S = 2.0
"""A retry is not put off longer than this; a server that asks for more gets its caller told instead."""


class Completion(NamedTuple):
    """`body` is the server's reply as it came; `message` is its first choice's message, if it has one."""

    body: bytes
    message: dict[str, Any] | None
    finish_reason: str | None
    tokens: Tokens
    attempts: int


class Upstream:
    """One model of one server. Use `close` when done."""

    def __init__(self, model: ChatModel, key: str | None, retried: Callable[[str], None]) -> None:
        self.key = key
        self._model = model
        self._alias = model.alias
        self._headers = {"Content-Type": "application/json"}
        if key:
            self._headers["Authorization"] = f"Bearer {key}"
        self._replies = ReplyReader(model.alias, key)
        self._retried = retried
        self._session: aiohttp.ClientSession | None = None
        self.admission = Admission(model.alias, model.config.concurrency, model.config.queue)
        self.breaker = Breaker(failures=5, pause_s=2.0)

    async def close(self) -> None:
        if self._session is not None:
            await self._session.close()
            self._session = None

    async def ask(self, call: Call) -> Completion:
        """One whole reply. Raises ModelUnreachable, ModelTimeout, ModelOverloaded or ModelRejected."""
        deadline = time.monotonic() + self._model.config.timeout_s
        try:
            async with asyncio.timeout(self._model.config.timeout_s), self.admission:
                return await self._with_retry(lambda attempt: self._whole(call, attempt), deadline)
        except TimeoutError:
            raise self._too_late() from None

    async def _whole(self, call: Call, attempt: int) -> Completion:
        async with await self._open(call.url, call.body) as response:
            return self._read(call.api, response, await self._bytes(response, MAX_REPLY_BYTES), attempt)

    async def _with_retry(self, work: Callable[[int], Awaitable[T]], deadline: float) -> T:
        """`work(1)` and, where that failed in a way that may pass, once more after a pause. A server that is loading
        its model is asked until the deadline."""
        attempt, once_more = 1, True
        while True:
            try:
                return await work(attempt)
            except (ModelUnreachable, ModelOverloaded) as error:
                loading = error.details.get("reason") == "loading"
                pause_s = self._pause_s(error, attempt) if loading or once_more else None
                if pause_s is None or time.monotonic() + pause_s >= deadline:
                    raise
                once_more = once_more and loading
                self._retried(error.code)
            await asyncio.sleep(pause_s)
            attempt += 1

    async def _open(self, url: str, body: bytes) -> aiohttp.ClientResponse:
        """A response with status 200, its body not read yet."""
        if not self.breaker.allow():
            raise ModelUnreachable(
                f"model {self._alias!r} did not answer several times in a row; it is tried again in "
                f"{self.breaker.wait_s:.1f} s",
                details={"model": self._alias, "reason": "breaker_open"},
                headers={"Retry-After": "2"},
            )
        config = self._model.config
        if self._session is None:
            self._session = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=config.concurrency + 4, keepalive_timeout=20.0),
                timeout=aiohttp.ClientTimeout(total=None, sock_connect=config.connect_timeout_s),
                trust_env=False,
            )
        try:
            response = await self._session.post(url, data=body, headers=self._headers, allow_redirects=False)
        except aiohttp.ServerTimeoutError:
            self.breaker.failure()
            raise self._replies.unreachable("no connection in time", "connect") from None
        except (aiohttp.ClientError, OSError) as error:
            self.breaker.failure()
            raise self._replies.unreachable(f"no connection ({type(error).__name__})", "connect") from None
        self.breaker.success()
        if response.status == 200:
            return response
        async with response:
            raise self._replies.refusal(response.status, await self._bytes(response, MAX_ERROR_BYTES), response.headers)

    async def _bytes(self, response: aiohttp.ClientResponse, limit: int) -> bytes:
        pieces: list[bytes] = []
        size = 0
        try:
            async for piece in response.content.iter_any():
                pieces.append(piece)
                size += len(piece)
                if size > limit:
                    raise self._replies.unreachable(f"the reply is over {limit} bytes", "too_large")
        except (aiohttp.ClientError, OSError) as error:
            raise self._replies.unreachable(f"the reply broke off ({type(error).__name__})", "cut") from None
        return b"".join(pieces)

    def _read(self, api: Api, response: aiohttp.ClientResponse, body: bytes, attempt: int) -> Completion:
        said = self._replies.said(api, body, response.headers)
        return Completion(body, said.message, said.finish_reason, said.tokens, attempt)

    @staticmethod
    def _pause_s(error: ServiceError, attempt: int) -> float | None:
        """How long to wait before asking again; None where that is no use."""
        jitter_s = random.uniform(0.05, 0.2)
        if error.details.get("reason") == "loading":
            wait_s = min(LONGEST_PAUSE_S, 0.2 * 2.0 ** min(attempt, 8))
            return max(wait_s, float(error.details.get("retry_after_s", 0.0))) + jitter_s
        if isinstance(error, ModelOverloaded):
            if "upstream_status" not in error.details:
                return None  # our own queue is full
            wait_s = float(error.details.get("retry_after_s", 0.0))
            return wait_s + jitter_s if wait_s <= LONGEST_PAUSE_S else None
        if error.details.get("reason") == "connect" or error.details.get("upstream_status") == 502:
            return jitter_s
        return None

    def _too_late(self) -> ModelTimeout:
        limit_s = self._model.config.timeout_s
        return ModelTimeout(
            f"model {self._alias!r} gave no answer within {limit_s:g} s",
            details={"model": self._alias, "timeout_s": limit_s},
        )
