"""The gateway's own figures beside those of HTTP. They are counted in plain dictionaries and made into Prometheus'
form when somebody looks: the client library's own counters and histograms take a lock for every number.

Those of model calls carry OpenTelemetry's names (semantic conventions for generative AI) as Prometheus writes them:
`gen_ai.client.operation.duration` is `gen_ai_client_operation_duration_seconds`.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from prometheus_client import CollectorRegistry, Counter, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from contracts.vlm_gateway import Tokens
from services.vlm_gateway.keys import asking

_BUCKETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0)
_TOKEN_BUCKETS = (1, 4, 16, 64, 256, 1024, 4096, 16_384, 65_536, 262_144, 1_048_576)


class Price(NamedTuple):
    """US dollars a million tokens."""

    prompt: float
    completion: float


class GatewayMetrics:
    """`outcome` is the contract's outcome or an error's code; `model` is the configured alias, so that clients can't
    multiply the series. `prices` by alias."""

    def __init__(self, registry: CollectorRegistry, prices: Mapping[str, Price] | None = None) -> None:
        labels = ["role", "backend", "model"]
        self._registry = registry
        self._prices = dict(prices or {})
        self._calls = self._counter("calls", "Questions and chats by outcome.", [*labels, "outcome", "cache"])
        self._seconds = self._spread("vlm_gateway_call_seconds", "Time to an answer.", [*labels, "cache"], _BUCKETS)
        self._tokens = self._counter("tokens", "Tokens spent, cache hits not counted.", ["model", "key", "kind"])
        self._usd = self._counter("cost_usd", "US dollars spent, by the configured prices.", ["model", "key"])
        self._cache_failures = self._counter("cache_failures", "Cache operations that failed.", ["operation", "kind"])
        self._retries = self._counter("retries", "Calls to a server made again.", ["model", "after"])
        self._fallbacks = self._counter("fallbacks", "Chats handed on to another model.", ["model", "to", "after"])
        self._refused = self._counter("refused", "Requests refused for their key or its budget.", ["key", "code"])
        names = ["gen_ai_operation_name", "gen_ai_provider_name", "gen_ai_request_model"]
        self._duration = self._spread(
            "gen_ai_client_operation_duration_seconds",
            "Time of a call to a model, retries and waiting included.",
            [*names, "error_type"],
            _BUCKETS,
        )
        self._usage = self._spread(
            "gen_ai_client_token_usage", "Tokens of a call to a model.", [*names, "gen_ai_token_type"], _TOKEN_BUCKETS
        )

    def called(self, role: str, backend: str, model: str, outcome: str, cache: str, seconds: float) -> None:
        """A question or chat has its answer."""
        self._calls.add(role, backend, model, outcome, cache)
        self._seconds.add(role, backend, model, cache, value=seconds)

    def spent(self, model: str, tokens: Tokens) -> None:
        """A model's answer was paid for, by whoever is asking."""
        key = asking.get()
        key.spend(tokens.prompt + tokens.completion)
        self._tokens.add(model, key.name, "prompt", amount=tokens.prompt)
        self._tokens.add(model, key.name, "completion", amount=tokens.completion)
        if (price := self._prices.get(model)) is not None:
            usd = (tokens.prompt * price.prompt + tokens.completion * price.completion) / 1e6
            self._usd.add(model, key.name, amount=usd)

    def model_called(
        self, provider: str, model: str, seconds: float, tokens: Tokens | None = None, error: str = ""
    ) -> None:
        """A call to a model ended; `error` is the code of what went wrong."""
        self._duration.add("chat", provider, model, error, value=seconds)
        if tokens is not None:
            self._usage.add("chat", provider, model, "input", value=tokens.prompt)
            self._usage.add("chat", provider, model, "output", value=tokens.completion)

    def cache_failed(self, operation: str, kind: str) -> None:
        self._cache_failures.add(operation, kind)

    def retried(self, model: str, after: str) -> None:
        self._retries.add(model, after)

    def fell_back(self, model: str, to: str, after: str) -> None:
        self._fallbacks.add(model, to, after)

    def refused(self, key: str, code: str) -> None:
        self._refused.add(key, code)

    def watch(self, gauges: Callable[[], Iterable[Metric]]) -> None:
        """Read these at every look at the figures."""
        self._registry.register(_Read(gauges))

    def _counter(self, name: str, about: str, labels: Sequence[str]) -> "_Sums":
        sums = _Sums(f"vlm_gateway_{name}", about, labels)
        self._registry.register(sums)
        return sums

    def _spread(self, name: str, about: str, labels: Sequence[str], bounds: Sequence[float]) -> "_Spreads":
        spreads = _Spreads(name, about, labels, bounds)
        self._registry.register(spreads)
        return spreads


def gauge(name: str, about: str, by_model: Mapping[str, float]) -> Metric:
    """One number per model, as it is now."""
    family = GaugeMetricFamily(f"vlm_gateway_{name}", about, labels=["model"])
    for model, value in sorted(by_model.items()):
        family.add_metric([model], value)
    return family


class Children:
    """A metric's series by their labels, found with one look-up: the client library's own takes a lock and several."""

    def __init__(self, metric: Counter | Histogram) -> None:
        self._metric = metric
        self._by_labels: dict[tuple[str, ...], Any] = {}

    def of(self, *labels: str) -> Any:
        child = self._by_labels.get(labels)
        if child is None:
            child = self._by_labels[labels] = self._metric.labels(*labels)
        return child


class _Read(Collector):
    def __init__(self, gauges: Callable[[], Iterable[Metric]]) -> None:
        self._gauges = gauges

    def collect(self) -> Iterable[Metric]:
        return self._gauges()


class _Sums(Collector):
    """A counter's series by their labels."""

    def __init__(self, name: str, about: str, labels: Sequence[str]) -> None:
        self._name, self._about, self._labels = name, about, labels
        self._sums: dict[tuple[str, ...], float] = {}

    def add(self, *labels: str, amount: float = 1.0) -> None:
        self._sums[labels] = self._sums.get(labels, 0.0) + amount

    def collect(self) -> Iterable[Metric]:
        family = CounterMetricFamily(self._name, self._about, labels=self._labels)
        for labels, amount in list(self._sums.items()):
            family.add_metric(labels, amount)
        return [family]


class _Spread:
    """One histogram: how many values lie in each bucket, and their sum."""

    __slots__ = ("counts", "sum")

    def __init__(self, buckets: int) -> None:
        self.counts = [0] * buckets
        self.sum = 0.0


class _Spreads(Collector):
    """A histogram's series by their labels; `bounds` are the buckets' upper ones, but for the last."""

    def __init__(self, name: str, about: str, labels: Sequence[str], bounds: Sequence[float]) -> None:
        self._name, self._about, self._labels = name, about, labels
        self._bounds = bounds
        self._shown = [*(str(float(bound)) for bound in bounds), "+Inf"]
        self._spreads: dict[tuple[str, ...], _Spread] = {}

    def add(self, *labels: str, value: float) -> None:
        spread = self._spreads.get(labels)
        if spread is None:
            spread = self._spreads[labels] = _Spread(len(self._shown))
        spread.counts[bisect_left(self._bounds, value)] += 1
        spread.sum += value

    def collect(self) -> Iterable[Metric]:
        family = HistogramMetricFamily(self._name, self._about, labels=self._labels)
        for labels, spread in list(self._spreads.items()):
            up_to = list(accumulate(spread.counts))
            family.add_metric(labels, list(zip(self._shown, up_to, strict=True)), spread.sum)
        return [family]
