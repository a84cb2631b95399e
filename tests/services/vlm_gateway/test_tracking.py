"""Which request it was: in the answer, at the model's server, in the log, and in traces sent to a collector."""

import asyncio
import gzip
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from aiohttp import web
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from services.vlm_gateway.hot.log import RequestLog
from services.vlm_gateway.keys import Keys
from services.vlm_gateway.otel import OtelTracer
from services.vlm_gateway.tracking import request_id_of
from tests.conftest import Serve
from tests.services.vlm_gateway.hot.test_frontend import PATH, chat, key
from tests.services.vlm_gateway.kit import build, chat_backend, floors_body, post, sqlite_cache, wait_until
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says, status, streams


@pytest.mark.parametrize("said", [b"abc-1", b"01HZX/9:=+@._-", b"x" * 128])
def test_a_caller_s_id_is_kept(said: bytes) -> None:
    assert request_id_of(said) == said


@pytest.mark.parametrize("said", [None, b"", b"a b", b"x" * 129, b'"}\n', "é".encode()])
def test_an_id_that_does_not_fit_a_log_line_is_replaced(said: bytes | None) -> None:
    made = request_id_of(said)
    assert len(made) == 32
    assert made != request_id_of(said)


@pytest.mark.parametrize("stream", [False, True])
def test_every_answer_says_which_request_it_was_and_who_answered(
    serve: Serve, mock: OpenAiMock, tmp_path: Path, stream: bool
) -> None:
    mock.will(streams("one") if stream else says("hello"))
    backends = {"m": chat_backend(None, fallbacks=["n"], retries=0), "n": chat_backend(mock, alias="n")}
    url = serve(build(backends, cache=sqlite_cache(tmp_path)).app)
    mine = {"x-request-id": "mine-1"}
    answer = httpx.post(url + PATH, json=chat(stream=stream, temperature=0), headers=mine, timeout=60)
    assert (answer.headers["x-request-id"], answer.headers["x-model"]) == ("mine-1", "n")
    assert mock.asked[0].headers["X-Request-ID"] == "mine-1"
    direct = [httpx.post(url + PATH, json=chat(model="n", temperature=0), timeout=60) for _ in range(2)]
    assert [one.headers["x-model"] for one in direct] == ["n", "n"]
    assert len({one.headers["x-request-id"] for one in direct}) == 2


def test_errors_and_other_routes_say_it_too(serve: Serve, mock: OpenAiMock) -> None:
    keys = Keys({"k": key("k")})
    url = serve(build({"m": chat_backend(mock, retries=0)}, keys=keys).app)
    mine = {"x-request-id": "mine-2", "Authorization": "Bearer k"}
    mock.will(status(400, message="bad"), says('{"floors": 3}'))
    answers = [
        httpx.post(url + PATH, json=chat(), headers=mine, timeout=60),
        post(url, "/v1/floor-count", floors_body(), headers=mine),
        httpx.get(url + "/v1/models", headers=mine, timeout=60),
        httpx.post(url + PATH, content=b"{", headers=mine, timeout=60),
        httpx.post(url + PATH, json=chat(), headers={"x-request-id": "mine-2"}, timeout=60),
        httpx.get(url + "/v1/models", headers={"x-request-id": "mine-2"}, timeout=60),
    ]
    assert [answer.status_code for answer in answers] == [400, 200, 200, 422, 401, 401]
    assert {answer.headers["x-request-id"] for answer in answers} == {"mine-2"}
    assert [answer.headers.get("x-model") for answer in answers[:2]] == ["m", "m"]
    assert mock.asked[1].headers["X-Request-ID"] == "mine-2"


def test_what_is_left_of_a_key_s_rates_is_in_the_answer_as_openai_tells_it(serve: Serve, mock: OpenAiMock) -> None:
    keys = Keys({"k": key("k", requests_per_minute=3, tokens_per_minute=10_000), "free": key("free")})
    url = serve(build({"m": chat_backend(mock)}, keys=keys).app)
    mine = {"Authorization": "Bearer k"}
    answers = [httpx.post(url + PATH, json=chat(), headers=mine, timeout=60) for _ in range(4)]
    left = [answer.headers["x-ratelimit-remaining-requests"] for answer in answers]
    assert (left, answers[3].status_code) == (["2", "1", "0", "0"], 429)
    assert answers[0].headers["x-ratelimit-limit-requests"] == "3"
    assert 9_000 < int(answers[2].headers["x-ratelimit-remaining-tokens"]) < 10_000
    assert answers[3].headers["x-ratelimit-reset-requests"].endswith("s")
    free = httpx.post(url + PATH, json=chat(), headers={"Authorization": "Bearer free"}, timeout=60)
    assert not [name for name in free.headers if "ratelimit" in name]


