"""Asking the models for a chat: which ones, in which order, and what of their answers is kept and counted."""

from collections.abc import Awaitable, Callable, Coroutine, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from service_kit.errors import NotFound, ServiceError
from services.vlm_gateway.cache.claims import Claims
from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.errors import ModelError, ModelRejected
from services.vlm_gateway.hot.answers import Stored
from services.vlm_gateway.hot.fitting import PictureFitter
from services.vlm_gateway.hot.model_call import ModelCall
from services.vlm_gateway.hot.relay import Course, Pieces, Relayed
from services.vlm_gateway.hot.request import Chat, part_types, unknown_fields, unknown_parts
from services.vlm_gateway.hot.rewriting import NONE_SCALED, rewritten
from services.vlm_gateway.hot.scan import Scanned
from services.vlm_gateway.keys import Forbidden, Key, asking
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.pictures import ChatPicture
from services.vlm_gateway.tracking import NO_TRACER, Tracer
from services.vlm_gateway.upstream.accepted import Accepted
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.upstream.events import outcome_of
from services.vlm_gateway.upstream.forms import CHAT, EMBEDDINGS, Form
from services.vlm_gateway.upstream.http_reply import Buffer
from services.vlm_gateway.upstream.replies import Answer, Said, Spent
from services.vlm_gateway.upstream.server_json import parsed
from services.vlm_gateway.upstream.stream import ChatStream
from services.vlm_gateway.usage.accounts import Accounts, Bill, estimated


class Answered(NamedTuple):
    """`alias` is the model that answered in the end; `outcome` is `answered` where it did so as it should have. `usd`:
    what it cost; null where that is not known, and where somebody else has paid."""

    alias: str
    body: bytes
    outcome: str
    usd: float | None = None


class ModelRequest(NamedTuple):
    """A request that nobody knows the answer to. `targets` are asked in turn, on the route that `form` is, with what
    `body` makes of the request for each, some of its `pictures` scaled (their data URLs by their place). `estimate` is
    what it may use. `digest` is what the answer is to be kept under, empty where it is not to be kept. `wants_usage`:
    the caller asks what a stream cost; `limits_length`: an answer that is cut is what was asked for."""

    targets: Sequence[Upstream]
    form: Form
    body: Callable[[Accepted, Mapping[int, str]], Sequence[Buffer]]
    estimate: Spent
    trace: bytes | None = None
    digest: str = ""
    wants_usage: bool = False
    limits_length: bool = False
    pictures: Sequence[ChatPicture] = ()

    def in_turn(self) -> Iterator[tuple[Upstream, Upstream | None]]:
        """Every target with the one that comes after it."""
        if len(self.targets) == 1:
            return iter(((self.targets[0], None),))
        return zip(self.targets, [*self.targets[1:], None], strict=True)

    def counts(self, target: Upstream) -> bool:
        """Whether a target is asked what a stream cost without its caller wanting to know."""
        return self.form.counts_when_asked and target.accepts.counts_streams and not self.wants_usage


