"""Calls between services end in an answer of the contract or in a typed error, never in anything else."""

import asyncio
from collections.abc import AsyncIterator, Callable

import pytest
from fastapi import FastAPI
from fastapi.responses import HTMLResponse, Response

from contracts.base import Wire
from service_kit.app import create_app
from service_kit.client import Garbled, Refused, ServiceClient, Unreachable
from service_kit.errors import NotFound


class Answer(Wire):
    number: int


def answering_app() -> FastAPI:
    app = create_app("answers", max_body_bytes=1000)

    @app.post("/double")
    async def double(question: Answer) -> Answer:
        return Answer(number=2 * question.number)

    @app.get("/lost")
    async def lost() -> Answer:
        raise NotFound("no such answer; ask for /double", details={"asked": "lost"})

    @app.get("/page", response_class=Response)
    async def page() -> Response:
        return HTMLResponse("<html>a proxy's page</html>")

    @app.get("/broken", response_class=Response)
    async def broken() -> Response:
        return HTMLResponse("<html>bad gateway</html>", status_code=502)

    @app.get("/slow")
    async def slow() -> Answer:
        await asyncio.sleep(30)
        return Answer(number=0)

    return app


@pytest.fixture
async def client(serve: Callable[[FastAPI], str]) -> AsyncIterator[ServiceClient]:
    async with ServiceClient("answers", serve(answering_app()), timeout_s=5) as made:
        yield made


async def test_typed_in_typed_out(client: ServiceClient) -> None:
    assert await client.call("POST", "/double", Answer, Answer(number=21)) == Answer(number=42)


async def test_the_services_own_error_keeps_its_facts(client: ServiceClient) -> None:
    with pytest.raises(Refused) as caught:
        await client.call("GET", "/lost", Answer)
    assert (caught.value.status, caught.value.code, caught.value.details) == (404, "not_found", {"asked": "lost"})


async def test_a_page_in_a_200_is_garbled_and_in_a_502_refused(client: ServiceClient) -> None:
    with pytest.raises(Garbled, match="something else than Answer"):
        await client.call("GET", "/page", Answer)
    with pytest.raises(Refused, match="without our error body"):
        await client.call("GET", "/broken", Answer)


async def test_a_deadline_ends_a_slow_call(client: ServiceClient) -> None:
    with pytest.raises(Unreachable, match=r"within 0\.2 s"):
        await client.call("GET", "/slow", Answer, timeout_s=0.2)


async def test_nobody_there_is_unreachable_and_shows_no_password() -> None:
    async with ServiceClient("ghost", "http://user:hunter2@127.0.0.1:9", timeout_s=2) as ghost:
        with pytest.raises(Unreachable) as caught:
            await ghost.call("GET", "/x", Answer)
        assert "hunter2" not in str(caught.value)
        assert await ghost.ready() is not None


@pytest.mark.parametrize(
    ("token", "said"),
    [
        ("s3cret", None),
        ("wrong", "refuses the token of SIM_TOKEN; set it here to the one that the service was started with"),
        (None, "asks for a token; set SIM_TOKEN or SIM_TOKEN_FILE here to the one it was started with"),
    ],
)
async def test_a_token_that_does_not_fit_is_found_before_anything_is_asked(
    serve: Callable[[FastAPI], str], token: str | None, said: str | None
) -> None:
    async with ServiceClient("sim", serve(create_app("sim", max_body_bytes=1000, token="s3cret")), token=token) as one:
        assert await one.usable() == said
        assert await one.ready() is None


async def test_readiness_of_a_service_that_is_well(client: ServiceClient) -> None:
    assert await client.ready() is None
    assert await client.usable() is None
