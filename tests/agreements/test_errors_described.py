"""Every service's description names the errors that it sends, in the one shape: what is documented is what comes."""

import re
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from starlette.types import ASGIApp

from contracts.errors import ErrorBody
from orchestrator.bootstrap import bootstrap as orchestrator
from orchestrator.settings import OrchestratorSettings
from services.depth_assist.bootstrap import bootstrap as depth_assist
from services.depth_assist.settings import DepthAssistSettings
from services.llm_parser.bootstrap import bootstrap as llm_parser
from services.llm_parser.settings import LlmParserSettings
from services.sim.bootstrap import bootstrap as sim
from services.sim.settings import SimSettings
from services.vlm_gateway.bootstrap import build as vlm_gateway
from services.vlm_gateway.settings import GatewaySettings

TOKEN = "s3cret"
METHODS = ("get", "post", "put", "delete")


def gateway(folder: Path) -> ASGIApp:
    environment = {"GATEWAY_TOKEN": TOKEN, "CACHE_MODE": "off", "USAGE_PATH": str(folder / "usage.sqlite")}
    return vlm_gateway(GatewaySettings.read(environment), None, environment=environment)


SERVICES: dict[str, Callable[[Path], ASGIApp]] = {
    "llm_parser": lambda _: llm_parser(LlmParserSettings.read({"LLM_PARSER_TOKEN": TOKEN})),
    "vlm_gateway": gateway,
    "depth_assist": lambda _: depth_assist(DepthAssistSettings.read({"DEPTH_ASSIST_TOKEN": TOKEN})),
    "sim": lambda _: sim(SimSettings.read({"SIM_TOKEN": TOKEN, "SIM_RENDERER": "tiny"})),
    "orchestrator": lambda folder: orchestrator(
        OrchestratorSettings.read({"ORCHESTRATOR_TOKEN": TOKEN, "RUNS_DIR": str(folder)})
    ),
}
PROVOCATIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("no token", {"headers": {"Authorization": ""}}),
    ("no JSON", {"content": b"{"}),
    ("an unknown field", {"json": {"no-such-field": 1}}),
    ("nothing", {}),
    ("a broken encoding", {"content": b"x", "headers": {"Content-Encoding": "gzip"}}),
    ("an unread encoding", {"content": b"x", "headers": {"Content-Encoding": "br"}}),
    ("a body beyond all limits", {"content": b"x", "headers": {"Content-Length": str(2**40)}}),
    ("a foreign page", {"content": b"{}", "headers": {"Content-Type": "text/plain", "Origin": "http://evil.example"}}),
)


@pytest.mark.parametrize("name", SERVICES)
async def test_errors_come_as_they_are_described(name: str, tmp_path: Path) -> None:
    app = SERVICES[name](tmp_path)
    transport = httpx.ASGITransport(app=app, raise_app_exceptions=False)
    base = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
    running = app.router.lifespan_context(app) if isinstance(app, FastAPI) else nullcontext()
    async with running, httpx.AsyncClient(transport=transport, base_url="http://localhost", headers=base) as client:
        described = (await client.get("/openapi.json")).json()
        assert "HTTPValidationError" not in described["components"]["schemas"]
        for path, operations in described["paths"].items():
            for method in METHODS:
                if method in operations and path not in ("/healthz", "/readyz"):
                    await provoke(client, method, path, operations[method]["responses"])


async def provoke(client: httpx.AsyncClient, method: str, path: str, responses: dict[str, Any]) -> None:
    errors = {status for status in responses if status >= "400"}
    pages = {status for status in errors if "text/html" in responses[status]["content"]}
    for status in errors - pages:
        schema = responses[status]["content"]["application/json"]["schema"]
        assert {"$ref": "#/components/schemas/ErrorBody"} in schema.get("anyOf", [schema]), (path, status)
    for what, sent in PROVOCATIONS:
        answer = await client.request(method, re.sub(r"\{[^}]*\}", "0", path), **sent)
        if answer.status_code >= 400:
            assert answer.status_code != 500, (what, method, path)
            assert str(answer.status_code) in errors, (what, method, path, answer.text)
            if answer.headers["content-type"].startswith("text/html"):
                assert str(answer.status_code) in pages, (what, method, path)
            else:
                ErrorBody.model_validate_json(answer.content)
