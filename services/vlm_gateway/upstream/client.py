"""One model behind one server: bounded concurrency, a breaker, retries within a budget, and typed errors for everything
that such servers and the proxies in front of them really send. Typed questions and chats passed on share all of it."""

import asyncio
import random
import ssl
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar
from urllib.parse import urlsplit

from pydantic_core import to_json

from contracts.vlm_gateway import Tokens
from service_kit.errors import ServiceError
from services.vlm_gateway.admission import Admission
from services.vlm_gateway.breaker import Breaker
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout, ModelUnreachable
from services.vlm_gateway.upstream.connection import BrokenReply, Buffer, Stream
from services.vlm_gateway.upstream.pool import Pool, Server
from services.vlm_gateway.upstream.replies import Api, ReplyReader, Said

T = TypeVar("T")
MAX_REPLY_BYTES = 8 * 1024 * 1024
LONGEST_PAUSE_S = 2.0
"""A retry is not put off longer than this; a server that asks for more gets its caller told instead."""
RETRY_SHARE = 0.2
RETRY_RESERVE = 10.0


class Call(NamedTuple):
    """A typed question as it goes over the wire: `api` says how the reply is to be read."""

    api: Api
    url: str
    body: bytes


class Wanted(NamedTuple):
    """What a target makes of a chat request: its model's name as JSON, its name for the length limit, fields to add
    where the client does not give them."""

    model_json: bytes
    limit_field: str
    extra: Mapping[str, Any]


class Answer(NamedTuple):
    """`body` is the server's reply as it came."""

    body: bytes
    said: Said


class RetryBudget:
    """At most one retry in five requests, and ten at once: a server that is down is not asked twice as often."""

    def __init__(self) -> None:
        self.left = RETRY_RESERVE

    def asked(self) -> None:
        self.left = min(RETRY_RESERVE, self.left + RETRY_SHARE)

    def took(self) -> None:
        self.left = max(0.0, self.left - 1.0)


class Completion(NamedTuple):
    """`body` is the server's reply as it came; `message` is its first choice's message, if it has one."""

    body: bytes
    message: dict[str, Any] | None
    finish_reason: str | None
    tokens: Tokens
    attempts: int


