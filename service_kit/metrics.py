"""Prometheus figures per route: requests by status, and how long they took."""

import time
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_BUCKETS = (0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256, 0.512, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)


class HttpMetrics:
    """The figures of one service, in a registry of its own; services add theirs to `registry`."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "http_requests",
            "Requests by route, method and status.",
            ["route", "method", "status"],
            registry=self.registry,
        )
        self.seconds = Histogram(
            "http_request_seconds", "Time to answer.", ["route", "method"], buckets=_BUCKETS, registry=self.registry
        )
        self.in_flight = Gauge("http_requests_in_flight", "Requests being answered.", registry=self.registry)


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

        self._metrics.in_flight.inc()
        try:
            await self._app(scope, receive, watched)
        finally:
            self._metrics.in_flight.dec()
            route = route_name(scope)
            self._metrics.requests.labels(route, scope["method"], str(status)).inc()
            self._metrics.seconds.labels(route, scope["method"]).observe(time.perf_counter() - started)


def route_name(scope: Scope) -> str:
    """The route's pattern, or "unmatched"."""
    route: Any = scope.get("route")
    return str(getattr(route, "path", "unmatched"))
