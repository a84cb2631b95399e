"""A token before every service: each caller finds it in a file, and a wrong one is found before anything is flown."""

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from contracts.orchestrator import DeliveryQuestion, MissionSettings
from launcher.processes import Processes, free_ports, oracle_settings
from mission.clients import Services
from orchestrator.bootstrap import bootstrap
from orchestrator.delivery import Order, Run
from orchestrator.settings import OrchestratorSettings
from service_kit.addresses import FLIGHT_SERVICES, PORTS
from service_kit.connections import TOKEN_VARIABLES, Connections
from service_kit.settings import process_environment

SAMPLE = "villa-teddy-bear"


@pytest.fixture(scope="module")
def secrets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A token file a service, as an operator mounts them."""
    folder = tmp_path_factory.mktemp("secrets")
    for name in TOKEN_VARIABLES:
        (folder / name).write_text(f"{name}-s3cret\n")
    return {f"{variable}_FILE": str(folder / name) for name, variable in TOKEN_VARIABLES.items()}


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory, secrets: dict[str, str]) -> Iterator[Processes]:
    tmp_path = tmp_path_factory.mktemp("guarded")
    ports = free_ports(PORTS)
    extra = oracle_settings(ports)
    extra["vlm_gateway"] |= {"CACHE_MODE": "off"}
    extra["orchestrator"] = {"RUNS_DIR": str(tmp_path / "runs")}
    environment = process_environment() | secrets
    group = Processes(ports, tmp_path / "logs", environment=environment, extra=extra)
    try:
        group.start()
        asyncio.run(group.ready())
        yield group
    finally:
        group.stop()


async def test_tokens_in_files_reach_every_service(guarded: Processes, secrets: dict[str, str], tmp_path: Path) -> None:
    async with Services(guarded.addresses, Connections.read(secrets).tokens) as services:
        assert [await client.usable() for client in services.all] == [None] * len(FLIGHT_SERVICES)
        settings = MissionSettings(image_size=200)
        run = Run(Order(DeliveryQuestion(sample=SAMPLE, backend="oracle", settings=settings)), tmp_path / "own")
        assert (await run.fly(services.simulated())).outcome == "delivered"
    orchestrator = next(child.url for child in guarded.children if child.name == "orchestrator")
    async with httpx.AsyncClient(base_url=orchestrator) as client:
        checks = (await client.get("/readyz")).json()["checks"]
        assert checks == dict.fromkeys((*FLIGHT_SERVICES, "database", "records"), "ok")
        assert (await client.get("/v1/deliveries")).status_code == 401
        allowed = await client.get("/v1/deliveries", headers={"Authorization": "Bearer orchestrator-s3cret"})
        assert allowed.status_code == 200


async def test_without_its_token_a_service_ends_the_mission_as_unreachable(guarded: Processes, tmp_path: Path) -> None:
    async with Services(guarded.addresses) as services:
        run = Run(Order(DeliveryQuestion(sample=SAMPLE)), tmp_path / "own")
        result = await run.fly(services.simulated())
    assert result.outcome == "service_unreachable"
    assert "llm_parser refuses our token (401); set LLM_PARSER_TOKEN or LLM_PARSER_TOKEN_FILE" in result.message


async def test_the_orchestrator_is_not_ready_with_a_wrong_token_and_names_service_and_variable(
    guarded: Processes, secrets: dict[str, str], serve: Callable[[FastAPI], str], tmp_path: Path
) -> None:
    at = guarded.addresses
    environment = secrets | {f"{name.upper()}_URL": getattr(at, name) for name in FLIGHT_SERVICES}
    wrong = {"SIM_TOKEN": "of-last-year", "DEPTH_ASSIST_TOKEN_FILE": "", "RUNS_DIR": str(tmp_path / "own")}
    url = serve(bootstrap(OrchestratorSettings.read(environment | wrong)))
    async with httpx.AsyncClient() as client:
        answer = await client.get(f"{url}/readyz")
    assert answer.status_code == 503
    checks = answer.json()["error"]["details"]["checks"]
    well = {name for name, state in checks.items() if state == "ok"}
    assert well == {"llm_parser", "vlm_gateway", "database", "records"}
    assert checks["sim"].startswith("refuses the token of SIM_TOKEN")
    assert checks["depth_assist"].startswith("asks for a token; set DEPTH_ASSIST_TOKEN or DEPTH_ASSIST_TOKEN_FILE")


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (("deliver", "--sample", SAMPLE, "--backend", "oracle", "--image-size", "200"), ("outcome", "delivered")),
        (("bench", "--subtask", "parse", "--limit", "1", "--workers", "1"), ("tasks", 1)),
    ],
)
def test_commands_read_tokens_from_files(
    command: tuple[str, ...], told: tuple[str, object], secrets: dict[str, str], tmp_path: Path
) -> None:
    line = [sys.executable, "-m", "command_line", *command, "--out", str(tmp_path / "out"), "--json"]
    done = subprocess.run(line, env=os.environ | secrets, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)[told[0]] == told[1]


@pytest.mark.parametrize("command", [("deliver", "--sample", SAMPLE), ("bench", "--limit", "1")])
def test_a_token_file_that_is_not_there_is_named(command: tuple[str, ...], tmp_path: Path) -> None:
    line = [sys.executable, "-m", "command_line", *command, "--out", str(tmp_path / "out")]
    environment = os.environ | {"GATEWAY_TOKEN_FILE": "/nowhere/token"}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "GATEWAY_TOKEN_FILE=/nowhere/token: No such file or directory; name a readable file" in done.stderr
    assert not (tmp_path / "out").exists()
