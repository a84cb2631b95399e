"""The pages over records in a folder: the same routes as the orchestrator's, for looking only."""

from typing import Annotated

from fastapi import FastAPI, Header
from fastapi.responses import HTMLResponse, Response
from sse_starlette import EventSourceResponse

from contracts.access import Session
from contracts.orchestrator import Delivery
from contracts.overview import Overview, StreetPlan
from orchestrator.access import ASSETS
from orchestrator.pages import asset, page
from orchestrator.replays import Replays
from orchestrator.shared_answers import PING_S, ChosenLines, LastEventId, file_answer, number_after, step_stream
from service_kit.app import create_app
from service_kit.errors import NotFound, error_answers

MAX_BODY_BYTES = 1024
_NOT_FOUND = error_answers(NotFound)


def build_replay_app(replays: Replays) -> FastAPI:
    """Everybody looks on; nothing can be ordered or changed."""
    app = create_app("replay", max_body_bytes=MAX_BODY_BYTES)

    @app.get("/", response_class=HTMLResponse)
    async def viewer() -> Response:
        return page("viewer")

    @app.get(f"{ASSETS}{{file}}", response_class=Response, responses=_NOT_FOUND)
    async def get_asset(file: str, if_none_match: Annotated[str | None, Header()] = None) -> Response:
        return asset(file, if_none_match)

    @app.get("/v1/session")
    async def get_session() -> Session:
        return Session(role="read_only", asked=False)

    @app.get("/v1/overview", responses=_NOT_FOUND)
    async def get_overview(chosen: ChosenLines) -> Overview:
        return await replays.overview(chosen)

    @app.get("/v1/deliveries/{delivery_id}", responses=_NOT_FOUND)
    async def get_delivery(delivery_id: str) -> Delivery:
        return await replays.get(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/events", response_class=EventSourceResponse, responses=_NOT_FOUND)
    async def get_events(delivery_id: str, last_event_id: LastEventId = None) -> EventSourceResponse:
        await replays.get(delivery_id)
        events = replays.events(delivery_id, number_after(last_event_id))
        return EventSourceResponse(step_stream(events), ping=PING_S)

    @app.get("/v1/deliveries/{delivery_id}/street", responses=_NOT_FOUND)
    async def get_street(delivery_id: str) -> StreetPlan:
        return await replays.street(delivery_id)

    @app.get("/v1/deliveries/{delivery_id}/files/{file}", response_class=Response, responses=_NOT_FOUND)
    async def get_file(delivery_id: str, file: str) -> Response:
        return file_answer(await replays.file(delivery_id, file))

    return app
