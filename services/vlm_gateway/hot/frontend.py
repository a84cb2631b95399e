"""`POST /v1/chat/completions` from the first byte to the last, in front of the framework that serves everything else.

    whose request is it, and may it    key, budgets                              `chat`
    what is in it                      body, bounded; pictures cut out           Exchange.body, scan
    is it known                        hash of tenant, configuration, raw body   `_known`
    is it sound                        fields, pictures' headers                 scan.read
    is it being asked                  one call for all who ask the same         Flights, Broadcast
    ask                                target by target, as configured           Models.whole, Models.events
    answer, keep, count

The answer's bytes are the model server's own.
"""

import asyncio
import logging
from collections.abc import Callable
from functools import partial

from pydantic_core import to_json
from starlette.types import ASGIApp, Receive, Scope, Send

from service_kit.auth import OPEN_PATHS, note_access
from service_kit.errors import ServiceError
from service_kit.metrics import HttpMetrics
from service_kit.requests import Origins, without_encoding
from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.cache.port import CacheDown
from services.vlm_gateway.config import ChatLimits
from services.vlm_gateway.errors import CacheUnavailable, ModelError, NotRecorded, kind_of
from services.vlm_gateway.flights import Flights
from services.vlm_gateway.hot.answers import Stored, rendered, too_large
from services.vlm_gateway.hot.calls import Answered, ModelRequest, Models
from services.vlm_gateway.hot.deadline import too_late
from services.vlm_gateway.hot.digests import Digests
from services.vlm_gateway.hot.exchange import Exchange
from services.vlm_gateway.hot.further import further
from services.vlm_gateway.hot.head import Head, head_of
from services.vlm_gateway.hot.log import RequestLog
from services.vlm_gateway.hot.relay import Broadcast, Course
from services.vlm_gateway.hot.scan import read, scan
from services.vlm_gateway.hot.server import CallerProtocol
from services.vlm_gateway.keys import Forbidden, Keys, asking
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.tracking import NO_TRACER, Tracer, identified, request_id
from services.vlm_gateway.upstream.forms import CHAT, COUNT

log = logging.getLogger(__name__)

ADMIN_PATHS = frozenset({"/metrics", "/v1/status"})
BIG_SKELETON_BYTES = 256 * 1024
"""From here on what is left of a body is parsed in a thread, so that other callers are still answered."""

_JSON = b"application/json"
_EVENTS = b"text/event-stream; charset=utf-8"


