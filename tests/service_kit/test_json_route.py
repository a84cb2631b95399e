"""Bodies validated from their bytes: same answers, same errors, same OpenAPI as the framework's way."""

import httpx
import pytest
from fastapi import FastAPI
from pydantic import Field

from contracts.base import Wire
from service_kit.errors import install_error_renderer
from service_kit.json_route import JsonRoute


class Parcel(Wire):
    weight_kg: float = Field(gt=0.0)
    label: str


def _app(*, direct: bool) -> FastAPI:
    app = FastAPI()
    install_error_renderer(app)
    if direct:
        app.router.route_class = JsonRoute

    @app.post("/parcels/{number}")
    def post(number: int, parcel: Parcel, twice: bool = False) -> Parcel:
        return parcel if not twice else Parcel(weight_kg=parcel.weight_kg * 2, label=f"{parcel.label} {number}")

    @app.get("/parcels")
    def count() -> int:
        return 3

    return app


async def _ask(app: FastAPI, method: str, path: str, **kwargs: object) -> httpx.Response:
    transport = httpx.ASGITransport(app=app)
    async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
        return await client.request(method, path, **kwargs)  # type: ignore[arg-type]


@pytest.mark.parametrize("direct", [True, False])
async def test_body_path_and_query_arrive_together(direct: bool) -> None:
    answer = await _ask(_app(direct=direct), "POST", "/parcels/7?twice=true", json={"weight_kg": 1.5, "label": "a"})
    assert answer.json() == {"weight_kg": 3.0, "label": "a 7"}


async def test_a_route_without_a_body_goes_the_usual_way() -> None:
    assert (await _ask(_app(direct=True), "GET", "/parcels")).json() == 3


@pytest.mark.parametrize(
    ("content", "field"),
    [
        (b'{"weight_kg": -1, "label": "a"}', "weight_kg"),
        (b'{"weight_kg": NaN, "label": "a"}', "weight_kg"),
        (b'{"weight_kg": 1e999, "label": "a"}', "weight_kg"),
        (b'{"weight_kg": 1}', "label"),
        (b'{"weight_kg": 1, "label": "a", "colour": "red"}', "colour"),
        (b'{"weight_kg": ', "body"),
        (b"\xff\xfe", "body"),
        (b"[" * 100_000, "body"),
        (b"", "body"),
    ],
)
async def test_a_wrong_body_names_the_field(content: bytes, field: str) -> None:
    headers = {"content-type": "application/json; charset=utf-8"}
    answer = await _ask(_app(direct=True), "POST", "/parcels/7", content=content, headers=headers)
    assert answer.status_code == 422
    assert answer.json()["error"]["code"] == "invalid"
    assert answer.json()["error"]["details"]["problems"][0]["field"] == field


async def test_a_body_that_is_not_called_json_is_refused() -> None:
    answer = await _ask(
        _app(direct=True),
        "POST",
        "/parcels/7",
        content=b'{"weight_kg": 1, "label": "a"}',
        headers={"content-type": "text/plain"},
    )
    assert answer.status_code == 422


def test_openapi_stays_the_same() -> None:
    assert _app(direct=True).openapi() == _app(direct=False).openapi()
