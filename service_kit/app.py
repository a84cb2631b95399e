"""The factory that every service is built with: limits, one error shape, health, metrics."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel
from starlette.middleware.cors import CORSMiddleware

from contracts.health import Health
from service_kit.auth import Guard, Guarded, TokenGuard, access_of
from service_kit.errors import Unavailable, describe_errors_as_json, install_error_renderer, usual_answers
from service_kit.leaving import Stopping
from service_kit.limits import BodyLimit
from service_kit.metrics import HttpMetrics, MetricsMiddleware
from service_kit.requests import EXPOSED, Origins, RequestForms

Check = Callable[[], Awaitable[str | None]]
"""A readiness check: null when all is well, else what is wrong (no secrets)."""

CHECK_TIMEOUT_S = 2.0


def create_app(
    service: str,
    *,
    max_body_bytes: int,
    checks: Mapping[str, Check] | None = None,
    notes: Mapping[str, Check] | None = None,
    about: Mapping[str, str] | None = None,
    token: str | None = None,
    guard: Guard | None = None,
    asks_itself: bool = False,
    errors: Mapping[int | str, dict[str, Any]] | None = None,
    metrics: HttpMetrics | None = None,
    origins: Origins | None = None,
    metrics_page: Callable[[], str] | None = None,
    lifespan: Callable[[FastAPI], AbstractAsyncContextManager[None]] | None = None,
) -> FastAPI:
    """A FastAPI app with `/healthz`, `/readyz`, `/metrics`, bounded bodies and our error shape.

    `checks` are asked, each for at most 2 s, by `/readyz`, which also tells `about`: which parts were chosen here.
    `notes` are asked and shown like `checks`, but what is wrong with them leaves the service ready. `token` puts a
    bearer token in front of all but health; a `guard` decides in its place; where the
    app is behind another that asks for keys it says `asks_itself`. `errors`: what else all of its routes may answer.
    Web pages of `origins` may ask, besides the service's own. `metrics_page`
    makes the figures' page where it is not that of this process alone.
    """
    if guard is None and token:
        guard = TokenGuard(token)
    app = FastAPI(
        title=f"LogisticsVLN {service}",
        version=version("logisticsvln"),
        lifespan=lifespan,
        responses=usual_answers(guarded=guard is not None or asks_itself) | dict(errors or {}),
    )
    figures = metrics or HttpMetrics()
    app.state.metrics = figures
    install_error_renderer(app)
    describe_errors_as_json(app)
    pages = origins or Origins()
    app.add_middleware(RequestForms, origins=pages, max_bytes=max_body_bytes)
    app.add_middleware(BodyLimit, max_bytes=max_body_bytes)
    app.state.guarded = guard is not None
    if guard is not None:
        app.add_middleware(Guarded, guard=guard)
    if pages.allowed:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=sorted(pages.allowed),
            allow_methods=["*"],
            allow_headers=["*"],
            expose_headers=EXPOSED,
        )
    app.add_middleware(Stopping)
    app.add_middleware(MetricsMiddleware, metrics=figures)

    @app.get("/healthz", tags=["health"])
    async def healthz() -> Health:
        """Alive."""
        return Health(status="ok", service=service)

    @app.get("/readyz", tags=["health"])
    async def readyz(request: Request) -> Health:
        """Everything this service needs answers; 503 with the reasons where it doesn't. `access` says whether the
        token of this very request, if it has one, opens the other routes."""
        needed, noted = dict(checks or {}), dict(notes or {})
        named = noted | needed
        found = await asyncio.gather(*(_ask(check) for check in named.values()))
        states = {name: problem or "ok" for name, problem in zip(named, found, strict=True)}
        wrong = [name for name in needed if states[name] != "ok"]
        if wrong:
            bad = "; ".join(f"{name}: {states[name]}" for name in wrong)
            raise Unavailable(f"{service} is not ready: {bad}", code="not_ready", details={"checks": states})
        access = access_of(request.scope)
        return Health(status="ready", service=service, access=access, checks=states, about=dict(about or {}))

    @app.get("/metrics", tags=["health"], response_class=Response)
    async def metrics_route() -> Response:
        """Prometheus' text format."""
        page = generate_latest(figures.registry) if metrics_page is None else metrics_page()
        return Response(page, media_type=CONTENT_TYPE_LATEST)

    return app


async def _ask(check: Check) -> str | None:
    try:
        return await asyncio.wait_for(check(), CHECK_TIMEOUT_S)
    except TimeoutError:
        return f"no answer within {CHECK_TIMEOUT_S:g} s"
    except Exception as error:
        return type(error).__name__


def json_response(message: BaseModel, status: int = 200) -> Response:
    """A message straight to JSON bytes, without the framework's second validation: for large answers."""
    return Response(message.model_dump_json(), status_code=status, media_type="application/json")
