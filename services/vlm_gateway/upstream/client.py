"""One model behind one server: bounded concurrency, a breaker, retries within a budget, and typed errors for everything
that such servers and the proxies in front of them really send. Typed questions and chats passed on share all of it."""

import asyncio
import logging
import re
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, NamedTuple, TypeVar
from urllib.parse import urlsplit

from pydantic_core import to_json

from contracts.vlm_gateway import Tokens
from service_kit.running_loop import running_loop
from services.vlm_gateway.admission import Admission, Places
from services.vlm_gateway.breaker import State
from services.vlm_gateway.config import ChatModel
from services.vlm_gateway.errors import ModelError, ModelOverloaded, ModelRejected, ModelTimeout, ModelUnreachable
from services.vlm_gateway.keys import asking
from services.vlm_gateway.upstream import health
from services.vlm_gateway.upstream.accepted import accepted
from services.vlm_gateway.upstream.attempt import Attempt, Request
from services.vlm_gateway.upstream.choice import EndpointChoice, Mark
from services.vlm_gateway.upstream.endpoint import Endpoint
from services.vlm_gateway.upstream.forms import CHAT, Form
from services.vlm_gateway.upstream.http_reply import BrokenReply, Buffer, Stream
from services.vlm_gateway.upstream.probing import Prober
from services.vlm_gateway.upstream.replies import Answer, Api, ReplyReader, said_in
from services.vlm_gateway.upstream.retries import RetryBudget, loading_pause_s, retry_pause_s
from services.vlm_gateway.upstream.stream import ChatStream, late, may_be_stream

T = TypeVar("T")
log = logging.getLogger(__name__)
_COUNTING = re.compile(r"stream_options|include_usage")
MAX_REPLY_BYTES = 8 * 1024 * 1024


class Call(NamedTuple):
    """A typed question as it goes over the wire: `api` says how the reply is to be read."""

    api: Api
    url: str
    body: bytes


class Completion(NamedTuple):
    """`body` is the server's reply as it came; `message` is its first choice's message, if it has one."""

    body: bytes
    message: dict[str, Any] | None
    finish_reason: str | None
    tokens: Tokens
    attempts: int