class Models:
    """`targets` by alias, in which `default` names the one that answers where a request names none."""

    def __init__(
        self,
        targets: Mapping[str, Upstream],
        default: str | None,
        cache: GuardedCache | None,
        metrics: GatewayMetrics,
        accounts: Accounts,
        tracer: Tracer = NO_TRACER,
        claims: Claims | None = None,
    ) -> None:
        self._claims = claims
        self._accounts = accounts
        self._tracer = tracer
        self._targets = targets
        self.default = default
        self._cache = cache
        self._metrics = metrics
        self._fitter = PictureFitter()

    def adopt(self, targets: Mapping[str, Upstream], default: str | None) -> None:
        """From now on these are asked."""
        self._targets, self.default = targets, default

    @property
    def fingerprint(self) -> dict[str, object]:
        """What of the configuration answers depend on."""
        return {alias: target.fingerprint for alias, target in sorted(self._targets.items())}

    def asked(self, chat: Chat, key: Key) -> list[Upstream]:
        """The targets of a chat, in the order in which they are asked: those that take all of its fields. Raises
        NotFound, Forbidden or BadQuestion."""
        alias = chat.alias or self.default
        first = self._targets.get(alias) if alias is not None else None
        if first is None or alias is None or not key.may_ask(alias):
            raise self._not_asked(alias, key)
        if chat.plain and not chat.further:
            if not first.fallbacks:
                return [first]
            return [first, *(self._targets[name] for name in first.fallbacks if key.may_ask(name))]
        if unknown := chat.further - first.accepts.fields:
            raise unknown_fields(unknown, alias)
        kinds = part_types(chat)
        if unknown := kinds - first.accepts.part_types:
            raise unknown_parts(unknown, alias)
        others = (self._targets[name] for name in first.fallbacks if key.may_ask(name))
        return [first, *(other for other in others if other.accepts.takes(chat.further, kinds))]

    def _not_asked(self, alias: str | None, key: Key) -> ServiceError:
        """Why the model of this alias is not asked for this key."""
        mine = sorted(alias for alias in self._targets if key.may_ask(alias))
        if alias in self._targets:
            return Forbidden(f"this key may not ask model {alias!r}; it may ask {', '.join(mine) or 'none'}")
        why = "no model is named and none has the role 'parser'" if alias is None else f"no chat model {alias!r}"
        known = ", ".join(mine) or "none; configure one with backend 'chat'"
        return NotFound(f"{why}; chat models: {known}", code="model_not_found", details={"models": mine})

    def chat(self, scanned: Scanned, chat: Chat, key: Key, trace: bytes | None, digest: str) -> ModelRequest:
        """What is to be asked for a chat. Raises NotFound, Forbidden or BadQuestion."""
        limit = chat.max_tokens
        estimate = estimated(len(scanned.skeleton), len(scanned.pictures), limit)
        return ModelRequest(
            self.asked(chat, key),
            CHAT,
            partial(rewritten, scanned, chat),
            estimate,
            trace,
            digest,
            chat.wants_usage,
            limit is not None,
            chat.pictures,
        )

    def whole_once(self, call: ModelRequest) -> Coroutine[Any, Any, Answered]:
        """As `whole`, unless another worker is getting the answer."""
        if self._claims is None:
            return self.whole(call)
        return self._claims.once(call.digest, partial(self.whole, call), _kept_before)

    async def whole(self, call: ModelRequest) -> Answered:
        """Target by target, until one answers. Raises OverBudget as well."""
        for target, after in call.in_turn():
            bill = self._accounts.bill(asking.get(), target.alias, call.estimate)
            if bill.is_bounded:
                await bill.reserve()
            asked = self._begun(target, call, bill)
            try:
                fits = target.accepts.pictures.take_all(call.pictures)
                scaled = NONE_SCALED if fits else await self._scaled(target, call)
                answer = await target.whole(call.body(target.accepts, scaled), asked.trace, asked.asked, call.form)
                if answer.said.message is None and call.form is CHAT:
                    raise target.no_choice()
            except ModelError as error:
                asked.failed(error)
                if not self._passes_on(target, after, error):
                    raise
                continue
            except BaseException:
                asked.given_up()
                raise
            outcome = _outcome(answer.said, call.limits_length) if call.form is CHAT else "answered"
            spent = _spent(answer, call)
            asked.ended(spent)
            if outcome == "answered":
                self._keep(call, target, Stored(target.alias, False, answer.body))
            return Answered(target.alias, answer.body, outcome, self._accounts.usd(target.alias, spent))
        raise AssertionError("there is at least one target")

    async def events(self, call: ModelRequest, course: Course) -> Pieces:
        """A stream's bytes as they come, once one of the targets has something to say. Kept whole, with its end seen,
        or not at all. What was passed on is paid for, however it ends. Raises OverBudget as well."""
        for target, after in call.in_turn():
            bill = self._accounts.bill(asking.get(), target.alias, call.estimate)
            if bill.is_bounded:
                await bill.reserve()
            asked = self._begun(target, call, bill)
            try:
                stream = await self._opened(target, call, asked)
            except ModelError as error:
                asked.failed(error)
                if not self._passes_on(target, after, error):
                    raise
                continue
            except BaseException:
                asked.given_up()
                raise
            course.alias = target.alias
            relayed, failed = Relayed(), "caller_left"
            try:
                while piece := await stream.piece():
                    relayed.add(piece)
                    yield piece
                failed = ""
            except ModelError as error:
                failed = error.kind
                raise
            finally:
                stream.close()
                course.used = stream.said.used(call.estimate.prompt)
                asked.ended(course.used, "" if stream.said.done else failed)  # who has it all may leave
            course.outcome = stream.said.outcome(call.limits_length)
            if course.outcome == "answered" and (whole := relayed.whole) is not None:
                self._keep(call, target, Stored(target.alias, True, whole))
            return

    def _begun(self, target: Upstream, call: ModelRequest, bill: Bill) -> ModelCall:
        """A call to one target, its estimate reserved."""
        span = self._tracer.model_call(call.trace, target.provider, target.model.config.model, target.alias)
        return ModelCall(target, bill, self._metrics, span, call.trace)

    def _scaled(self, target: Upstream, call: ModelRequest) -> Awaitable[Mapping[int, str]]:
        """The pictures that this target does not take as they are. Raises BadQuestion (`bad_image`)."""
        return self._fitter.fitted(call.pictures, target.accepts.pictures)

    async def _opened(self, target: Upstream, call: ModelRequest, asked: ModelCall) -> ChatStream:
        """The stream of one target. A server that does not know how to count a stream's tokens isn't asked to again."""
        while True:
            counting = call.counts(target)
            try:
                fits = target.accepts.pictures.take_all(call.pictures)
                body = call.body(target.accepts, NONE_SCALED if fits else await self._scaled(target, call))
                return await target.stream(body, asked.trace, asked.asked, call.form, without_usage=counting)
            except ModelRejected as error:
                if not counting or not target.refuses_to_count(error):
                    raise

    def _keep(self, call: ModelRequest, target: Upstream, answer: Stored) -> None:
        """Unless another model stood in: its answer is not the one that was asked for."""
        if call.digest and self._cache is not None and target is call.targets[0]:
            self._cache.put(call.digest, answer.written())

    def _passes_on(self, target: Upstream, after: Upstream | None, error: ModelError) -> bool:
        """Whether the next target is asked after this error."""
        if after is None or error.fallback_reason not in target.fallback_after:
            return False
        self._metrics.fell_back(target.alias, after.alias, error.kind)
        return True


def _kept_before(value: bytes) -> Answered | None:
    """What another worker has kept."""
    stored = Stored.read(value)
    return None if stored is None or stored.stream else Answered(stored.alias, stored.body, "answered")


def _outcome(said: Said, length_asked_for: bool) -> str:
    message = said.message or {}
    return outcome_of(
        said.finish_reason,
        has_content=bool(message.get("content") or message.get("tool_calls") or message.get("function_call")),
        refused=bool(message.get("refusal")),
        length_asked_for=length_asked_for,
    )


def _spent(answer: Answer, call: ModelRequest) -> Spent:
    """The server's own count; else the request as it was estimated, and what was answered."""
    tokens = answer.said.tokens
    if tokens.prompt and (tokens.completion or call.form is EMBEDDINGS):
        return tokens
    reader = call.form.reader()
    reader.read_whole(parsed(answer.body))
    return reader.used(call.estimate.prompt)