class Upstream:
    """`retried` is told of every retry. Use `close` when done."""

    def __init__(self, model: ChatModel, key: str | None, retried: Callable[[str], None]) -> None:
        self.alias = model.alias
        self.model = model
        self.provider = model.config.server
        self.wanted = Wanted(to_json(model.config.model), model.server.max_tokens_field, model.config.extra)
        self.fallbacks = model.config.fallbacks
        self.admission = Admission(model.alias, model.config.concurrency, model.config.queue)
        self.breaker = Breaker(failures=5, pause_s=2.0)
        self.budget = RetryBudget()
        self._timeout_s = model.config.timeout_s
        self._retried = retried
        self._replies = ReplyReader(model.alias, key)
        url = urlsplit(model.base_url)
        secure = url.scheme == "https"
        host, port = url.hostname or "", url.port or (443 if secure else 80)
        tls = ssl.create_default_context() if secure else None
        self._pool = Pool(Server(host, port, tls), connect_timeout_s=model.config.connect_timeout_s)
        self._chats = url.path + "/chat/completions"
        lines = [" HTTP/1.1", f"host: {url.netloc}", "content-type: application/json", "user-agent: logisticsvln"]
        lines += [f"authorization: Bearer {key}"] if key else []
        self._head = "\r\n".join([*lines, "content-length: "]).encode()

    @property
    def fingerprint(self) -> list[object]:
        """What of the configuration an answer depends on."""
        config = self.model.config
        return [config.model, config.revision, config.extra, self.wanted.limit_field]

    async def close(self) -> None:
        self._pool.close()

    def no_choice(self) -> ModelUnreachable:
        """The error of a reply without a choice."""
        return self._replies.unreachable("it sent a reply without a choice", "empty_choices")

    async def ask(self, call: Call) -> Completion:
        """One whole reply to a typed question; a server that is loading its model is waited for. Raises
        ModelUnreachable, ModelTimeout, ModelOverloaded or ModelRejected."""
        attempts = 0

        async def once(request: list[Buffer], deadline: float) -> Completion:
            nonlocal attempts
            attempts += 1
            body, said = await self._whole(request, deadline, call.api)
            tokens = Tokens(prompt=said.tokens.prompt, completion=said.tokens.completion)
            return Completion(body, said.message, said.finish_reason, tokens, attempts)

        return await self._admitted(self._request(urlsplit(call.url).path, [call.body], None), once, patient=True)

    async def whole(self, body: Sequence[Buffer], trace: bytes | None) -> Answer:
        """One whole reply to a chat in OpenAI's form. Raises as `ask` does."""
        return await self._admitted(self._request(self._chats, body, trace), self._whole)

    async def stream(self, body: Sequence[Buffer], trace: bytes | None) -> "Opened":
        """The reply's head and a way to its events; its place is held until that is closed. Raises as `ask` does."""
        stream = await self._admitted(self._request(self._chats, body, trace), self._stream, keep=True)
        return Opened(stream, self.alias, self._replies, self._timeout_s, self.admission)

    async def _admitted(
        self,
        request: list[Buffer],
        once: Callable[[list[Buffer], float], Awaitable[T]],
        *,
        patient: bool = False,
        keep: bool = False,
    ) -> T:
        """`once`, with a place of the model's and as often as it takes; the place is kept where asked for."""
        deadline = asyncio.get_running_loop().time() + self._timeout_s
        try:
            await self.admission.enter(deadline)
        except TimeoutError:
            raise _late(self.alias, self._timeout_s) from None
        left = False
        try:
            result = await self._with_retries(request, once, deadline, patient)
            left = keep
            return result
        finally:
            if not left:
                self.admission.leave()

    def _request(self, path: str, body: Sequence[Buffer], trace: bytes | None) -> list[Buffer]:
        head = b"POST " + path.encode() + self._head + str(sum(map(len, body))).encode()
        if trace is not None:
            head += b"\r\ntraceparent: " + trace
        return [head + b"\r\n\r\n", *body]

    async def _with_retries(
        self,
        request: list[Buffer],
        once: Callable[[list[Buffer], float], Awaitable[T]],
        deadline: float,
        patient: bool,
    ) -> T:
        self.budget.asked()
        attempt = again = 0
        while True:
            attempt += 1
            try:
                return await once(request, deadline)
            except (ModelUnreachable, ModelOverloaded) as error:
                if patient and error.details.get("reason") == "loading":
                    pause_s: float | None = _loading_pause_s(error, attempt)
                elif again < self.model.config.retries and self.budget.left >= 1.0:
                    again += 1
                    pause_s = _pause_s(error, again)
                else:
                    pause_s = None
                if pause_s is None or asyncio.get_running_loop().time() + pause_s >= deadline:
                    raise
                self.budget.took()
                self._retried(error.code)
            await asyncio.sleep(pause_s)

    async def _whole(self, request: list[Buffer], deadline: float, api: Api = "openai") -> Answer:
        self._allowed()
        try:
            status, headers, body = await self._pool.whole(request, deadline, MAX_REPLY_BYTES)
        except BrokenReply as broken:
            raise self._broken(broken) from None
        told = _told(headers)
        if status != 200:
            raise self._refused(status, body, told)
        self.breaker.success()
        return Answer(body, self._replies.said(api, body, told))

    async def _stream(self, request: list[Buffer], deadline: float) -> Stream:
        self._allowed()
        try:
            stream = await self._pool.stream(request, deadline)
            told = _told(stream.headers)
            if stream.status == 200 and told["Content-Type"].startswith("text/event-stream"):
                self.breaker.success()
                return stream
            body = await stream.rest(deadline, MAX_REPLY_BYTES)
        except BrokenReply as broken:
            raise self._broken(broken) from None
        if stream.status != 200:
            raise self._refused(stream.status, body, told)
        # an error inside a 200, a proxy's page, or a server that knows no streams
        self._replies.said("openai", body, told)
        raise self._replies.unreachable("it answers a stream with a single reply", "no_stream")

    def _allowed(self) -> None:
        if not self.breaker.allow():
            message = (
                f"model {self.alias!r} did not answer several times in a row; it is tried again in "
                f"{self.breaker.wait_s:.1f} s"
            )
            details: dict[str, object] = {"model": self.alias, "reason": "breaker_open"}
            raise ModelUnreachable(message, details=details, headers={"Retry-After": "2"})

    def _broken(self, broken: BrokenReply) -> ServiceError:
        self.breaker.failure()
        if broken.reason == "late":
            return _late(self.alias, self._timeout_s)
        return self._replies.unreachable(str(broken), broken.reason)

    def _refused(self, status: int, body: bytes, told: dict[str, str]) -> ServiceError:
        if status >= 500 and status != 503:
            self.breaker.failure()
        else:
            self.breaker.success()
        return self._replies.refusal(status, body, told)


