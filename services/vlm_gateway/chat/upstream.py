"""The wire to one OpenAI-compatible server: deadlines, one retry, bounded replies, and typed errors for everything
that such servers and the proxies in front of them really send."""

import asyncio
import email.utils
import json
import random
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any, NamedTuple, TypeVar

import aiohttp
from pydantic_core import from_json

from contracts.vlm_gateway import Tokens
from service_kit.errors import ServiceError
from services.vlm_gateway.admission import Admission
from services.vlm_gateway.breaker import Breaker
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelOverloaded, ModelRejected, ModelTimeout, ModelUnreachable

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
        self._model = model
        self._alias = model.alias
        self._url = model.base_url + "/chat/completions"
        self._headers = {"Content-Type": "application/json"}
        if key:
            self._headers["Authorization"] = f"Bearer {key}"
        self._secret = key
        self._retried = retried
        self._session: aiohttp.ClientSession | None = None
        self.admission = Admission(model.alias, model.config.concurrency, model.config.queue)
        self.breaker = Breaker(failures=5, pause_s=2.0)

    async def close(self) -> None:
        if self._session is not None:
            await self._session.close()
            self._session = None

    async def complete(self, body: bytes) -> Completion:
        """One whole reply. Raises ModelUnreachable, ModelTimeout, ModelOverloaded or ModelRejected."""
        deadline = time.monotonic() + self._model.config.timeout_s
        try:
            async with asyncio.timeout(self._model.config.timeout_s), self.admission:
                return await self._with_retry(lambda attempt: self._whole(body, attempt), deadline)
        except TimeoutError:
            raise self._too_late() from None

    @asynccontextmanager
    async def stream(self, body: bytes) -> AsyncIterator[AsyncIterator[bytes]]:
        """The server's events as they come, holding a place of the admission all the while. Errors before the first
        byte are as for `complete`; a server that stops in the middle raises ModelUnreachable or ModelTimeout out of
        the iterator."""
        deadline = time.monotonic() + self._model.config.timeout_s
        async with self.admission:
            try:
                async with asyncio.timeout(self._model.config.timeout_s):
                    response = await self._with_retry(lambda attempt: self._open_stream(body, attempt), deadline)
            except TimeoutError:
                raise self._too_late() from None
            try:
                yield self._chunks(response)
            finally:
                response.close()

    async def _whole(self, body: bytes, attempt: int) -> Completion:
        async with await self._open(body) as response:
            return self._read(response, await self._bytes(response, MAX_REPLY_BYTES), attempt)

    async def _open_stream(self, body: bytes, attempt: int) -> aiohttp.ClientResponse:
        response = await self._open(body)
        if response.content_type == "text/event-stream":
            return response
        async with response:  # an error inside a 200, a proxy's page, or a server that knows no streams
            self._read(response, await self._bytes(response, MAX_REPLY_BYTES), attempt)
        raise self._unreachable("it answers a stream with a single reply", "no_stream")

    async def _with_retry(self, work: Callable[[int], Awaitable[T]], deadline: float) -> T:
        """`work(1)` and, where that failed in a way that may pass, `work(2)` after a pause."""
        try:
            return await work(1)
        except (ModelUnreachable, ModelOverloaded) as error:
            pause_s = self._pause_s(error)
            if pause_s is None or time.monotonic() + pause_s >= deadline:
                raise
            self._retried(error.code)
        await asyncio.sleep(pause_s)
        return await work(2)

    async def _open(self, body: bytes) -> aiohttp.ClientResponse:
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
            response = await self._session.post(self._url, data=body, headers=self._headers, allow_redirects=False)
        except aiohttp.ServerTimeoutError:
            self.breaker.failure()
            raise self._unreachable("no connection in time", "connect") from None
        except (aiohttp.ClientError, OSError) as error:
            self.breaker.failure()
            raise self._unreachable(f"no connection ({type(error).__name__})", "connect") from None
        self.breaker.success()
        if response.status == 200:
            return response
        async with response:
            raise self._refusal(response.status, await self._bytes(response, MAX_ERROR_BYTES), response.headers)

    async def _bytes(self, response: aiohttp.ClientResponse, limit: int) -> bytes:
        pieces: list[bytes] = []
        size = 0
        try:
            async for piece in response.content.iter_any():
                pieces.append(piece)
                size += len(piece)
                if size > limit:
                    raise self._unreachable(f"the reply is over {limit} bytes", "too_large")
        except (aiohttp.ClientError, OSError) as error:
            raise self._unreachable(f"the reply broke off ({type(error).__name__})", "cut") from None
        return b"".join(pieces)

    async def _chunks(self, response: aiohttp.ClientResponse) -> AsyncIterator[bytes]:
        """Bounded in time between two pieces, not as a whole: long answers are what streams are for."""
        pieces = response.content.iter_any().__aiter__()
        while True:
            try:
                async with asyncio.timeout(self._model.config.timeout_s):
                    piece = await anext(pieces, None)
            except TimeoutError:
                raise self._too_late() from None
            except (aiohttp.ClientError, OSError) as error:
                raise self._unreachable(f"the stream broke off ({type(error).__name__})", "cut") from None
            if piece is None:
                return
            yield piece

    def _read(self, response: aiohttp.ClientResponse, body: bytes, attempt: int) -> Completion:
        try:
            reply = from_json(body, allow_inf_nan=False)
        except ValueError:
            kind = response.headers.get("Content-Type", "no content type").split(";")[0][:60]
            raise self._unreachable(f"the reply is no JSON ({kind}, {len(body)} bytes)", "not_json") from None
        if not isinstance(reply, dict):
            raise self._unreachable("the reply is no JSON object", "not_json")
        if reply.get("error"):
            raise self._refusal(_status_inside(reply["error"]), body, response.headers)
        choices = reply.get("choices")
        if not isinstance(choices, list):
            raise self._unreachable("the reply is no chat completion: it has no choices", "no_completion")
        first = choices[0] if choices and isinstance(choices[0], dict) else {}
        message = first.get("message")
        finish = first.get("finish_reason")
        return Completion(
            body,
            message if isinstance(message, dict) else None,
            finish if isinstance(finish, str) else None,
            _tokens(reply.get("usage")),
            attempt,
        )

    def _refusal(self, status: int, body: bytes, headers: Mapping[str, str]) -> ServiceError:
        """The typed error of an error reply."""
        details: dict[str, Any] = {"model": self._alias, "upstream_status": status}
        said = self._said(body)
        if said:
            details["upstream_message"] = said
        if status in (408, 504):
            return ModelTimeout(
                f"the server of model {self._alias!r} says it took too long ({status})", details=details
            )
        if status in (429, 503):
            wait_s = retry_after_s(headers.get("Retry-After"))
            if wait_s is not None:
                details["retry_after_s"] = round(wait_s, 3)
            message = f"the server of model {self._alias!r} is overloaded or still loading ({status})"
            return ModelOverloaded(message, retry_after_s=wait_s or 1.0, details=details)
        if 400 <= status < 500:
            ways = {401: "check its api_key", 403: "check its api_key", 404: "check its base_url and model name"}
            way = ways.get(status, "see upstream_message")
            message = f"the server of model {self._alias!r} refuses the request ({status}); {way}"
            return ModelRejected(message, details=details)
        details["reason"] = "status"
        return ModelUnreachable(f"the server of model {self._alias!r} answers with {status}", details=details)

    def _said(self, body: bytes) -> str:
        """The server's own words, short, and never with our key in them."""
        try:
            reply = json.loads(body)
        except (ValueError, RecursionError):
            return ""  # HTML pages of proxies tell nobody anything
        error = reply.get("error", reply) if isinstance(reply, dict) else None
        text = error.get("message") or error.get("detail") if isinstance(error, dict) else error
        said = text[:500] if isinstance(text, str) else ""
        return said.replace(self._secret, "***") if self._secret else said

    def _pause_s(self, error: ServiceError) -> float | None:
        """How long to wait before asking once more; None where asking again is no use."""
        jitter_s = random.uniform(0.05, 0.2)
        if isinstance(error, ModelOverloaded):
            if "upstream_status" not in error.details:
                return None  # our own queue is full
            wait_s = float(error.details.get("retry_after_s", 0.0))
            return wait_s + jitter_s if wait_s <= LONGEST_PAUSE_S else None
        if error.details.get("reason") == "connect" or error.details.get("upstream_status") == 502:
            return jitter_s
        return None

    def _unreachable(self, what: str, reason: str) -> ModelUnreachable:
        message = f"model {self._alias!r} can't be reached: {what}"
        return ModelUnreachable(message, details={"model": self._alias, "reason": reason})

    def _too_late(self) -> ModelTimeout:
        limit_s = self._model.config.timeout_s
        return ModelTimeout(
            f"model {self._alias!r} gave no answer within {limit_s:g} s",
            details={"model": self._alias, "timeout_s": limit_s},
        )


