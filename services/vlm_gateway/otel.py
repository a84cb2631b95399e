"""Traces sent to an OpenTelemetry collector by OTLP over HTTP. Needs the extra `otel`."""

from typing import Any

from opentelemetry import trace
from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
from opentelemetry.sdk.resources import Resource
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import BatchSpanProcessor, SpanExporter
from opentelemetry.trace import SpanKind, Status, StatusCode
from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

from services.vlm_gateway.tracking import Span

_PROPAGATOR = TraceContextTextMapPropagator()


class OtelTracer:
    """Spans are sent in batches from a thread of the SDK's; `close` sends what is left."""

    def __init__(self, endpoint: str = "", *, exporter: SpanExporter | None = None) -> None:
        """`endpoint` is a collector's address without `/v1/traces`."""
        self._provider = TracerProvider(resource=Resource.create({"service.name": "vlm_gateway"}))
        sink = exporter or OTLPSpanExporter(endpoint=endpoint.rstrip("/") + "/v1/traces")
        self._provider.add_span_processor(BatchSpanProcessor(sink))
        self._tracer = self._provider.get_tracer("logisticsvln.vlm_gateway")

    def request(self, parent: bytes | None, request_id: bytes) -> Span:
        facts = {
            "http.request.method": "POST",
            "http.route": "/v1/chat/completions",
            "logisticsvln.request_id": request_id.decode("latin-1"),
        }
        return self._begun("POST /v1/chat/completions", SpanKind.SERVER, parent, facts)

    def model_call(self, parent: bytes | None, provider: str, model: str, alias: str) -> Span:
        facts = {
            "gen_ai.operation.name": "chat",
            "gen_ai.provider.name": provider,
            "gen_ai.request.model": model,
            "logisticsvln.model_alias": alias,
        }
        return self._begun(f"chat {model}", SpanKind.CLIENT, parent, facts)

    def close(self) -> None:
        self._provider.shutdown()

    def _begun(self, name: str, kind: SpanKind, parent: bytes | None, facts: dict[str, str]) -> Span:
        carrier = {} if parent is None else {"traceparent": parent.decode("ascii")}
        return _OtelSpan(self._tracer.start_span(name, _PROPAGATOR.extract(carrier), kind, attributes=facts))


class _OtelSpan:
    def __init__(self, span: trace.Span) -> None:
        self._span = span

    @property
    def traceparent(self) -> bytes:
        carrier: dict[str, str] = {}
        _PROPAGATOR.inject(carrier, trace.set_span_in_context(self._span))
        return carrier["traceparent"].encode()

    def end(self, **facts: Any) -> None:
        if not self._span.is_recording():
            return
        self._span.set_attributes(facts)
        if "error.type" in facts:
            self._span.set_status(Status(StatusCode.ERROR, str(facts["error.type"])))
        self._span.end()