class Upstream:
    """`retried` is told of every retry; `places` are those of all workers, where there are several. Use `close` when
    done."""

    def __init__(
        self, model: ChatModel, key: str | None, retried: Callable[[str], None], places: Places | None = None
    ) -> None:
        self.alias = model.alias
        self.model = model
        self.provider = model.config.server
        self.accepts = accepted(model, to_json(model.config.model))
        self.fallbacks = model.config.fallbacks
        self.fallback_after = frozenset(model.config.fallback_after)
        self.admission = Admission(model.alias, model.config.concurrency, model.config.queue, places)
        self.endpoints = tuple(Endpoint(server, model, key) for server in model.servers)
        self.choice = EndpointChoice(self.endpoints, affinity=model.config.affinity)
        watched = self.endpoints if len(self.endpoints) > 1 else ()
        self._prober = Prober(watched, model.config.health_check_s, min(5.0, model.config.connect_timeout_s))
        self.budget = RetryBudget()
        self._timeout_s = model.config.timeout_s
        self._retried = retried
        self._replies = ReplyReader(model.alias, key)
        self._again = ("connect", "not_sent", "no_reply") if model.config.resend_unanswered else ("connect", "not_sent")

    @property
    def fingerprint(self) -> list[object]:
        """What of the configuration an answer depends on."""
        config = self.model.config
        return [config.model, config.revision, config.extra, self.accepts.fingerprint]

    @property
    def state(self) -> State:
        """Of the breakers: closed where one server at least may be asked."""
        states = {endpoint.health.state for endpoint in self.endpoints if not endpoint.drained}
        return next(state for state in ("closed", "half_open", "open") if state in states)

    async def close(self) -> None:
        await self._prober.close()
        for endpoint in self.endpoints:
            endpoint.pool.close()

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

        async def once(attempt: Attempt) -> Completion:
            nonlocal attempts
            attempts += 1
            body, said = await self._whole(attempt, call.api)
            tokens = Tokens(prompt=said.tokens.prompt, completion=said.tokens.completion)
            return Completion(body, said.message, said.finish_reason, tokens, attempts)

        wanted = Request(urlsplit(call.url).path, [call.body], None, at_root=True)
        return await self._admitted(wanted, once, patient=True)

    def whole(
        self,
        body: Sequence[Buffer],
        trace: bytes | None,
        sending: Callable[[], None],
        form: Form = CHAT,
    ) -> Awaitable[Answer]:
        """One whole reply to a chat, or on another route; `sending` is told when the server is about
        to be asked. Raises as `ask` does."""

        def once(attempt: Attempt) -> Awaitable[Answer]:
            sending()
            return self._whole(attempt, form.api)

        return self._admitted(Request(form.route, body, trace), once)

    def stream(
        self,
        body: Sequence[Buffer],
        trace: bytes | None,
        sending: Callable[[], None],
        form: Form = CHAT,
        *,
        without_usage: bool,
    ) -> Awaitable[ChatStream]:
        """The reply once there is something in it for the caller; its place is held until that is closed. Raises as
        `ask` does."""

        def once(attempt: Attempt) -> Awaitable[ChatStream]:
            sending()
            return self._stream(attempt, without_usage, form)

        return self._admitted(Request(form.route, body, trace), once)

    async def _admitted(self, wanted: Request, once: Callable[[Attempt], Awaitable[T]], *, patient: bool = False) -> T:
        """`once`, with a place of the model's and as often as it takes; a stream keeps its place until it is closed."""
        self._prober.start()
        deadline = running_loop().time() + self._timeout_s
        try:
            if not self.admission.entered():
                await self.admission.enter(deadline)
        except TimeoutError:
            raise late(self.alias, self._timeout_s) from None
        left = False
        try:
            result = await self._with_retries(wanted, once, deadline, patient)
            if isinstance(result, ChatStream):
                left = True
                result.on_close(self.admission.leave)
            return result
        finally:
            if not left:
                self.admission.leave()

    async def _with_retries(
        self, wanted: Request, once: Callable[[Attempt], Awaitable[T]], deadline: float, patient: bool
    ) -> T:
        self.budget.asked()
        count = again = 0
        marks = self.choice.marks(wanted.body)
        tried: set[Endpoint] = set()
        while True:
            count += 1
            attempt = self._attempt(wanted, marks, tried, deadline)
            tried.add(attempt.endpoint)
            try:
                return await attempt.made(once)
            except (ModelUnreachable, ModelOverloaded) as error:
                if patient and error.details.get("reason") == "loading":
                    pause_s: float | None = loading_pause_s(error, count)
                elif self._may_ask_another(error, tried):
                    self._retried(error.kind)
                    continue
                elif again < self.model.config.retries and self.budget.left >= 1.0:
                    again += 1
                    pause_s = retry_pause_s(error, again, self._again)
                else:
                    pause_s = None
                if pause_s is None or running_loop().time() + pause_s >= deadline:
                    raise
                self.budget.took()
                self._retried(error.kind)
            await asyncio.sleep(pause_s)

    def _may_ask_another(self, error: ModelError, tried: set[Endpoint]) -> bool:
        """Whether another server is there for what this one did not take: it was never read, or it is busy."""
        reason = error.details.get("reason")
        untaken = isinstance(error, ModelOverloaded) or reason in self._again or reason == "loading"
        return untaken and self.choice.has_other(asking.get().name, tried)

    def _attempt(self, wanted: Request, marks: Sequence[Mark], tried: set[Endpoint], deadline: float) -> Attempt:
        """Raises ModelUnreachable where no server is to be asked."""
        caller = asking.get().name
        endpoint = self.choice.pick(caller, marks, tried)
        if endpoint is not None:
            return Attempt(wanted, endpoint, health.Call(endpoint.health, caller), deadline)
        wait_s = min(e.health.wait_s(caller) for e in self.endpoints)
        message = f"model {self.alias!r} did not answer several times in a row; it is tried again in {wait_s:.1f} s"
        details: dict[str, object] = {"model": self.alias, "reason": "breaker_open"}
        raise ModelUnreachable(message, details=details, headers={"Retry-After": "2"})

    async def _whole(self, attempt: Attempt, api: Api = "openai") -> Answer:
        call, pool = attempt.call, attempt.endpoint.pool
        try:
            status, headers, body = await pool.whole(attempt.request(), attempt.deadline, MAX_REPLY_BYTES)
        except BrokenReply as broken:
            raise self._broken(broken, call) from None
        try:
            if status != 200:
                raise self._replies.refusal(status, body, said_in(headers))
            said = self._replies.said(api, body, headers)
        except ModelError as error:
            _learn(error, call)
            raise
        call.succeeded()
        return Answer(self._replies.masked(body), said)

    async def _stream(self, attempt: Attempt, without_usage: bool, form: Form) -> ChatStream:
        call, deadline = attempt.call, attempt.deadline
        opened: Stream | ChatStream | None = None
        begun = False
        try:
            stream = opened = await attempt.endpoint.pool.stream(attempt.request(), deadline)
            if stream.status != 200 or not may_be_stream(stream.headers):
                rest = await stream.rest(deadline, MAX_REPLY_BYTES)
                raise self._no_stream(stream.status, rest, stream.headers, form.api)
            opened = ChatStream(
                stream,
                self._replies,
                call,
                alias=self.alias,
                timeout_s=self._timeout_s,
                without_usage=without_usage,
                said=form.reader(),
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

    def _no_stream(self, status: int, body: bytes, headers: dict[bytes, bytes], api: Api) -> ModelError:
        """What a reply is that is no stream: an error with its status or inside a 200, a proxy's page, or the answer of
        a server that knows no streams."""
        if status != 200:
            return self._replies.refusal(status, body, said_in(headers))
        try:
            self._replies.said(api, body, headers)
        except ModelError as error:
            return error
        return self._replies.unreachable("it answers a stream with a single reply", "no_stream")

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
