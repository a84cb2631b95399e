"""The pages over records in a folder: the same routes as the orchestrator's, for looking only."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import FastAPI, Header, Query
from fastapi.responses import FileResponse, HTMLResponse, Response
from sse_starlette import EventSourceResponse, ServerSentEvent

from contracts.access import Session
from contracts.base import Name
from contracts.orchestrator import Delivery, DeliveryStatus, OutcomeName
from contracts.overview import Overview, StreetPlan
from orchestrator.access import ASSETS
from orchestrator.pages import Pages
from orchestrator.replays import Replays
from orchestrator.store.lines import Chosen
from service_kit.app import create_app
from service_kit.errors import NotFound, error_answers

MAX_BODY_BYTES = 1024
PING_S = 10
_NOT_FOUND = error_answers(NotFound)


def build_replay_app(replays: Replays) -> FastAPI:
    """Everybody looks on; nothing can be ordered or changed."""
    app = create_app("replay", max_body_bytes=MAX_BODY_BYTES)
    pages = Pages()

    @app.get("/", response_class=HTMLResponse)
    async def viewer() -> Response:
        return pages.page("viewer")

    @app.get(f"{ASSETS}{{file}}", response_class=Response, responses=_NOT_FOUND)
    async def asset(file: str, if_none_match: Annotated[str | None, Header()] = None) -> Response:
        return pages.asset(file, if_none_match)

    @app.get("/v1/session")
    async def get_session() -> Session:
        return Session(role="read_only", asked=False)

    @app.get("/v1/overview", responses=_NOT_FOUND)
    async def get_overview(
        status: DeliveryStatus | None = None,
        outcome: OutcomeName | None = None,
        text: Annotated[str | None, Query(max_length=200)] = None,
        before: Name | None = None,
        limit: Annotated[int, Query(ge=1, le=1000)] = 200,
    ) -> Overview:
        return await replays.overview(Chosen(limit, status, outcome, text, before))

    @app.get("/v1/deliveries/{delivery_id}", responses=_NOT_FOUND)
    async def get_delivery(delivery_id: str) -> Delivery:
        return await replays.get(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/events", response_class=EventSourceResponse, responses=_NOT_FOUND)
    async def get_events(
        delivery_id: str, last_event_id: Annotated[str | None, Header(max_length=20)] = None
    ) -> EventSourceResponse:
        await replays.get(delivery_id)
        after = int(last_event_id) if last_event_id and last_event_id.isdecimal() else 0

        async def stream() -> AsyncIterator[ServerSentEvent]:
            async for event in replays.events(delivery_id, after):
                yield ServerSentEvent(data=event.model_dump_json(), id=str(event.number), event="step")
            yield ServerSentEvent(data="{}", event="end")

        return EventSourceResponse(stream(), ping=PING_S)

    @app.get("/v1/deliveries/{delivery_id}/street", responses=_NOT_FOUND)
    async def get_street(delivery_id: str) -> StreetPlan:
        return await replays.street(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/files/{file}", response_class=FileResponse, responses=_NOT_FOUND)
    async def get_file(delivery_id: str, file: str) -> FileResponse:
        path = await replays.file(delivery_id, file)
        return FileResponse(path, headers={"x-content-type-options": "nosniff", "cache-control": "private, max-age=60"})

    return app
