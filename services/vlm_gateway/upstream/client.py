"""One model behind one server: bounded concurrency, a breaker, retries within a budget, and typed errors for everything
that such servers and the proxies in front of them really send. Typed questions and chats passed on share all of it."""

import asyncio
import logging
import re
import ssl
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, NamedTuple, TypeVar
from urllib.parse import urlsplit

from pydantic_core import to_json

from contracts.vlm_gateway import Tokens
from services.vlm_gateway.admission import Admission
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelError, ModelOverloaded, ModelRejected, ModelTimeout, ModelUnreachable
from services.vlm_gateway.keys import asking
from services.vlm_gateway.upstream import health
from services.vlm_gateway.upstream.accepted import accepted
from services.vlm_gateway.upstream.http_reply import BrokenReply, Buffer, Stream
from services.vlm_gateway.upstream.pool import Pool, Server
from services.vlm_gateway.upstream.replies import Api, ReplyReader, Said, said_in
from services.vlm_gateway.upstream.retries import RetryBudget, loading_pause_s, retry_pause_s
from services.vlm_gateway.upstream.stream import ChatStream, late

T = TypeVar("T")
log = logging.getLogger(__name__)
_COUNTING = re.compile(r"stream_options|include_usage")
MAX_REPLY_BYTES = 8 * 1024 * 1024


class Call(NamedTuple):
    """A typed question as it goes over the wire: `api` says how the reply is to be read."""

    api: Api
    url: str
    body: bytes


