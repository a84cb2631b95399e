"""Asking the models for a chat: which ones, in which order, and what of their answers is kept and counted."""

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from service_kit.errors import BadQuestion, ServiceError
from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.errors import ModelOverloaded, ModelTimeout, ModelUnreachable
from services.vlm_gateway.hot.exchange import Stored
from services.vlm_gateway.hot.relay import Kept, Pieces
from services.vlm_gateway.hot.request import Chat
from services.vlm_gateway.hot.scan import Scanned, rewritten
from services.vlm_gateway.keys import Forbidden, Key
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.upstream.replies import Said

_PASSES_ON = (ModelUnreachable, ModelTimeout, ModelOverloaded)
"""What another model may be asked after."""


class Answered(NamedTuple):
    """`alias` is the model that answered in the end."""

    alias: str
    body: bytes


class ChatCall(NamedTuple):
    """A chat that nobody knows the answer to. `targets` are asked in turn; `digest` is what the answer is to be kept
    under, empty where it is not to be kept."""

    targets: Sequence[Upstream]
    scanned: Scanned
    chat: Chat
    trace: bytes | None
    digest: str

    def in_turn(self) -> Iterator[tuple[Upstream, Upstream | None]]:
        """Every target with the one that comes after it."""
        return zip(self.targets, [*self.targets[1:], None], strict=True)


class Models:
    """`targets` by alias, in which `default` names the one that answers where a request names none."""

    def __init__(
        self,
        targets: Mapping[str, Upstream],
        default: str | None,
        cache: GuardedCache | None,
        metrics: GatewayMetrics,
    ) -> None:
        self._targets = targets
        self.default = default
        self._cache = cache
        self._metrics = metrics

    @property
    def fingerprint(self) -> dict[str, object]:
        """What of the configuration answers depend on."""
        return {alias: target.fingerprint for alias, target in sorted(self._targets.items())}

    def asked(self, chat: Chat, key: Key) -> list[Upstream]:
        """The targets of a chat, in the order in which they are asked. Raises BadQuestion or Forbidden."""
        alias = chat.alias or self.default
        first = None if alias is None else self._targets.get(alias)
        mine = sorted(alias for alias in self._targets if key.may_ask(alias))
        if first is None or alias is None:
            why = "no model is named and none has the role 'parser'" if alias is None else f"no chat model {alias!r}"
            known = ", ".join(mine) or "none; configure one with backend 'chat'"
            raise BadQuestion(f"{why}; chat models: {known}", code="unknown_model", details={"models": mine})
        if not key.may_ask(alias):
            raise Forbidden(f"this key may not ask model {alias!r}; it may ask {', '.join(mine) or 'none'}")
        return [first, *(self._targets[name] for name in first.fallbacks if key.may_ask(name))]

    async def whole(self, call: ChatCall) -> Answered:
        """Upstream by target, until one answers."""
        for target, after in call.in_turn():
            started = time.perf_counter()
            try:
                answer = await target.whole(rewritten(call.scanned, call.chat, target.wanted), call.trace)
                if answer.said.message is None:
                    raise target.no_choice()
            except ServiceError as error:
                self._failed(target, after, error, started)
                if after is None or not isinstance(error, _PASSES_ON):
                    raise
                continue
            tokens = answer.said.tokens
            self._metrics.model_called(target.provider, target.alias, time.perf_counter() - started, tokens)
            self._metrics.spent(target.alias, tokens)
            if _worth_keeping(answer.said):
                self._keep(call, target, Stored(target.alias, False, answer.body))
            return Answered(target.alias, answer.body)
        raise AssertionError("there is at least one target")

    async def events(self, call: ChatCall) -> Pieces:
        """A stream's bytes as they come. Kept whole, with its end seen, or not at all."""
        for target, after in call.in_turn():
            started = time.perf_counter()
            kept = Kept()
            try:
                opened = await target.stream(rewritten(call.scanned, call.chat, target.wanted), call.trace)
                try:
                    while piece := await opened.piece():
                        kept.add(piece)
                        yield piece
                    if not kept.finished:
                        raise opened.cut()
                finally:
                    opened.close()
            except ServiceError as error:
                self._failed(target, after, error, started)
                if kept.size or after is None or not isinstance(error, _PASSES_ON):
                    raise
                continue
            tokens = kept.tokens()
            self._metrics.model_called(target.provider, target.alias, time.perf_counter() - started, tokens)
            self._metrics.spent(target.alias, tokens)
            whole = kept.whole
            if whole is not None and kept.clean:
                self._keep(call, target, Stored(target.alias, True, whole))
            return

    def _keep(self, call: ChatCall, target: Upstream, answer: Stored) -> None:
        """Unless another model stood in: its answer is not the one that was asked for."""
        if call.digest and self._cache is not None and target is call.targets[0]:
            self._cache.put(call.digest, answer.written())

    def _failed(self, target: Upstream, after: Upstream | None, error: ServiceError, started: float) -> None:
        self._metrics.model_called(target.provider, target.alias, time.perf_counter() - started, error=error.code)
        if after is not None and isinstance(error, _PASSES_ON):
            self._metrics.fell_back(target.alias, after.alias, error.code)


def _worth_keeping(said: Said) -> bool:
    """A refusal, an answer cut off or one without words may not come again, and one that were kept would stay."""
    message = said.message or {}
    words = message.get("content") or message.get("tool_calls")
    return said.finish_reason in ("stop", "tool_calls") and bool(words) and not message.get("refusal")
