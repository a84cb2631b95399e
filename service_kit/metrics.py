"""Prometheus figures per route: requests by status, and how long they took.

They are counted in plain dictionaries and made into Prometheus' form when somebody looks: the client library's own
counters and histograms take a lock for every number.
"""

import time
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_BUCKETS = (0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256, 0.512, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)


class Sum:
    """One series of a counter."""

    __slots__ = ("amount",)

    def __init__(self) -> None:
        self.amount = 0.0


class Sums(Collector):
    """A counter: its series by their labels."""

    def __init__(self, name: str, about: str, labels: Sequence[str]) -> None:
        self._name, self._about, self._labels = name, about, labels
        self._sums: dict[tuple[str, ...], Sum] = {}

    def series(self, *labels: str) -> Sum:
        """The one of these labels, for whoever adds to it often."""
        return self._sums.get(labels) or self._sums.setdefault(labels, Sum())

    def add(self, *labels: str, amount: float = 1.0) -> None:
        self.series(*labels).amount += amount

    def collect(self) -> Iterable[Metric]:
        family = CounterMetricFamily(self._name, self._about, labels=self._labels)
        for labels, one in list(self._sums.items()):
            family.add_metric(labels, one.amount)
        return [family]


class Spread:
    """One series of a histogram: how many values lie in each bucket, and their sum."""

    __slots__ = ("_bounds", "counts", "sum")

    def __init__(self, bounds: Sequence[float]) -> None:
        self._bounds = bounds
        self.counts = [0] * (len(bounds) + 1)
        self.sum = 0.0

    def add(self, value: float) -> None:
        self.counts[bisect_left(self._bounds, value)] += 1
        self.sum += value


class Spreads(Collector):
    """A histogram: its series by their labels; `bounds` are the buckets' upper ones, but for the last."""

    def __init__(self, name: str, about: str, labels: Sequence[str], bounds: Sequence[float]) -> None:
        self._name, self._about, self._labels = name, about, labels
        self._bounds = bounds
        self._shown = [*(str(float(bound)) for bound in bounds), "+Inf"]
        self._spreads: dict[tuple[str, ...], Spread] = {}

    def series(self, *labels: str) -> Spread:
        """The one of these labels, for whoever adds to it often."""
        return self._spreads.get(labels) or self._spreads.setdefault(labels, Spread(self._bounds))

    def add(self, *labels: str, value: float) -> None:
        self.series(*labels).add(value)

    def collect(self) -> Iterable[Metric]:
        family = HistogramMetricFamily(self._name, self._about, labels=self._labels)
        for labels, spread in list(self._spreads.items()):
            up_to = list(accumulate(spread.counts))
            family.add_metric(labels, list(zip(self._shown, up_to, strict=True)), spread.sum)
        return [family]


class _Route(NamedTuple):
    """The series of one route, method and status."""

    requests: Sum
    seconds: Spread


class HttpMetrics(Collector):
    """The figures of one service, in a registry of its own; services add theirs to `registry`."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        labels = ["route", "method"]
        self.requests = Sums("http_requests", "Requests by route, method and status.", [*labels, "status"])
        self.seconds = Spreads("http_request_seconds", "Time to answer.", labels, _BUCKETS)
        self.in_flight = 0
        self._routes: dict[tuple[str, str, int], _Route] = {}
        for figures in (self.requests, self.seconds, self):
            self.registry.register(figures)

    def answered(self, route: str, method: str, status: int, took_s: float) -> None:
        """A request has its answer."""
        key = (route, method, status)
        if (series := self._routes.get(key)) is None:
            series = _Route(self.requests.series(route, method, str(status)), self.seconds.series(route, method))
            self._routes[key] = series
        series.requests.amount += 1.0
        series.seconds.add(took_s)

    def collect(self) -> Iterable[Metric]:
        """What is no sum: how many requests are being answered."""
        return [GaugeMetricFamily("http_requests_in_flight", "Requests being answered.", self.in_flight)]


class MetricsMiddleware:
    """ASGI middleware that feeds `HttpMetrics`; routes are named by their pattern, so ids don't multiply series."""

    def __init__(self, app: ASGIApp, metrics: HttpMetrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        status = 500
        started = time.perf_counter()

        async def watched(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        self._metrics.in_flight += 1
        try:
            await self._app(scope, receive, watched)
        finally:
            self._metrics.in_flight -= 1
            self._metrics.answered(route_name(scope), scope["method"], status, time.perf_counter() - started)


def route_name(scope: Scope) -> str:
    """The route's pattern, or "unmatched"."""
    route: Any = scope.get("route")
    return str(getattr(route, "path", "unmatched"))
