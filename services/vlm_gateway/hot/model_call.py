"""One call to one model, with all that is to be told once when it ends: its bill, its figures, its span."""

import time

from services.vlm_gateway.errors import ModelError
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.tracking import NO_SPAN, Span, call_facts
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.usage.accounts import Bill

NOTHING = Spent()


class ModelCall:
    """End it by `ended`, `failed` or `given_up`; what comes after the first of them changes nothing."""

    __slots__ = ("_bill", "_metrics", "_over", "_span", "_started", "_target", "trace")

    def __init__(self, target: Upstream, bill: Bill, metrics: GatewayMetrics, span: Span, trace: bytes | None) -> None:
        """`trace` is the caller's traceparent, or None."""
        self.trace = span.traceparent or trace
        self._target = target
        self._bill = bill
        self._metrics = metrics
        self._span = span
        self._started = time.perf_counter()
        self._over = False

    def asked(self) -> None:
        """The request is on its way."""
        self._bill.asked = True

    def ended(self, used: Spent, error: str = "") -> None:
        """It used so much, even where it ended with an error."""
        if self._over:
            return
        self._over = True
        self._bill.settle(used)
        took_s = time.perf_counter() - self._started
        tokens = used if used != NOTHING or not error else None
        self._metrics.model_called(self._target.provider, self._target.alias, took_s, tokens, error)
        if self._span is not NO_SPAN:
            self._span.end(**call_facts(tokens, error))

    def failed(self, error: ModelError) -> None:
        """It brought nothing. A server that said more than is taken has been paid for it."""
        too_large = error.details.get("reason") == "too_large"
        self.ended(self._bill.estimate if too_large else NOTHING, error.kind)

    def given_up(self) -> None:
        """The caller left before there was an answer: what the server had read by then is paid for."""
        asked = self._bill.asked
        self.ended(Spent(prompt=self._bill.estimate.prompt) if asked else NOTHING, "caller_left")
