"""The REST door: deliveries, their events as they happen, their pictures, and the viewer."""

import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Annotated

import anyio.to_thread
from fastapi import FastAPI, Header, Query, Request, Response
from pydantic import AwareDatetime
from sqlalchemy.exc import DBAPIError
from sse_starlette import EventSourceResponse, ServerSentEvent

from contracts.base import Name
from contracts.fleet import FleetList
from contracts.orchestrator import CustomerAnswer, Delivery, DeliveryList, DeliveryQuestion, DeliveryStatus
from orchestrator import sample_library
from orchestrator.access import EVERYBODY, Access, RoleGuard
from orchestrator.access_routes import add_access_routes
from orchestrator.assembly import Orchestrator
from orchestrator.beside import beside
from orchestrator.overview_routes import add_overview_routes
from orchestrator.shared_answers import PING_S, LastEventId, file_answer, number_after, step_stream
from orchestrator.store.lines import Chosen
from service_kit.app import Check, create_app
from service_kit.errors import Conflict, NotFound, TooMany, Unavailable, error_answers, error_response

log = logging.getLogger("orchestrator.app")

MAX_BODY_BYTES = 4 * 1024 * 1024
_NOT_FOUND = error_answers(NotFound)
_WHILE_LIVE = error_answers(Conflict, NotFound, TooMany)


def build_app(
    orchestrator: Orchestrator,
    *,
    checks: Mapping[str, Check] | None = None,
    access: Access = EVERYBODY,
    on_close: Callable[[], Awaitable[None]] | None = None,
) -> FastAPI:
    """The orchestrator's app; `access` says who may do what."""
    deliveries = orchestrator.deliveries

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await orchestrator.start()
        try:
            yield
        finally:
            await orchestrator.close()
            if on_close is not None:
                await on_close()

    guard = RoleGuard(access) if access.asked else None
    app = create_app("orchestrator", max_body_bytes=MAX_BODY_BYTES, checks=checks, guard=guard, lifespan=lifespan)

    @app.exception_handler(DBAPIError)
    async def _no_database(_: Request, error: DBAPIError) -> Response:
        log.error("the database does not answer: %s", error.orig)
        return error_response(503, "no_database", "the database does not answer; try again later")

    @app.post("/v1/deliveries", status_code=202, tags=["deliveries"], responses=_WHILE_LIVE)
    async def post_delivery(
        question: DeliveryQuestion,
        response: Response,
        idempotency_key: Annotated[str | None, Header(min_length=1, max_length=200)] = None,
    ) -> Delivery:
        """Takes a delivery, which waits for its turn; follow it by its events. The same `Idempotency-Key` again is the
        same delivery, however often it is posted. 429 where too many wait."""
        delivery = await deliveries.take(question, idempotency_key)
        response.headers["location"] = f"/v1/deliveries/{delivery.id}"
        return delivery

    @app.get("/v1/deliveries", tags=["deliveries"])
    async def list_deliveries(
        status: DeliveryStatus | None = None,
        since: AwareDatetime | None = None,
        text: Annotated[str | None, Query(max_length=200)] = None,
        before: Name | None = None,
        limit: Annotated[int, Query(ge=1, le=1000)] = 200,
    ) -> DeliveryList:
        """The newest first: of that `status`, taken `since` then, with that `text` in request or id. `before`: the
        answer's `next`, for the page that follows."""
        taken = None if since is None else since.timestamp()
        return await deliveries.list(Chosen(limit, status, text=text, before=before, since=taken))

    @app.get("/v1/deliveries/{delivery_id}", tags=["deliveries"], responses=_NOT_FOUND)
    async def get_delivery(delivery_id: str) -> Delivery:
        return await deliveries.get(delivery_id)

    @app.delete("/v1/deliveries/{delivery_id}", tags=["deliveries"], responses=_WHILE_LIVE)
    async def cancel_delivery(delivery_id: str) -> Delivery:
        """Ends a delivery, whatever its status; the answer comes when its record is complete."""
        return await deliveries.cancel(delivery_id)

    @app.post("/v1/deliveries/{delivery_id}/answer", tags=["deliveries"], responses=_WHILE_LIVE)
    async def post_answer(delivery_id: str, answer: CustomerAnswer) -> Delivery:
        """The customer's answer to the question of a delivery that is `needs_answer`; the delivery goes on. 409 where
        nothing is asked."""
        return await deliveries.answer(delivery_id, answer.text)

    @app.get(
        "/v1/deliveries/{delivery_id}/events",
        tags=["deliveries"],
        response_class=EventSourceResponse,
        responses=_NOT_FOUND,
    )
    async def get_events(
        delivery_id: str,
        last_event_id: LastEventId = None,
        drone: Annotated[bool, Query(description="twice a second, where the drone is (`drone`: DroneSeen)")] = False,
    ) -> EventSourceResponse:
        """Server-sent events: `id` is the event's number, `data` the event. `Last-Event-ID` goes on after that one.
        The stream ends with the event of kind `result`."""
        await deliveries.get(delivery_id)
        steps = step_stream(deliveries.events(delivery_id, number_after(last_event_id)))

        async def drones() -> AsyncIterator[ServerSentEvent]:
            async for seen in orchestrator.overlook.telemetry.samples(delivery_id):
                yield ServerSentEvent(data=seen.model_dump_json(), event="drone")

        return EventSourceResponse(beside(steps, drones()) if drone else steps, ping=PING_S)

    @app.get(
        "/v1/deliveries/{delivery_id}/files/{file}",
        tags=["deliveries"],
        response_class=Response,
        responses=error_answers(NotFound, Unavailable),
    )
    async def get_file(delivery_id: str, file: str) -> Response:
        """A picture that an event names, `summary.png`, `events.jsonl`, `result.json` or `question.json`."""
        return file_answer(await deliveries.file(delivery_id, file))

    @app.get("/v1/vehicles", tags=["fleet"])
    async def list_vehicles() -> FleetList:
        """The vehicles of the fleet, by name: what each can do, where it is, and what it flies."""
        return FleetList(vehicles=await orchestrator.fleet.list())

    @app.get("/v1/samples", tags=["deliveries"])
    async def list_samples() -> list[str]:
        """Names of the deliveries that ship with the project."""
        return await anyio.to_thread.run_sync(sample_library.names)

    async def known(delivery_id: str) -> None:
        await deliveries.get(delivery_id)

    add_overview_routes(app, orchestrator.overlook, orchestrator.order_form)
    add_access_routes(app, access, known)
    return app