class Answer(NamedTuple):
    """`body` is the server's reply as it came."""

    body: bytes
    said: Said


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
        self.accepts = accepted(model, to_json(model.config.model))
        self.fallbacks = model.config.fallbacks
        self.fallback_after = frozenset(model.config.fallback_after)
        self.admission = Admission(model.alias, model.config.concurrency, model.config.queue)
        self.health = health.ServerHealth()
        self.budget = RetryBudget()
        self._timeout_s = model.config.timeout_s
        self._retried = retried
        self._replies = ReplyReader(model.alias, key)
        url = urlsplit(model.base_url)
        secure = url.scheme == "https"
        host, port = url.hostname or "", url.port or (443 if secure else 80)
        tls = ssl.create_default_context() if secure else None
        self._pool = Pool(
            Server(host, port, tls),
            connect_timeout_s=model.config.connect_timeout_s,
            resend_unanswered=model.config.resend_unanswered,
        )
        self._again = ("connect", "not_sent", "no_reply") if model.config.resend_unanswered else ("connect", "not_sent")
        self._chats = url.path + "/chat/completions"
        lines = [" HTTP/1.1", f"host: {url.netloc}", "content-type: application/json", "user-agent: logisticsvln"]
        lines += [f"authorization: Bearer {key}"] if key else []
        self._head = "\r\n".join([*lines, "content-length: "]).encode()

    @property
    def fingerprint(self) -> list[object]:
        """What of the configuration an answer depends on."""
        config = self.model.config
        return [config.model, config.revision, config.extra, self.accepts.fingerprint]

    async def close(self) -> None:
        self._pool.close()

    def no_choice(self) -> ModelUnreachable:
        """The error of a reply without a choice."""
        return self._replies.unreachable("it sent a reply without a choice", "empty_choices")

    def refuses_to_count(self, error: ModelRejected) -> bool:
        """Whether the server refused a request because it was asked to count a stream's tokens; then it isn't again."""
        if not _COUNTING.search(error.message):
            return False
        log.warning("the server of model %r takes no stream_options: its streams are estimated", self.alias)
        self.accepts = self.accepts._replace(counts_streams=False)
        return True

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

    async def whole(self, body: Sequence[Buffer], trace: bytes | None, sending: Callable[[], None]) -> Answer:
        """One whole reply to a chat in OpenAI's form; `sending` is told when the server is about to be asked. Raises as
        `ask` does."""

        async def once(request: list[Buffer], deadline: float) -> Answer:
            sending()
            return await self._whole(request, deadline)

        return await self._admitted(self._request(self._chats, body, trace), once)

    async def stream(
        self, body: Sequence[Buffer], trace: bytes | None, sending: Callable[[], None], *, without_usage: bool
    ) -> ChatStream:
        """The reply once there is something in it for the caller; its place is held until that is closed. Raises as
        `ask` does."""

        async def once(request: list[Buffer], deadline: float) -> ChatStream:
            sending()
            return await self._stream(request, deadline, without_usage)

        stream = await self._admitted(self._request(self._chats, body, trace), once, keep=True)
        stream.hold(self.admission)
        return stream

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
            raise late(self.alias, self._timeout_s) from None
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
                    pause_s: float | None = loading_pause_s(error, attempt)
                elif again < self.model.config.retries and self.budget.left >= 1.0:
                    again += 1
                    pause_s = retry_pause_s(error, again, self._again)
                else:
                    pause_s = None
                if pause_s is None or asyncio.get_running_loop().time() + pause_s >= deadline:
                    raise
                self.budget.took()
                self._retried(error.code)
            await asyncio.sleep(pause_s)

    async def _whole(self, request: list[Buffer], deadline: float, api: Api = "openai") -> Answer:
        with self._call() as call:
            try:
                status, headers, body = await self._pool.whole(request, deadline, MAX_REPLY_BYTES)
            except BrokenReply as broken:
                raise self._broken(broken, call) from None
            told = said_in(headers)
            try:
                if status != 200:
                    raise self._replies.refusal(status, body, told)
                said = self._replies.said(api, body, told)
            except ModelError as error:
                _learn(error, call)
                raise
            call.succeeded()
            return Answer(self._replies.masked(body), said)

    async def _stream(self, request: list[Buffer], deadline: float, without_usage: bool) -> ChatStream:
        call = self._call()
        opened: Stream | ChatStream | None = None
        begun = False
        try:
            stream = opened = await self._pool.stream(request, deadline)
            told = said_in(stream.headers)
            if stream.status != 200 or not told["Content-Type"].startswith("text/event-stream"):
                raise self._no_stream(stream.status, await stream.rest(deadline, MAX_REPLY_BYTES), told)
            opened = ChatStream(
                stream,
                self._replies,
                call,
                alias=self.alias,
                timeout_s=self._timeout_s,
                without_usage=without_usage,
            )
            await opened.begin(deadline)
            begun = True
            return opened
        except BrokenReply as broken:
            raise self._broken(broken, call) from None
        except ModelError as error:
            _learn(error, call)
            raise
        finally:
            if not begun:
                if opened is not None:
                    opened.close()
                call.close()

    def _no_stream(self, status: int, body: bytes, told: dict[str, str]) -> ModelError:
        """What a reply is that is no stream: an error with its status or inside a 200, a proxy's page, or the answer of
        a server that knows no streams."""
        if status != 200:
            return self._replies.refusal(status, body, told)
        try:
            self._replies.said("openai", body, told)
        except ModelError as error:
            return error
        return self._replies.unreachable("it answers a stream with a single reply", "no_stream")

    def _call(self) -> health.Call:
        """A call to the server, where it is to be asked at all. Raises ModelUnreachable."""
        caller = asking.get().name
        if self.health.allow(caller):
            return self.health.call(caller)
        wait_s = self.health.wait_s(caller)
        message = f"model {self.alias!r} did not answer several times in a row; it is tried again in {wait_s:.1f} s"
        details: dict[str, object] = {"model": self.alias, "reason": "breaker_open"}
        raise ModelUnreachable(message, details=details, headers={"Retry-After": "2"})

    def _broken(self, broken: BrokenReply, call: health.Call) -> ModelError:
        call.failed("server" if broken.reason in ("connect", "not_sent") else "request")
        if broken.reason == "late":
            return late(self.alias, self._timeout_s)
        return self._replies.unreachable(str(broken), broken.reason)


def _learn(error: ModelError, call: health.Call) -> None:
    """A server that refuses a request, or is busy, is alive."""
    if isinstance(error, ModelUnreachable | ModelTimeout):
        call.failed("request")
    else:
        call.succeeded()
