"""The requests in the documents are what our services describe of themselves: routes, and bodies with their fields."""

import asyncio
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import jsonschema
import pytest
from starlette.types import ASGIApp

from service_kit.addresses import PORTS, VEHICLE_PORTS
from services.llm_parser.bootstrap import bootstrap as llm_parser
from services.llm_parser.settings import LlmParserSettings
from tests.agreements.test_errors_described import SERVICES
from tests.documented.commands import DOCUMENTS, FOUND, Documented, named

NAMED = re.compile(r"\b(GET|POST|PUT|PATCH|DELETE) (/[^`\s,;)]*)")
VEHICLE = "/v1/episodes/{id}"
"""What `$VEHICLE` and the routes of docs/vehicles.md stand under: a trial of the simulator."""
BY_EXTENSION = {"/v1/balcony-count": "the question that docs/extension-example adds, which tests/extending asks"}
OF_A_FILE = "@"
"""A body that an earlier line of the document wrote."""


class Request(NamedTuple):
    document: str
    method: str
    path: str
    port: int | None = None
    """Of the service, where it is said."""
    body: str | None = None


def of_curl(command: Documented) -> Request | None:
    """What a `curl` asks; None where it asks nobody."""
    line, words = command.line, command.words
    address = next((word for word in words if re.search(r"localhost|127\.0\.0\.1|\$VEHICLE", word)), None)
    if address is None:
        return None
    body = words[words.index("-d") + 1] if "-d" in words else None
    method = re.search(r"-X (\w+)", line)
    port = re.search(r":(\d+)/", address)
    path = re.sub(r"^(http://)?[^/]*|\?.*", "", address.replace("$VEHICLE", f"host{VEHICLE}"))
    return Request(
        command.document,
        method[1] if method else "POST" if body else "GET",
        path,
        int(port[1]) if port else None,
        body if body and body[0] not in ("$", OF_A_FILE) else None,
    )


def named_in(document: Path) -> list[Request]:
    under = VEHICLE if document.name == "vehicles.md" else ""
    found = NAMED.findall(document.read_text(encoding="utf-8"))
    return [
        Request(named(document), method, (path if path.startswith("/v1") else under + path).partition("?")[0])
        for method, path in found
    ]


ASKED = [request for command in FOUND if command.words[0] == "curl" and (request := of_curl(command))]
REQUESTS = sorted({*ASKED, *(request for document in DOCUMENTS for request in named_in(document))}, key=str)


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    """Each service's description of itself (OpenAPI)."""
    chat = LlmParserSettings.read({"PARSER_BACKEND": "chat"})  # does without the reader's weights
    builders = SERVICES | {"llm_parser": lambda _: llm_parser(chat)}
    return {name: asyncio.run(description(build(tmp_path_factory.mktemp(name)))) for name, build in builders.items()}


async def description(app: ASGIApp) -> Any:
    transport = httpx.ASGITransport(app=app)
    headers = {"Authorization": "Bearer s3cret"}
    async with httpx.AsyncClient(transport=transport, base_url="http://localhost", headers=headers) as client:
        return (await client.get("/openapi.json")).json()


def operations(described: Mapping[str, Any], request: Request) -> list[tuple[Any, Any]]:
    """Who describes that request: descriptions, and what each says of it. Vehicles describe themselves as a simulator
    does (contracts/vehicle.py)."""
    steps = [step for step in request.path.split("/") if step]
    found = []
    for service, description in described.items():
        if request.port in (None, *VEHICLE_PORTS.values(), PORTS.get(service)):
            for path, there in description["paths"].items():
                if _alike(steps, [step for step in path.split("/") if step]) and request.method.lower() in there:
                    found.append((description, there[request.method.lower()]))
    return found


def _alike(steps: list[str], described: list[str]) -> bool:
    """A route's fixed steps are as described; what it leaves open, or a document does, may be anything."""
    return len(steps) == len(described) and all(
        one == other or other.startswith("{") for one, other in zip(steps, described, strict=True)
    )


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda r: f"{r.document}: {r.method} {r.path}")
def test_a_request_of_the_documents_is_described_by_its_service(
    request_: Request, described: Mapping[str, Any]
) -> None:
    if request_.path in BY_EXTENSION:
        return
    found = operations(described, request_)
    assert found, f"no service has {request_.method} {request_.path}"
    if request_.body is not None:
        schemas = [
            {**said["requestBody"]["content"]["application/json"]["schema"], "components": description["components"]}
            for description, said in found
        ]
        for schema in schemas:
            jsonschema.validate(json.loads(request_.body), schema)


def test_the_documents_have_requests_of_every_kind() -> None:
    assert {request.method for request in REQUESTS} == {"GET", "POST", "PUT", "DELETE"}
    assert len([request for request in ASKED if request.body]) >= 6
    assert len(REQUESTS) > 40


def test_a_route_or_a_field_that_there_is_not_is_found(described: Mapping[str, Any]) -> None:
    assert operations(described, Request("x", "POST", "/v1/deliverys")) == []
    assert operations(described, Request("x", "POST", "/v1/deliveries", PORTS["sim"])) == []
    with pytest.raises(jsonschema.ValidationError):
        test_a_request_of_the_documents_is_described_by_its_service(
            Request("x", "POST", "/v1/deliveries", body='{"sampel": "villa-teddy-bear"}'), described
        )