def test_a_log_line_carries_the_id(capsys: pytest.CaptureFixture[str], serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}, log_share=1.0).app)
    httpx.post(url + PATH, json=chat(), headers={"x-request-id": "mine-3"}, timeout=60)
    seen = ""

    def written() -> bool:
        nonlocal seen
        seen += capsys.readouterr().err
        return "mine-3" in seen

    wait_until(written)
    (line,) = [json.loads(line) for line in seen.splitlines() if "mine-3" in line]
    assert (line["request_id"], line["model"], line["status"]) == ("mine-3", "m", 200)
    assert RequestLog(0.0).wants(500) is False


class Collector:
    """An OpenTelemetry collector: OTLP over HTTP, in a thread of its own."""

    def __init__(self) -> None:
        self.spans: list[Any] = []
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.port = asyncio.run_coroutine_threadsafe(self._serve(), self._loop).result(10)

    async def _serve(self) -> int:
        app = web.Application()
        app.router.add_post("/v1/traces", self._take)
        self._runner = web.AppRunner(app)
        await self._runner.setup()
        await web.TCPSite(self._runner, "127.0.0.1", 0).start()
        return int(self._runner.addresses[0][1])

    async def _take(self, request: web.Request) -> web.Response:
        body = await request.read()
        if request.headers.get("Content-Encoding") == "gzip":
            body = gzip.decompress(body)
        told = ExportTraceServiceRequest.FromString(body)
        self.spans += [
            span for resource in told.resource_spans for scope in resource.scope_spans for span in scope.spans
        ]
        return web.Response()

    def stop(self) -> None:
        asyncio.run_coroutine_threadsafe(self._runner.cleanup(), self._loop).result(10)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()


@pytest.fixture
def collector() -> Iterator[Collector]:
    running = Collector()
    yield running
    running.stop()


def facts(span: Any) -> dict[str, Any]:
    values = {one.key: one.value for one in span.attributes}
    return {name: getattr(value, value.WhichOneof("value")) for name, value in values.items()}


def test_traces_reach_a_collector_with_the_conventions_names(
    serve: Serve, mock: OpenAiMock, collector: Collector
) -> None:
    tracer = OtelTracer(f"http://127.0.0.1:{collector.port}")
    mock.will(status(502), says("hello"))
    backends = {
        "m": chat_backend(mock, fallbacks=["n"], retries=0, server="vllm"),
        "n": chat_backend(mock, alias="n", model="maker/model-2"),
    }
    url = serve(build(backends, tracer=tracer).app)
    trace = "0af7651916cd43dd8448eb211c80319c"
    given = {"traceparent": f"00-{trace}-b7ad6b7169203331-01", "x-request-id": "mine-4"}
    assert httpx.post(url + PATH, json=chat(), headers=given, timeout=60).status_code == 200
    tracer.close()
    spans = {span.name: span for span in collector.spans}
    assert set(spans) == {"POST /v1/chat/completions", "chat maker/model-1", "chat maker/model-2"}
    assert {span.trace_id.hex() for span in spans.values()} == {trace}
    server = spans["POST /v1/chat/completions"]
    assert server.parent_span_id.hex() == "b7ad6b7169203331"
    assert (facts(server)["logisticsvln.request_id"], facts(server)["http.response.status_code"]) == ("mine-4", 200)
    failed, answered = (spans[f"chat maker/model-{number}"] for number in (1, 2))
    assert {span.parent_span_id for span in (failed, answered)} == {server.span_id}
    assert facts(failed)["error.type"] == "model_unreachable"
    assert facts(failed)["gen_ai.provider.name"] == "vllm"
    told = facts(answered)
    assert (told["gen_ai.operation.name"], told["gen_ai.request.model"]) == ("chat", "maker/model-2")
    assert (told["gen_ai.usage.input_tokens"], told["gen_ai.usage.output_tokens"]) == (100, 7)
    sent_on = [asked.headers["traceparent"].split("-") for asked in mock.asked]
    assert [(one[1], one[2]) for one in sent_on] == [
        (trace, failed.span_id.hex()),
        (trace, answered.span_id.hex()),
    ]


def test_a_collector_that_is_gone_fails_no_chat(serve: Serve, mock: OpenAiMock) -> None:
    url = serve(build({"m": chat_backend(mock)}, tracer=OtelTracer("http://127.0.0.1:1")).app)
    assert [httpx.post(url + PATH, json=chat(), timeout=60).status_code for _ in range(3)] == [200] * 3
