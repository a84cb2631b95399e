"""The gateway's own figures beside those of HTTP.

Those of model calls carry OpenTelemetry's names (semantic conventions for generative AI) as Prometheus writes them:
`gen_ai.client.operation.duration` is `gen_ai_client_operation_duration_seconds`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from prometheus_client import CollectorRegistry
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from contracts.vlm_gateway import Tokens
from service_kit.metrics import Spread, Spreads, Sum, Sums
from services.vlm_gateway.upstream.replies import Spent

_BUCKETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0)
_TOKEN_BUCKETS = (1, 4, 16, 64, 256, 1024, 4096, 16_384, 65_536, 262_144, 1_048_576)


class _Called(NamedTuple):
    """The series of questions and chats that ended alike."""

    calls: Sum
    seconds: Spread


class _Spent(NamedTuple):
    """The series of what one key spends at one model; `usd` once it costs something."""

    prompt: Sum
    completion: Sum
    usd: Sum | None


class _Counted(NamedTuple):
    """The series of how long one model's calls that end alike take, and how long their requests and answers are."""

    seconds: Spread
    input: Spread
    output: Spread


class GatewayMetrics:
    """`outcome` is the contract's outcome or an error's code; `model` is the configured alias, so that clients can't
    multiply the series."""

    def __init__(self, registry: CollectorRegistry) -> None:
        labels = ["role", "backend", "model"]
        self._registry = registry
        self._called: dict[tuple[str, str, str, str, str], _Called] = {}
        self._spent: dict[tuple[str, str], _Spent] = {}
        self._counted: dict[tuple[str, str, str], _Counted] = {}
        self._calls = self._counter("calls", "Questions and chats by outcome.", [*labels, "outcome", "cache"])
        self._seconds = self._spread("vlm_gateway_call_seconds", "Time to an answer.", [*labels, "cache"], _BUCKETS)
        self._tokens = self._counter("tokens", "Tokens spent, cache hits not counted.", ["model", "key", "kind"])
        self._usd = self._counter("cost_usd", "US dollars spent, by the configured prices.", ["model", "key"])
        self._cache_failures = self._counter("cache_failures", "Cache operations that failed.", ["operation", "kind"])
        self._usage_failures = self._counter("usage_failures", "Times the store of usage could not be used.", [])
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
        key = (role, backend, model, outcome, cache)
        if (series := self._called.get(key)) is None:
            series = _Called(self._calls.series(*key), self._seconds.series(role, backend, model, cache))
            self._called[key] = series
        series.calls.amount += 1.0
        series.seconds.add(seconds)

    def spent(self, model: str, key: str, tokens: Spent, nano_usd: int) -> None:
        """A call was paid for by this key."""
        series = self._spent.get((model, key))
        if series is None or (nano_usd and series.usd is None):
            sums = self._tokens.series(model, key, "prompt"), self._tokens.series(model, key, "completion")
            usd = self._usd.series(model, key) if nano_usd else None
            series = self._spent[model, key] = _Spent(*sums, usd)
        series.prompt.amount += tokens.prompt
        series.completion.amount += tokens.completion
        if series.usd is not None:
            series.usd.amount += nano_usd / 1e9

    def usage_failed(self) -> None:
        """The store of what was spent could not be used."""
        self._usage_failures.add()

    def model_called(
        self, provider: str, model: str, seconds: float, tokens: Tokens | Spent | None = None, error: str = ""
    ) -> None:
        """A call to a model ended; `error` is the code of what went wrong."""
        if tokens is None:
            self._duration.add("chat", provider, model, error, value=seconds)
            return
        if (series := self._counted.get((provider, model, error))) is None:
            spreads = (self._usage.series("chat", provider, model, way) for way in ("input", "output"))
            series = _Counted(self._duration.series("chat", provider, model, error), *spreads)
            self._counted[provider, model, error] = series
        series.seconds.add(seconds)
        series.input.add(tokens.prompt)
        series.output.add(tokens.completion)

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

    def _counter(self, name: str, about: str, labels: Sequence[str]) -> Sums:
        sums = Sums(f"vlm_gateway_{name}", about, labels)
        self._registry.register(sums)
        return sums

    def _spread(self, name: str, about: str, labels: Sequence[str], bounds: Sequence[float]) -> Spreads:
        spreads = Spreads(name, about, labels, bounds)
        self._registry.register(spreads)
        return spreads


def gauge(name: str, about: str, by_model: Mapping[str, float]) -> Metric:
    """One number per model, as it is now."""
    family = GaugeMetricFamily(f"vlm_gateway_{name}", about, labels=["model"])
    for model, value in sorted(by_model.items()):
        family.add_metric([model], value)
    return family


class _Read(Collector):
    def __init__(self, gauges: Callable[[], Iterable[Metric]]) -> None:
        self._gauges = gauges

    def collect(self) -> Iterable[Metric]:
        return self._gauges()
