"""The gateway's own figures beside those of HTTP."""

from prometheus_client import CollectorRegistry, Counter, Histogram

from contracts.vlm_gateway import Tokens

_BUCKETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0)


class GatewayMetrics:
    """`outcome` is the contract's outcome or an error's code; `model` is the configured alias, so that clients can't
    multiply the series."""

    def __init__(self, registry: CollectorRegistry) -> None:
        labels = ["role", "backend", "model"]
        self._calls = Counter(
            "vlm_gateway_calls", "Questions and chats by outcome.", [*labels, "outcome", "cache"], registry=registry
        )
        self._seconds = Histogram(
            "vlm_gateway_call_seconds", "Time to an answer.", [*labels, "cache"], buckets=_BUCKETS, registry=registry
        )
        self._tokens = Counter(
            "vlm_gateway_tokens", "Tokens spent, cache hits not counted.", ["model", "kind"], registry=registry
        )
        self._cache_failures = Counter(
            "vlm_gateway_cache_failures", "Cache operations that failed.", ["operation", "kind"], registry=registry
        )
        self._retries = Counter(
            "vlm_gateway_retries", "Calls to a server made a second time.", ["model", "after"], registry=registry
        )

    def called(self, role: str, backend: str, model: str, outcome: str, cache: str, seconds: float) -> None:
        self._calls.labels(role, backend, model, outcome, cache).inc()
        self._seconds.labels(role, backend, model, cache).observe(seconds)

    def spent(self, model: str, tokens: Tokens) -> None:
        self._tokens.labels(model, "prompt").inc(tokens.prompt)
        self._tokens.labels(model, "completion").inc(tokens.completion)

    def cache_failed(self, operation: str, kind: str) -> None:
        self._cache_failures.labels(operation, kind).inc()

    def retried(self, model: str, after: str) -> None:
        self._retries.labels(model, after).inc()
