"""Every service built with the kit: one error shape, bounded bodies, health, figures; over real HTTP."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable

import httpx
import pytest
from fastapi import FastAPI
from pydantic import BaseModel, field_validator

from contracts.base import Wire
from contracts.errors import ErrorBody
from service_kit.app import create_app
from service_kit.errors import Conflict

SECRET = "s3cret-token"


class Echo(Wire):
    text: str
    number: float

    @field_validator("text")
    @classmethod
    def _says_something(cls, text: str) -> str:
        if not text:
            raise ValueError("nothing is said; give a word")
        return text


def echo_app(token: str | None = None) -> FastAPI:
    async def broken() -> str | None:
        return "the cupboard is bare"

    async def slow() -> str | None:
        await asyncio.sleep(60)
        return None

    app = create_app(
        "echo", max_body_bytes=10_000, token=token, checks={} if token is None else {"a": broken, "b": slow}
    )

    @app.post("/v1/echo")
    async def echo(message: Echo) -> Echo:
        return message

    @app.get("/v1/things/{thing}")
    async def thing(thing: str) -> Echo:
        if thing == "bug":
            raise RuntimeError("the password is hunter2")
        raise Conflict(f"{thing} exists already; choose another name", details={"thing": thing})

    return app


@pytest.fixture(scope="module")
def url(serve: Callable[[FastAPI], str]) -> str:
    return serve(echo_app())


def error_of(response: httpx.Response) -> tuple[int, str, str]:
    body = ErrorBody.model_validate_json(response.content).error
    return response.status_code, body.code, body.message


def test_a_good_question_is_answered(url: str) -> None:
    assert httpx.post(f"{url}/v1/echo", json={"text": "a", "number": 1.5}, timeout=60).json() == {
        "text": "a",
        "number": 1.5,
    }


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (b'{"text": "a", "number": NaN}', "number: Input should be a finite number"),
        (b'{"text": "a"}', "number: Field required"),
        (b'{"text": "", "number": 1}', "text: nothing is said; give a word"),
        (b'{"text": "a", "number": 1, "more": 2}', "more: there is no such field"),
        (b'{"text": ', "JSON decode error"),
        (b"", "Field required"),
    ],
)
def test_a_bad_question_is_told_what_was_wrong(url: str, body: bytes, words: str) -> None:
    response = httpx.post(f"{url}/v1/echo", content=body, headers={"content-type": "application/json"}, timeout=60)
    status, code, message = error_of(response)
    assert (status, code) == (422, "invalid")
    assert words in message


def test_our_errors_keep_their_facts(url: str) -> None:
    assert error_of(httpx.get(f"{url}/v1/things/cup", timeout=60)) == (
        409,
        "conflict",
        "cup exists already; choose another name",
    )


def test_a_bug_leaves_without_its_words(url: str) -> None:
    response = httpx.get(f"{url}/v1/things/bug", timeout=60)
    assert error_of(response)[:2] == (500, "internal")
    assert "hunter2" not in response.text


@pytest.mark.parametrize(("method", "path", "status"), [("GET", "/nowhere", 404), ("DELETE", "/v1/echo", 405)])
def test_what_is_not_there_has_the_same_shape(url: str, method: str, path: str, status: int) -> None:
    assert error_of(httpx.request(method, url + path, timeout=60))[0] == status


def test_a_body_that_states_a_gigabyte_is_refused_at_once(url: str) -> None:
    host, port = url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=60) as connection:
        connection.sendall(b"POST /v1/echo HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000000\r\n\r\n")
        assert b"413" in connection.recv(2000).split(b"\r\n")[0]


def test_a_body_that_grows_without_stating_its_size_is_cut_off(url: str) -> None:
    sent = 0

    async def endless() -> AsyncIterator[bytes]:
        nonlocal sent
        while sent < 200_000_000:
            sent += 4000
            yield b" " * 4000
            await asyncio.sleep(0)

    async def post() -> httpx.Response | None:
        async with httpx.AsyncClient(timeout=60) as client:
            try:
                return await client.post(f"{url}/v1/echo", content=endless())
            except httpx.TransportError:
                return None  # the server closed while we were still writing: cut off as well

    response = asyncio.run(post())
    assert response is None or error_of(response)[:2] == (413, "body_too_large")
    assert sent < 100_000_000


def test_figures_name_routes_not_ids(url: str) -> None:
    httpx.get(f"{url}/v1/things/one", timeout=60)
    page = httpx.get(f"{url}/metrics", timeout=60).text
    assert 'http_requests_total{method="GET",route="/v1/things/{thing}",status="409"}' in page
    assert "things/one" not in page


def test_health_is_open_and_readiness_says_what_is_missing(serve: Callable[[FastAPI], str]) -> None:
    guarded = serve(echo_app(SECRET))
    assert httpx.get(f"{guarded}/healthz", timeout=60).json()["status"] == "ok"
    status, code, message = error_of(httpx.get(f"{guarded}/readyz", timeout=60))
    assert (status, code) == (503, "not_ready")
    assert "a: the cupboard is bare" in message
    assert "b: no answer within 2 s" in message


@pytest.mark.parametrize("header", [None, "Bearer wrong", f"Basic {SECRET}", f"bearer{SECRET}"])
def test_a_guarded_service_wants_its_token(serve: Callable[[FastAPI], str], header: str | None) -> None:
    guarded = serve(echo_app(SECRET))
    headers = {"authorization": header} if header else {}
    refused = httpx.post(f"{guarded}/v1/echo", json={"text": "a", "number": 1}, headers=headers, timeout=60)
    assert error_of(refused)[:2] == (401, "unauthorised")
    assert SECRET not in refused.text
    let_in = {"authorization": f"Bearer {SECRET}"}
    assert (
        httpx.post(f"{guarded}/v1/echo", json={"text": "a", "number": 1}, headers=let_in, timeout=60).status_code == 200
    )


def test_the_question_type_is_in_the_openapi_document(url: str) -> None:
    class Spec(BaseModel):
        paths: dict[str, object]
        components: dict[str, dict[str, object]]

    spec = Spec.model_validate(httpx.get(f"{url}/openapi.json", timeout=60).json())
    assert "/v1/echo" in spec.paths
    assert "Echo" in spec.components["schemas"]