class Frontend:
    """Chats and their like, whole, and an ASGI app for everything else: that of the framework, behind the same keys."""

    def __init__(
        self,
        app: ASGIApp,
        models: Models,
        keys: Keys,
        cache: GuardedCache | None,
        metrics: GatewayMetrics,
        http: HttpMetrics,
        request_log: RequestLog,
        *,
        limits: ChatLimits,
        origins: Origins,
        tracer: Tracer = NO_TRACER,
    ) -> None:
        self._tracer = tracer
        self._app = app
        self.keys = keys
        self.guarded = bool(keys.all)
        self._cache = cache
        self._metrics = metrics
        self._http = http
        self._log = request_log
        self._origins = origins
        self.models = models
        self._flights: Flights[Answered] = Flights()
        self._streams: dict[str, Broadcast] = {}
        self.configured(limits)

    def configured(self, limits: ChatLimits) -> None:
        """The models or keys have changed, and these are the limits."""
        self._limits = limits
        self.max_body_bytes = limits.body_bytes
        self._digests = Digests(self.models.fingerprint, self.models.default or "")

    @property
    def http_protocol(self) -> Callable[..., asyncio.Protocol]:
        """What the server is to speak with callers by."""
        return partial(CallerProtocol, self)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Everything but chats: the same keys and budgets, then the framework."""
        path = scope["path"] if scope["type"] == "http" else ""
        if not path or scope["method"] == "OPTIONS":
            await self._app(scope, receive, send)
            return
        if path in OPEN_PATHS:
            note_access(scope, self.keys.access(head_of(scope["headers"]).authorization))
            await self._app(scope, receive, send)
            return
        counted = scope["method"] == "POST" and path.startswith("/v1/")
        head = head_of(scope["headers"])
        request_id.set(head.request_id)
        send = identified(send, head.request_id)
        try:
            key = self.keys.of(head.authorization)
            if path in ADMIN_PATHS and not key.admin:
                raise Forbidden("this key may not read the gateway's figures; use the operator's, or one with admin")
            if counted:
                key.enter()
        except ServiceError as error:
            self._metrics.refused("", error.code)
            await rendered(error)(scope, receive, send)
            self._http.requests.add("refused", scope["method"], str(error.status))
            return
        asking.set(key)
        try:
            await self._app(scope, receive, send)
        finally:
            if counted:
                key.leave()

    async def serve(self, exchange: Exchange) -> None:
        """One request to a model, its errors and its figures."""
        self._http.in_flight += 1
        try:
            head = exchange.head
            if head.origin is not None:
                exchange.from_page(head, self._origins)
            exchange.begin(head, self._tracer)
            request_id.set(head.request_id)
            exchange.key = self.keys.of(head.authorization)
            exchange.key.enter()
            asking.set(exchange.key)
            try:
                await self._watched(head, exchange)
            finally:
                exchange.key.leave()
        except ServiceError as error:
            self._fail(error, exchange)
        except Exception as error:
            log.error("unexpected error in a request to a model", exc_info=error)
            message = "an unexpected error; the service's log has the details"
            self._fail(ServiceError(message), exchange)
        finally:
            exchange.close()
            self._http.in_flight -= 1
            self._count(exchange)

    def _fail(self, error: ServiceError, exchange: Exchange) -> None:
        """An error answer, or where a stream has begun its last event."""
        exchange.outcome = kind_of(error)
        if error.status in (401, 429) and not isinstance(error, ModelError):
            self._metrics.refused(exchange.key.name, error.code)
        if not exchange.response_started and error.status == 408:
            exchange.keep_alive = False  # what is left of the body is not waited for
        exchange.fail(error)

    async def _watched(self, head: Head, exchange: Exchange) -> None:
        """The chat, for as long as its caller stays and is going to wait."""
        deadline = exchange.deadline
        try:
            limit_s = None if head.timeout_said is None else head.timeout_s
            if head.length > self.max_body_bytes:
                raise too_large(self.max_body_bytes)
            raw = await exchange.body()
            if head.encoding is not None:
                raw = await without_encoding(raw, head.encoding.decode("latin-1"), self.max_body_bytes)
            if limit_s is not None:
                deadline.limit(max(0.001, limit_s - exchange.took_s()), partial(too_late, limit_s))
            form, adapter = exchange.route.form, exchange.adapter
            if adapter is not None:
                raw = adapter.request(raw)
            if form is CHAT:
                await self._chat(head, raw, exchange)
            elif form is COUNT:
                await self._counted(raw, exchange)
            else:
                await self._further(raw, exchange)
        except asyncio.CancelledError:
            if deadline.why is None:
                raise
            task = asyncio.current_task()
            assert task is not None
            task.uncancel()
            raise deadline.why from None

    async def _counted(self, raw: bytes, exchange: Exchange) -> None:
        """How long a chat is: an estimate, which is said."""
        scanned, chat = await asyncio.to_thread(read, scan(raw), self._limits)
        call = self.models.chat(scanned, chat, exchange.key, None, "")
        exchange.alias = call.targets[0].alias
        exchange.answer(to_json({"input_tokens": call.estimate.prompt, "estimated": True}), _JSON)

    async def _further(self, raw: bytes, exchange: Exchange) -> None:
        big = len(raw) > BIG_SKELETON_BYTES
        asked = partial(further, exchange.route.form, raw, self.models, exchange.key, exchange.trace, self._limits)
        call, stream = await asyncio.to_thread(asked) if big else asked()
        exchange.alias = call.targets[0].alias
        if stream:
            await self._stream(call, exchange)
        else:
            self._answer(exchange, await self.models.whole(call))

    async def _chat(self, head: Head, raw: bytes, exchange: Exchange) -> None:
        scanned = scan(raw)
        cache, digest, asked_for = self._cache, "", head.cache
        replay = cache is not None and cache.mode == "replay"
        if cache is not None and (replay or (scanned.says_temperature_0 if asked_for is None else asked_for)):
            exchange.cache = "miss"
            digest = self._digests.of(exchange.key, scanned)
            if (stored := await self._known(digest, cache)) is not None:
                exchange.alias, exchange.cache = stored.alias, "hit"
                if stored.stream:
                    exchange.replay(stored.body, _EVENTS)
                else:
                    exchange.answer(stored.body, _JSON)
                return
        big = len(scanned.skeleton) > BIG_SKELETON_BYTES
        scanned, chat = await asyncio.to_thread(read, scanned, self._limits) if big else read(scanned, self._limits)
        if digest and not (chat.deterministic or asked_for or replay):
            digest, exchange.cache = "", "off"
        call = self.models.chat(scanned, chat, exchange.key, exchange.trace, digest)
        exchange.alias = call.targets[0].alias
        if replay:
            message = (
                f"this chat with model {exchange.alias!r} is not in the recording at {cache.place if cache else ''}"
            )
            raise NotRecorded(message, details={"key": digest})
        if chat.stream:
            await self._stream(call, exchange)
        elif digest:
            landed = await self._flights.share(digest, partial(self.models.whole_once, call))
            exchange.cache = "hit" if landed.shared else "miss"
            self._answer(exchange, landed.value._replace(usd=None) if landed.shared else landed.value)
        else:
            answered = await self.models.whole(call)
            self._answer(exchange, answered)

    @staticmethod
    def _answer(exchange: Exchange, answered: Answered) -> None:
        exchange.alias = answered.alias  # another model than the one that was asked may have given it
        exchange.usd = answered.usd
        exchange.answer(answered.body, _JSON, answered.outcome)

    async def _known(self, digest: str, cache: GuardedCache) -> Stored | None:
        """What is kept under `digest`. Raises CacheUnavailable in replay mode."""
        if self._flights.flies(digest) or digest in self._streams:
            return None  # it is being asked, so it was not known a moment ago
        try:
            value = await cache.get(digest)
        except CacheDown as error:
            raise CacheUnavailable(f"the recording can't be read: {error}") from None
        if value is None:
            return None
        stored = Stored.read(value)
        if stored is None:
            self._metrics.cache_failed("get", "unreadable")
        return stored

    async def _stream(self, call: ModelRequest, exchange: Exchange) -> None:
        """A stream relayed as it comes. Errors before the first event leave as ordinary error answers, one in the
        middle as a last event."""
        if call.digest:
            broadcast = self._streams.get(call.digest)
            exchange.cache = "miss" if broadcast is None else "hit"
            if broadcast is None:
                course = Course(exchange.alias)
                forget = partial(self._streams.pop, call.digest, None)
                broadcast = Broadcast(self.models.events(call, course), course, forget)
                self._streams[call.digest] = broadcast
            pieces, course = broadcast.read(), broadcast.course
        else:
            course = Course(exchange.alias)
            pieces = self.models.events(call, course)
        try:
            async for piece in pieces:
                exchange.alias = course.alias
                await exchange.piece(piece, _EVENTS)
        finally:
            await pieces.aclose()
        exchange.end(course.outcome, course.used)

    def _count(self, exchange: Exchange) -> None:
        took_s = exchange.took_s()
        exchange.end_span()
        path, form = exchange.route.path, exchange.route.form
        self._http.answered(path, "POST", exchange.status, took_s)
        if exchange.alias:
            self._metrics.called(form.name, "chat", exchange.alias, exchange.outcome, exchange.cache, took_s)
        if self._log.wants(exchange.status):
            self._log.add(**exchange.facts(took_s))
