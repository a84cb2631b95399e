"""What the orchestrator and the pages over a run's records take and answer alike."""

from collections.abc import AsyncIterator
from mimetypes import guess_type
from typing import Annotated

from fastapi import Depends, Header, Query
from fastapi.responses import Response
from sse_starlette import ServerSentEvent

from contracts.base import Name
from contracts.events import Event
from contracts.orchestrator import DeliveryStatus, OutcomeName
from orchestrator.record_files import Shown
from orchestrator.store.lines import Chosen

PING_S = 10
"""So long a stream of events says nothing at most."""
LastEventId = Annotated[str | None, Header(max_length=20)]


def _chosen(
    status: DeliveryStatus | None = None,
    outcome: OutcomeName | None = None,
    text: Annotated[str | None, Query(max_length=200)] = None,
    before: Name | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> Chosen:
    return Chosen(limit, status, outcome, text, before)


ChosenLines = Annotated[Chosen, Depends(_chosen)]


def number_after(last_event_id: str | None) -> int:
    """The number of the event that a listener had last; 0 for one who had none."""
    return int(last_event_id) if last_event_id and last_event_id.isdecimal() else 0


async def step_stream(events: AsyncIterator[Event]) -> AsyncIterator[ServerSentEvent]:
    """Each event as a `step`, by its number; `end` after the last."""
    async for event in events:
        yield ServerSentEvent(data=event.model_dump_json(), id=str(event.number), event="step")
    yield ServerSentEvent(data="{}", event="end")


def file_answer(shown: Shown) -> Response:
    """A file of a record."""
    headers = {"x-content-type-options": "nosniff", "cache-control": "private, max-age=60"}
    return Response(shown.content, media_type=guess_type(shown.name)[0] or "text/plain", headers=headers)
