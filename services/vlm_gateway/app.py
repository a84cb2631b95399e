"""vlm_gateway's doors."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Annotated, Any, TypeVar

from fastapi import Body, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from fastapi.routing import APIRoute
from pydantic import ValidationError

from contracts.vlm_gateway import (
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    Question,
)
from service_kit.app import create_app, json_response
from service_kit.errors import BadQuestion, ServiceError
from service_kit.metrics import HttpMetrics
from services.vlm_gateway.backends.chat import ChatBackend
from services.vlm_gateway.chat.passthrough import Passthrough, gone
from services.vlm_gateway.chat.request import read_chat
from services.vlm_gateway.errors import ModelTimeout
from services.vlm_gateway.gateway import Gateway

MAX_BODY_BYTES = 24 * 1024 * 1024
BIG_BODY_BYTES = 512 * 1024
"""From here on a body is parsed in a thread, so that health checks and other callers are still answered."""

T = TypeVar("T")


def build_app(
    gateway: Gateway, metrics: HttpMetrics, *, token: str | None = None, max_body_bytes: int = MAX_BODY_BYTES
) -> FastAPI:
    """The service over a wired `gateway`; its cache is started and everything is closed with the app."""
    started_at = time.time()
    cache = gateway.cache

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if cache is not None:
            await cache.start()
        try:
            yield
        finally:
            for backend in gateway.backends.values():
                await backend.close()
            if cache is not None:
                await cache.close()

    notes = {"cache": cache.problem} if cache is not None and cache.mode == "on" else {}
    checks = {"cache": cache.problem} if cache is not None and cache.mode == "replay" else {}
    app = create_app(
        "vlm_gateway",
        max_body_bytes=max_body_bytes,
        checks=checks,
        notes=notes,
        token=token,
        metrics=metrics,
        lifespan=lifespan,
    )
    app.router.route_class = _OneValidation
    passthrough = Passthrough(gateway)

    async def ask(question: Question, request: Request) -> Response:
        answer = await _within(request, gateway.answer(question))
        response = json_response(answer)
        response.headers["x-cache"] = answer.cache
        return response

    @app.post("/v1/floor-count", response_model=FloorCountAnswer)
    async def floor_count(question: FloorCountQuestion, request: Request) -> Response:
        """How many floors are visible in the picture?"""
        return await ask(question, request)

    @app.post("/v1/building-box", response_model=BuildingBoxAnswer)
    async def building_box(question: BuildingBoxQuestion, request: Request) -> Response:
        """Where in the picture is the building?"""
        return await ask(question, request)

    @app.post("/v1/find-object", response_model=FindObjectAnswer)
    async def find_object(question: FindObjectQuestion, request: Request) -> Response:
        """In which of the views is the object visible, and where?"""
        return await ask(question, request)

    @app.post("/v1/choose-direction", response_model=ChooseDirectionAnswer)
    async def choose_direction(question: ChooseDirectionQuestion, request: Request) -> Response:
        """Towards which of the marked points should the drone fly?"""
        return await ask(question, request)

    @app.post("/v1/chat/completions", response_model=None)
    async def chat_completions(request: Request, body: Annotated[dict[str, Any], Body()]) -> Response:
        """OpenAI's chat completions for the configured chat models, streamed or not. `x-cache: on` or `off` in the
        request overrides that only answers at temperature 0 are cached."""
        raw = await request.body()
        chat = await asyncio.to_thread(read_chat, raw) if len(raw) > BIG_BODY_BYTES else read_chat(raw)
        return await _within(request, passthrough.answer(chat, _wanted(request)))

    @app.get("/v1/models")
    async def models() -> dict[str, object]:
        """The aliases that requests may name, in OpenAI's form; `chat` says whether chat completions take them."""
        data = [
            {
                "id": alias,
                "object": "model",
                "created": int(started_at),
                "owned_by": backend.kind,
                "chat": isinstance(backend, ChatBackend),
                "roles": sorted(role for role, named in gateway.roles.items() if named == alias),
            }
            for alias, backend in sorted(gateway.backends.items())
        ]
        return {"object": "list", "data": data}

    @app.get("/v1/status")
    async def status() -> dict[str, object]:
        """What is configured and how it is doing; no secrets."""
        models = {
            alias: {"backend": backend.kind, "model": backend.model, **backend.status()}
            for alias, backend in sorted(gateway.backends.items())
        }
        cached: dict[str, object] = {"mode": "off"}
        if cache is not None:
            cached = {"mode": cache.mode, "place": cache.place, "state": cache.state}
        return {"models": models, "roles": dict(gateway.roles), "cache": cached}

    return app


class _OneValidation(APIRoute):
    """Bodies go straight from bytes to the contract's type. The framework's own way, parse and then validate, takes
    several times as long over pictures and holds the event loop meanwhile."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        endpoint = self.endpoint
        hints = endpoint.__annotations__
        if "body" in hints:

            async def handle_raw(request: Request) -> Response:
                answer: Response = await endpoint(request=request, body={})  # reads the request's bytes itself
                return answer

            return handle_raw
        model = hints.get("question")
        if model is None:
            return super().get_route_handler()

        async def handle(request: Request) -> Response:
            raw = await request.body()
            if len(raw) > BIG_BODY_BYTES:
                question = await asyncio.to_thread(_validated, model, raw)
            else:
                question = _validated(model, raw)
            answer: Response = await endpoint(question=question, request=request)
            return answer

        return handle


def _validated(model: type[Question], raw: bytes) -> Question:
    try:
        return model.model_validate_json(raw)
    except ValidationError as error:
        problems = error.errors(include_url=False, include_context=False, include_input=False)
        raise RequestValidationError(problems) from None


async def _within(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """`work`, for as long as the caller stays and is going to wait, if it says so in `x-timeout-s`; then it is
    cancelled, so that no model works for nobody."""
    stated = request.headers.get("x-timeout-s")
    limit_s = None
    if stated is not None:
        try:
            limit_s = float(stated)
        except ValueError:
            limit_s = 0.0
        if not 0.001 <= limit_s <= 3600.0:
            work.close()
            raise BadQuestion(f"x-timeout-s: {stated[:20]!r} is no number of seconds from 0.001 to 3600")
    working, leaving = asyncio.ensure_future(work), asyncio.ensure_future(gone(request.receive))
    try:
        await asyncio.wait({working, leaving}, timeout=limit_s, return_when=asyncio.FIRST_COMPLETED)
        if working.done():
            return working.result()
        if leaving.done():
            raise ServiceError("the caller has left", code="caller_left", status=499)
        raise ModelTimeout(f"no answer within the caller's {limit_s:g} s")
    finally:
        unfinished = [task for task in (working, leaving) if not task.done()]
        for task in unfinished:
            task.cancel()
        await asyncio.gather(*unfinished, return_exceptions=True)


def _wanted(request: Request) -> bool | None:
    stated = request.headers.get("x-cache")
    if stated not in (None, "on", "off"):
        raise BadQuestion("x-cache: say on or off, or leave it out")
    return None if stated is None else stated == "on"
