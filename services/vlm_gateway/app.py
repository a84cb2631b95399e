"""vlm_gateway's routes."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterable, Mapping
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from prometheus_client import generate_latest
from prometheus_client.core import Metric
from starlette.types import Receive

from contracts.gateway_usage import UsageReport
from contracts.vlm_gateway import (
    ORACLE_VEHICLE_HEADER,
    PreflightAnswer,
    PreflightQuestion,
    Question,
)
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion, NotFound, error_response
from service_kit.json_route import JsonRoute
from service_kit.metrics import HttpMetrics
from service_kit.metrics_pages import MetricsPages
from service_kit.requests import Origins
from service_kit.workers import Worker
from services.vlm_gateway.backends.base import Backend, asked_vehicle
from services.vlm_gateway.cache.claims import Claims
from services.vlm_gateway.chat.backend import ChatBackend
from services.vlm_gateway.config import NO_LIMITS_SET, ChatLimits
from services.vlm_gateway.errors import ERROR_ANSWERS
from services.vlm_gateway.gateway import Gateway
from services.vlm_gateway.hot.calls import Models
from services.vlm_gateway.hot.deadline import caller_left, stated_timeout_s, too_late
from services.vlm_gateway.hot.frontend import Frontend
from services.vlm_gateway.hot.log import RequestLog
from services.vlm_gateway.hot.routes import describe
from services.vlm_gateway.keys import Keys, asking
from services.vlm_gateway.metrics import gauge
from services.vlm_gateway.questions import Kind
from services.vlm_gateway.reloading import Reloader
from services.vlm_gateway.shared_limits import Bell
from services.vlm_gateway.tracking import NO_TRACER, Tracer
from services.vlm_gateway.upstream.client import Upstream
from services.vlm_gateway.usage.report import report

FORMER_VEHICLE_FIELD = "oracle_episode"

T = TypeVar("T")
SHARED_GAUGES = frozenset({"vlm_gateway_running", "vlm_gateway_breaker_open"})
"""Figures that are the same in every worker, or of which the worst is shown."""


def build_app(
    gateway: Gateway,
    metrics: HttpMetrics,
    *,
    keys: Keys | None = None,
    log_share: float = 0.0,
    limits: ChatLimits = NO_LIMITS_SET,
    origins: Origins | None = None,
    tracer: Tracer = NO_TRACER,
    reloader: Reloader | None = None,
    worker: Worker | None = None,
    claims: Claims | None = None,
) -> Frontend:
    """The service over a wired `gateway`: the framework's app behind the frontend for chats. Its cache is started and
    everything is closed with the app. Without `keys` everybody may ask everything; `log_share` of the chats get a line
    in the log."""
    started_at = time.time()
    pages = origins or Origins()
    cache = gateway.cache
    passed_on = Models(
        chat_targets(gateway.backends),
        gateway.roles.get("parser"),
        cache,
        gateway.metrics,
        gateway.accounts,
        tracer,
        claims,
    )
    known = keys or Keys({})
    log = RequestLog(log_share)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if cache is not None:
            await cache.start()
        if reloader is not None:
            reloader.start()
        if worker is not None and pages_of_all is not None:
            pages_of_all.start()
            Bell(worker, lambda: _serve(chat_targets(gateway.backends))).start()
        try:
            yield
        finally:
            if reloader is not None:
                await reloader.close()
            if pages_of_all is not None:
                await pages_of_all.close()
            for backend in gateway.backends.values():
                await backend.close()
            log.flush()
            await gateway.accounts.ledger.close()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(asyncio.to_thread(tracer.close), 2.0)
            if claims is not None:
                await claims.close()
            if cache is not None:
                await cache.close()

    pages_of_all = None
    if worker is not None:
        own = partial(_page, metrics)
        pages_of_all = MetricsPages(Path(worker.folder), worker.number, own, SHARED_GAUGES)
    notes = {"cache": cache.problem} if cache is not None and cache.mode == "on" else {}
    checks = {"cache": cache.problem} if cache is not None and cache.mode == "replay" else {}
    app = create_app(
        "vlm_gateway",
        max_body_bytes=limits.body_bytes,
        checks=checks,
        notes=notes,
        metrics=metrics,
        origins=pages,
        asks_itself=True,
        errors=ERROR_ANSWERS,
        metrics_page=pages_of_all.merged if pages_of_all is not None else None,
        lifespan=lifespan,
    )
    app.router.route_class = JsonRoute
    gateway.metrics.watch(lambda: _gauges(chat_targets(gateway.backends)))
    _refuse_vehicles_in_bodies(app)

    async def ask(question: Question, request: Request) -> Response:
        asked_vehicle.set(request.headers.get(ORACLE_VEHICLE_HEADER))
        answer = await _within(request, gateway.answer(question))
        response = json_response(answer)
        response.headers["x-cache"] = answer.cache
        response.headers["x-model"] = gateway.asked(question)
        return response

    @app.post("/v1/preflight")
    async def preflight(question: PreflightQuestion) -> PreflightAnswer:
        """Before take-off: is there such a model, and can it recognise this object? The model is not run."""
        return await gateway.preflight(question)

    for kind in gateway.kinds:
        _add_route(app, kind, ask)

    describe(app)

    def entry(alias: str) -> dict[str, object]:
        backend = gateway.backends[alias]
        return {
            "id": alias,
            "object": "model",
            "type": "model",
            "display_name": alias,
            "created": int(started_at),
            "owned_by": backend.kind,
            "chat": isinstance(backend, ChatBackend),
            "roles": sorted(role for role, named in gateway.roles.items() if named == alias),
        }

    @app.get("/v1/models")
    async def models() -> dict[str, object]:
        """The aliases that the caller may name, in OpenAI's form and Anthropic's; `chat` says whether chat completions
        take them, and those come first: many clients take the first of the list."""
        mine = [alias for alias in gateway.backends if asking.get().may_ask(alias)]
        mine.sort(key=lambda alias: (not isinstance(gateway.backends[alias], ChatBackend), alias))
        return {"object": "list", "data": [entry(alias) for alias in mine], "has_more": False}

    @app.get("/v1/models/{alias:path}")
    async def model(alias: str) -> dict[str, object]:
        """One of them."""
        if alias not in gateway.backends or not asking.get().may_ask(alias):
            raise NotFound(f"no model {alias!r}; GET /v1/models lists those there are", code="model_not_found")
        return entry(alias)

    @app.get("/v1/usage")
    async def usage() -> UsageReport:
        """What the asking key and its team have spent and may still spend; an operator sees every key and team."""
        return await report(gateway.accounts.ledger, known, asking.get())

    @app.get("/v1/status")
    async def status() -> dict[str, object]:
        """What is configured and how it is doing; no secrets."""
        models = {
            alias: {"backend": backend.kind, "model": backend.model, **backend.status()}
            for alias, backend in sorted(gateway.backends.items())
        }
        configured: dict[str, object] = {"configuration": reloader.status()} if reloader is not None else {}
        if worker is not None:
            configured["worker"] = {"number": worker.number, "of": worker.count}
        cached: dict[str, object] = {"mode": "off"}
        if cache is not None:
            cached = {"mode": cache.mode, "place": cache.place, "state": cache.state}
        ledger = gateway.accounts.ledger
        spending = {"place": ledger.place, "state": ledger.state}
        return {"models": models, "roles": dict(gateway.roles), "cache": cached, "usage": spending, **configured}

    return Frontend(
        app,
        passed_on,
        known,
        cache,
        gateway.metrics,
        metrics,
        log,
        limits=limits,
        origins=pages,
        tracer=tracer,
    )


def _add_route(app: FastAPI, kind: Kind, ask: Callable[[Question, Request], Awaitable[Response]]) -> None:
    async def route(question: Question, request: Request) -> Response:
        return await ask(question, request)

    route.__annotations__["question"] = kind.question  # by which the framework reads the body
    name = kind.path.replace("-", "_")
    app.post(f"/v1/{kind.path}", response_model=kind.answer, name=name, description=kind.about)(route)


def _refuse_vehicles_in_bodies(app: FastAPI) -> None:
    """Questions used to name the oracle's vehicle in a field; whoever still does is told where it belongs."""
    usual = cast(Callable[[Request, Exception], Awaitable[Response]], app.exception_handlers[RequestValidationError])
    right = f"{FORMER_VEHICLE_FIELD}: there is no such field; name the vehicle in the header {ORACLE_VEHICLE_HEADER}"

    @app.exception_handler(RequestValidationError)
    async def refuse(request: Request, error: RequestValidationError) -> Response:
        if any(found["loc"][-1] == FORMER_VEHICLE_FIELD for found in error.errors()):
            return error_response(422, "named_in_a_header", right)
        return await usual(request, error)