class Opened:
    """A stream of events under way; it holds its model's place until it is closed."""

    def __init__(
        self, stream: Stream, alias: str, replies: ReplyReader, timeout_s: float, admission: Admission
    ) -> None:
        self._stream = stream
        self._alias = alias
        self._replies = replies
        self._timeout_s = timeout_s
        self._admission: Admission | None = admission

    async def piece(self) -> bytes:
        """What has come since; empty at the end. Bounded in time between two pieces, not as a whole: long answers are
        what streams are for. Raises ModelUnreachable or ModelTimeout."""
        try:
            return await self._stream.piece(asyncio.get_running_loop().time() + self._timeout_s)
        except BrokenReply as broken:
            if broken.reason == "late":
                raise _late(self._alias, self._timeout_s) from None
            raise self._replies.unreachable("the stream broke off", "cut") from None

    def cut(self) -> ModelUnreachable:
        """The error of a stream without its end."""
        return self._replies.unreachable("the stream ended before its end", "cut")

    def close(self) -> None:
        """Break off what is left, or give back what is through."""
        self._stream.close()
        if self._admission is not None:
            self._admission.leave()
            self._admission = None


def _told(headers: dict[bytes, bytes]) -> dict[str, str]:
    """The headers that say something about the reply."""
    kind, wait = headers.get(b"content-type", b""), headers.get(b"retry-after", b"")
    return {"Content-Type": kind.decode("latin-1"), "Retry-After": wait.decode("latin-1")}


def _late(alias: str, limit_s: float) -> ModelTimeout:
    details: dict[str, object] = {"model": alias, "timeout_s": limit_s}
    return ModelTimeout(f"model {alias!r} gave no answer within {limit_s:g} s", details=details)


def _loading_pause_s(error: ServiceError, attempt: int) -> float:
    """How long to wait for a server that is loading its model."""
    wait_s = min(LONGEST_PAUSE_S, 0.2 * 2.0 ** min(attempt, 8))
    return max(wait_s, float(error.details.get("retry_after_s", 0.0))) + random.uniform(0.05, 0.2)


def _pause_s(error: ServiceError, again: int) -> float | None:
    """How long to wait before asking again; None where that is no use."""
    backoff_s = random.uniform(0.05, 0.2) * 2.0 ** (again - 1)
    if isinstance(error, ModelOverloaded):
        wait_s = float(error.details.get("retry_after_s", 0.0))
        return wait_s + backoff_s if wait_s <= LONGEST_PAUSE_S else None
    if error.details.get("reason") in ("connect", "no_reply") or error.details.get("upstream_status") == 502:
        return backoff_s
    return None
