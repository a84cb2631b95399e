"""The clients before an orchestrator that comes and goes: a server of the test's own, on real HTTP."""

import json
from collections.abc import AsyncIterator

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from logisticsvln import AsyncClient, Client, Garbled, Refused, Unreachable
from tests.conftest import Serve, free_port

DELIVERY = {
    "id": "20260101-000000-abcdef",
    "status": "waiting",
    "phase": "parse",
    "request": "r",
    "scene": None,
    "created": "2026-01-01T00:00:00Z",
    "folder": None,
    "of_a_newer_version": 1,
}


def event(number: int) -> str:
    told = {"number": number, "time_s": 0.5, "phase": "parse", "kind": "phase", "message": "m", "data": {}}
    return f"id: {number}\nevent: step\ndata: {json.dumps(told)}\n\n"


class Unsteady:
    """Breaks its first stream of events off after two, and is starting when it is asked again."""

    def __init__(self) -> None:
        self.asked_after: list[str | None] = []
        self.keys: list[str | None] = []

    async def events(self, request: Request) -> Response:
        self.asked_after.append(request.headers.get("last-event-id"))
        if len(self.asked_after) == 2:
            return JSONResponse({"error": {"code": "stopping", "message": "stopping"}}, 503)
        first = len(self.asked_after) == 1

        async def stream() -> AsyncIterator[str]:
            if first:
                yield event(1) + event(2) + event(3)[:20]
                return
            yield ": ping\n\n" + event(2) + ": ping\n\n" + event(3) + "event: end\ndata: {}\n\n"

        return StreamingResponse(stream(), media_type="text/event-stream")

    async def post(self, request: Request) -> Response:
        self.keys.append(request.headers.get("idempotency-key"))
        return JSONResponse(DELIVERY, 202)

    async def odd(self, request: Request) -> Response:
        if request.path_params["id"] == "page":
            return Response("<html>", media_type="text/html")
        return Response("Bad gateway", 502)

    def app(self) -> Starlette:
        return Starlette(
            routes=[
                Route("/v1/deliveries/{id}/events", self.events),
                Route("/v1/deliveries", self.post, methods=["POST"]),
                Route("/v1/deliveries/{id}", self.odd),
            ]
        )


def test_a_stream_of_events_that_breaks_off_goes_on_where_it_was(serve: Serve) -> None:
    unsteady = Unsteady()
    with Client(serve(unsteady.app())) as client:
        assert [e.number for e in client.events("x")] == [1, 2, 3]
    assert unsteady.asked_after == ["0", "2", "2"]


async def test_the_asynchronous_client_listens_the_same_way(serve: Serve) -> None:
    unsteady = Unsteady()
    async with AsyncClient(serve(unsteady.app())) as client:
        assert [e.number async for e in client.events("x")] == [1, 2, 3]
    assert unsteady.asked_after == ["0", "2", "2"]


def test_every_order_has_a_key_so_that_it_may_be_sent_again(serve: Serve) -> None:
    unsteady = Unsteady()
    with Client(serve(unsteady.app())) as client:
        assert client.deliver("r").id == DELIVERY["id"]  # a field of a newer version is passed over
        client.deliver("r")
        client.deliver("r", key="mine")
    assert len(set(unsteady.keys)) == 3
    assert unsteady.keys[2] == "mine"


def test_what_can_be_no_delivery_is_told_before_anything_is_sent() -> None:
    with Client(f"http://127.0.0.1:{free_port()}") as client, pytest.raises(ValueError, match="priority"):
        client.deliver("r", priority=11)


def test_nobody_something_else_and_a_refusal_are_told_apart(serve: Serve) -> None:
    with Client(f"http://127.0.0.1:{free_port()}", patience_s=0.2) as client:
        with pytest.raises(Unreachable, match="can't reach http://127"):
            client.delivery("x")
        with pytest.raises(Unreachable):
            list(client.events("x"))
        with pytest.raises(Unreachable):
            client.wait("x")
    with Client(serve(Unsteady().app())) as client:
        with pytest.raises(Garbled, match="answered GET /v1/deliveries/page with something else"):
            client.delivery("page")
        with pytest.raises(Refused) as refused:
            client.delivery("proxy")
        assert (refused.value.status, refused.value.code) == (502, "http_error")


def test_a_time_without_its_zone_is_refused_with_what_is_right() -> None:
    from datetime import datetime

    with Client() as client, pytest.raises(ValueError, match="time zone"):
        next(client.deliveries(since=datetime(2026, 1, 1)))