def retry_after_s(value: str | None) -> float | None:
    """Seconds from a Retry-After header, which holds seconds or a date; None where it holds neither."""
    if not value:
        return None
    try:
        return max(0.0, min(float(value), 86_400.0)) if value.strip()[:1].isdigit() else _until(value)
    except ValueError:
        return _until(value)


def _until(value: str) -> float | None:
    try:
        return max(0.0, email.utils.parsedate_to_datetime(value).timestamp() - time.time())
    except (ValueError, TypeError, OverflowError):
        return None


def _status_inside(error: object) -> int:
    """The status that an error inside a 200 stands for."""
    if isinstance(error, dict):
        for name in ("code", "status", "status_code"):
            value = error.get(name)
            if isinstance(value, int) and 400 <= value <= 599:
                return value
            if isinstance(value, str) and value.isdigit() and 400 <= int(value) <= 599:
                return int(value)
        words = f"{error.get('type')} {error.get('code')}".lower()
        if "rate" in words or "overload" in words or "unavailable" in words:
            return 503
        if "invalid" in words or "auth" in words:
            return 400
    return 500


def _tokens(usage: object) -> Tokens:
    if not isinstance(usage, dict):
        return Tokens()
    counts = [usage.get("prompt_tokens"), usage.get("completion_tokens")]
    prompt, completion = (n if isinstance(n, int) and not isinstance(n, bool) and n >= 0 else 0 for n in counts)
    return Tokens(prompt=prompt, completion=completion)
