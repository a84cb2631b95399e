"""One chat model's server as the pass-through sees it: bounded concurrency, a breaker, retries within a budget."""

import asyncio
import random
import ssl
from collections.abc import Awaitable, Callable, Sequence
from typing import NamedTuple, TypeVar
from urllib.parse import urlsplit

from pydantic_core import to_json

from service_kit.errors import ServiceError
from services.vlm_gateway.admission import Admission
from services.vlm_gateway.chat.replies import ReplyReader, Said
from services.vlm_gateway.chat.upstream import Upstream
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout, ModelUnreachable
from services.vlm_gateway.hot.http1 import BrokenReply, Buffer, Pool, Server, Stream
from services.vlm_gateway.hot.scan import Wanted

T = TypeVar("T")
MAX_REPLY_BYTES = 8 * 1024 * 1024
LONGEST_PAUSE_S = 2.0
"""A retry is not put off longer than this; a server that asks for more gets its caller told instead."""
RETRY_SHARE = 0.2
RETRY_RESERVE = 10.0


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

    def take(self) -> bool:
        if self.left < 1.0:
            return False
        self.left -= 1.0
        return True


class Target:
    """`shared`: what typed questions to this model go through; its key, its places and its breaker are used here too.
    `retried` is told of every retry."""

    def __init__(self, model: ChatModel, shared: Upstream, retried: Callable[[str], None]) -> None:
        key = shared.key
        self.alias = model.alias
        self.provider = model.config.server
        self.model = model
        self.wanted = Wanted(to_json(model.config.model), model.server.max_tokens_field, model.config.extra)
        self.fallbacks = model.config.fallbacks
        self.admission = shared.admission
        self.breaker = shared.breaker
        self.budget = RetryBudget()
        self._timeout_s = model.config.timeout_s
        self._retried = retried
        self._replies = ReplyReader(model.alias, key)
        url = urlsplit(model.base_url + "/chat/completions")
        secure = url.scheme == "https"
        host, port = url.hostname or "", url.port or (443 if secure else 80)
        tls = ssl.create_default_context() if secure else None
        self._pool = Pool(Server(host, port, tls), connect_timeout_s=model.config.connect_timeout_s)
        lines = [f"POST {url.path} HTTP/1.1", f"host: {url.netloc}", "content-type: application/json"]
        lines += ["user-agent: logisticsvln", *([f"authorization: Bearer {key}"] if key else [])]
        self._head = "\r\n".join([*lines, "content-length: "]).encode()

    @property
    def fingerprint(self) -> list[object]:
        """What of the configuration an answer depends on."""
        config = self.model.config
        return [config.model, config.revision, config.extra, self.wanted.limit_field]

    def close(self) -> None:
        self._pool.close()

    def no_choice(self) -> ModelUnreachable:
        """The error of a reply without a choice."""
        return self._replies.unreachable("it sent a reply without a choice", "empty_choices")

    async def whole(self, body: Sequence[Buffer], trace: bytes | None) -> Answer:
        """One whole reply. Raises ModelUnreachable, ModelTimeout, ModelOverloaded or ModelRejected."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + self._timeout_s
        request = self._request(body, trace)
        await self._enter(deadline)
        try:
            return await self._with_retries(lambda: self._whole(request, deadline), deadline)
        finally:
            self.admission.leave()

    async def stream(self, body: Sequence[Buffer], trace: bytes | None) -> "Opened":
        """The reply's head and a way to its events. Raises as `whole` does."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + self._timeout_s
        request = self._request(body, trace)
        await self._enter(deadline)
        try:
            stream = await self._with_retries(lambda: self._stream(request, deadline), deadline)
        except BaseException:
            self.admission.leave()
            raise
        return Opened(stream, self.alias, self._replies, self._timeout_s, self.admission)

    def _request(self, body: Sequence[Buffer], trace: bytes | None) -> list[Buffer]:
        head = self._head + str(sum(map(len, body))).encode()
        if trace is not None:
            head += b"\r\ntraceparent: " + trace
        return [head + b"\r\n\r\n", *body]

    async def _enter(self, deadline: float) -> None:
        try:
            await self.admission.enter(deadline)
        except TimeoutError:
            raise _late(self.alias, self._timeout_s) from None

    async def _with_retries(self, work: Callable[[], Awaitable[T]], deadline: float) -> T:
        self.budget.asked()
        attempt = 1
        while True:
            try:
                return await work()
            except (ModelUnreachable, ModelOverloaded) as error:
                pause_s = None if attempt > self.model.config.retries else self._pause_s(error, attempt)
                if pause_s is None or asyncio.get_running_loop().time() + pause_s >= deadline or not self.budget.take():
                    raise
                self._retried(error.code)
            await asyncio.sleep(pause_s)
            attempt += 1

    def _pause_s(self, error: ServiceError, attempt: int) -> float | None:
        """How long to wait before asking once more; None where asking again is no use."""
        backoff_s = random.uniform(0.05, 0.2) * 2.0 ** (attempt - 1)
        if isinstance(error, ModelOverloaded):
            wait_s = float(error.details.get("retry_after_s", 0.0))
            return wait_s + backoff_s if wait_s <= LONGEST_PAUSE_S else None
        if error.details.get("reason") in ("connect", "no_reply") or error.details.get("upstream_status") == 502:
            return backoff_s
        return None

    async def _whole(self, request: list[Buffer], deadline: float) -> Answer:
        self._allowed()
        try:
            status, headers, body = await self._pool.whole(request, deadline, MAX_REPLY_BYTES)
        except BrokenReply as broken:
            raise self._broken(broken) from None
        told = _told(headers)
        if status != 200:
            raise self._refused(status, body, told)
        self.breaker.success()
        return Answer(body, self._replies.said("openai", body, told))

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