async def _within(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """`work`, for as long as the caller stays and is going to wait, if it says so in `x-timeout-s`; then it is
    cancelled, so that no model works for nobody."""
    try:
        limit_s = stated_timeout_s(request.headers.get("x-timeout-s"))
    except BadQuestion:
        work.close()
        raise
    working, leaving = asyncio.ensure_future(work), asyncio.ensure_future(gone(request.receive))
    try:
        await asyncio.wait({working, leaving}, timeout=limit_s, return_when=asyncio.FIRST_COMPLETED)
        if working.done():
            return working.result()
        if leaving.done():
            raise caller_left()
        assert limit_s is not None
        raise too_late(limit_s)
    finally:
        unfinished = [task for task in (working, leaving) if not task.done()]
        for task in unfinished:
            task.cancel()
        await asyncio.gather(*unfinished, return_exceptions=True)


async def gone(receive: Receive) -> None:
    """Returns when the client has left. To be asked once the request's body was read."""
    while (await receive())["type"] != "http.disconnect":
        pass


def _page(metrics: HttpMetrics) -> str:
    return generate_latest(metrics.registry).decode()


def _serve(upstreams: Mapping[str, Upstream]) -> None:
    """Another worker has given a place back."""
    for upstream in upstreams.values():
        upstream.admission.serve()


def chat_targets(backends: Mapping[str, Backend]) -> dict[str, Upstream]:
    """The models that chats are passed on to, by alias."""
    return {alias: backend.upstream for alias, backend in backends.items() if isinstance(backend, ChatBackend)}


def _gauges(upstreams: Mapping[str, Upstream]) -> Iterable[Metric]:
    """How every chat model is doing just now."""
    states = {"closed": 0.0, "half_open": 0.5, "open": 1.0}
    running = {alias: upstream.admission.running for alias, upstream in upstreams.items()}
    waiting = {alias: upstream.admission.waiting for alias, upstream in upstreams.items()}
    open_ = {alias: states[upstream.state] for alias, upstream in upstreams.items()}
    yield gauge("running", "Questions and chats at the model's server.", running)
    yield gauge("waiting", "Questions and chats that wait for a place there.", waiting)
    yield gauge("breaker_open", "1 where the model isn't asked after failures, 0.5 where one may try.", open_)
