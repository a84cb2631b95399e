"""What a typed question goes through: who answers, is it known already, is it being asked, ask, keep, tell."""

import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from pydantic import ValidationError

from contracts.vlm_gateway import Answer, CacheResult, PreflightAnswer, PreflightQuestion, Question, Role
from service_kit.errors import BadQuestion, ServiceError
from services.vlm_gateway.backends.base import Backend, shortened
from services.vlm_gateway.backends.lazy import LazyBackend
from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.cache.keys import answer_key
from services.vlm_gateway.cache.port import CacheDown
from services.vlm_gateway.chat.backend import ChatBackend
from services.vlm_gateway.errors import CacheUnavailable, ModelError, NotRecorded, kind_of, of_our_question
from services.vlm_gateway.flights import Flights
from services.vlm_gateway.keys import Forbidden, asking
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.questions import KINDS, Kind, Prepared
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.usage.accounts import Accounts, estimated

QUESTION_BYTES = 2000
"""The words around a typed question's pictures."""


class Found(NamedTuple):
    answer: Answer
    recorded: bool


class Gateway:
    """`backends` by alias; `roles` names the alias that answers where a question names none; without `cache` every
    question is asked anew; `kinds` are the typed questions there are."""

    def __init__(
        self,
        backends: Mapping[str, Backend],
        roles: Mapping[Role, str],
        cache: GuardedCache | None,
        metrics: GatewayMetrics,
        accounts: Accounts,
        kinds: Sequence[Kind] = KINDS,
    ) -> None:
        self.backends = backends
        self.roles = roles
        self.cache = cache
        self.metrics = metrics
        self.accounts = accounts
        self.kinds = kinds
        self._kind_of = {kind.question: kind for kind in kinds}
        self._flights: Flights[Found] = Flights()

    def adopt(self, backends: Mapping[str, Backend], roles: Mapping[Role, str]) -> None:
        """From now on these answer; what is under way goes on where it is."""
        self.backends, self.roles = backends, roles

    async def answer(self, question: Question) -> Answer:
        """The model's answer, or the recorded one. Raises BadQuestion, or the errors of `services.vlm_gateway.errors`
        where no answer came at all."""
        kind = self._kind_of[type(question)]
        alias = self.alias(question.model, kind.role)
        backend = self.backends[alias]
        if isinstance(backend, LazyBackend):
            backend = await backend.ready()
        cache = self.cache if backend.cacheable else None
        started = time.perf_counter()
        try:
            prepared = kind.prepare(question)
            if cache is None:
                answer, result = await self._ask(kind, alias, backend, prepared), "off"
            else:
                answer, result = await self._recorded_or_asked(kind, alias, backend, prepared, cache)
        except ServiceError as error:
            state = "off" if cache is None else "miss"
            self.metrics.called(kind.role, backend.kind, alias, error.code, state, time.perf_counter() - started)
            raise
        took_s = time.perf_counter() - started
        self.metrics.called(kind.role, backend.kind, alias, answer.outcome, result, took_s)
        changes: dict[str, object] = {"cache": result, "latency_s": round(took_s, 6)}
        if result == "hit":
            changes["attempts"] = 0
        else:
            changes["usd"] = self.accounts.usd(alias, Spent(answer.tokens.prompt, answer.tokens.completion))
        return answer.model_copy(update=changes)

    async def preflight(self, question: PreflightQuestion) -> PreflightAnswer:
        """Whether a mission can be flown with this model, or with the defaults of the vision roles. Raises BadQuestion
        where there is no such model or it takes no pictures, ModelUnreachable where it can't be loaded."""
        seeing = self.alias(question.model, "recognition")
        for alias in {self.alias(question.model, role) for role in ("floors", "choice")} - {seeing}:
            await self.backends[alias].preflight(None)
        why = await self.backends[seeing].preflight(question.object)
        return PreflightAnswer(
            model=seeing,
            backend=self.backends[seeing].kind,
            known=None if question.object is None else why is None,
            why=why,
        )

    def asked(self, question: Question) -> str:
        """The alias that a question goes to. Raises as `alias` does."""
        return self.alias(question.model, self._kind_of[type(question)].role)

    def alias(self, named: str | None, role: Role) -> str:
        """The alias that answers. Raises BadQuestion, naming the aliases there are, or Forbidden."""
        alias = named or self.roles.get(role)
        if alias is None or alias not in self.backends:
            known = sorted(self.backends)
            what = f"no model {named!r}" if named else f"no model is configured for the role {role!r}"
            if named == "oracle":
                what += " (ORACLE_SIM_URL and the simulator's SIM_TRUTH=on switch it on: `logisticsvln serve --oracle`)"
            there = f"there {'is' if len(known) == 1 else 'are'} {', '.join(known)}"
            raise BadQuestion(f"{what}; {there}", code="unknown_model", details={"models": known})
        if not asking.get().may_ask(alias):
            raise Forbidden(f"this key may not ask model {alias!r}; GET /v1/models lists those it may")
        return alias

    async def _recorded_or_asked(
        self, kind: Kind, alias: str, backend: Backend, prepared: Prepared, cache: GuardedCache
    ) -> tuple[Answer, CacheResult]:
        parts: dict[str, object] = {
            "question": kind.path,
            "backend": backend.kind,
            "model": backend.model,
            "settings": backend.fingerprint,
            "words": prepared.words,
        }
        key = answer_key(parts, [picture.jpeg for picture in prepared.pictures])

        async def look_up_or_ask() -> Found:
            # the look-up is part of the flight: whoever comes between it and the model's answer joins, and none is
            # asked twice
            if (known := await self._look_up(kind, key, cache)) is not None:
                return Found(known, True)
            if cache.mode == "replay":
                raise NotRecorded(
                    f"this {kind.path} question to model {alias!r} is not in the recording at {cache.place}; "
                    "record it with CACHE_MODE=on",
                    details={"key": key},
                )
            answer = await self._ask(kind, alias, backend, prepared)
            if answer.outcome == "answered":
                # a refusal or a slip of form may not come again, and one that were kept would fail every later run
                cache.put(key, answer.model_dump_json().encode())
            return Found(answer, False)

        landed = await self._flights.share(key, look_up_or_ask)
        return landed.value.answer, "hit" if landed.value.recorded or landed.shared else "miss"

    async def _look_up(self, kind: Kind, key: str, cache: GuardedCache) -> Answer | None:
        try:
            stored = await cache.get(key)
        except CacheDown as error:
            raise CacheUnavailable(f"the recording can't be read: {error}") from None
        if stored is None:
            return None
        try:
            return kind.answer.model_validate_json(stored)
        except ValidationError:
            self.metrics.cache_failed("get", "unreadable")
            return None

    async def _ask(self, kind: Kind, alias: str, backend: Backend, prepared: Prepared) -> Answer:
        started = time.perf_counter()
        provider, bill = backend.kind, None
        if isinstance(backend, ChatBackend):
            provider = backend.settings.config.server
            estimate = estimated(QUESTION_BYTES, len(prepared.pictures), backend.settings.max_tokens)
            bill = await self.accounts.reserve(asking.get(), alias, estimate)
            bill.asked = True
        try:
            reply = await prepared.ask(backend)
            if bill is not None:
                counted = Spent(reply.tokens.prompt, reply.tokens.completion)
                bill.settle(counted if counted.prompt else Spent(bill.estimate.prompt, counted.completion))
        except ServiceError as error:
            if bill is not None:
                bill.settle(Spent())
            self.metrics.model_called(provider, alias, time.perf_counter() - started, error=kind_of(error))
            if isinstance(error, ModelError):
                raise of_our_question(error) from None
            raise
        finally:
            if bill is not None:
                bill.given_up()
        self.metrics.model_called(provider, alias, time.perf_counter() - started, reply.tokens)
        return kind.answer.model_validate(
            {
                "outcome": reply.outcome,
                "role": kind.role,
                "backend": backend.kind,
                "model": backend.model,
                "attempts": reply.attempts,
                "tokens": reply.tokens,
                "text": shortened(reply.text),
                **kind.fields(reply.content),
            }
        )
