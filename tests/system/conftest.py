"""All services as real processes, once for all system tests."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from launcher.processes import Processes, free_ports, oracle_settings
from mission.clients import Services
from service_kit.addresses import PORTS, Addresses
from service_kit.settings import process_environment


@pytest.fixture(scope="session")
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """Sim, depth_assist, gateway, parser and orchestrator on free ports, the oracle switched on, no answer cached."""
    folder = tmp_path_factory.mktemp("house")
    ports = free_ports(PORTS)
    extra = oracle_settings(ports)
    extra["vlm_gateway"] |= {"CACHE_MODE": "off"}
    extra["sim"] |= {"SIM_LEASE_S": "600"}  # on a loaded machine a process takes more than a minute to be there again
    extra["orchestrator"] = {"RUNS_DIR": str(folder / "runs")}
    group = Processes(ports, folder / "logs", environment=process_environment(), extra=extra)
    try:
        group.start()
        asyncio.run(group.ready())
        yield group
    finally:
        group.stop()


@pytest.fixture
def at(house: Processes) -> Addresses:
    return house.addresses


@pytest.fixture
async def services(at: Addresses) -> AsyncIterator[Services]:
    async with Services(at) as clients:
        yield clients


@pytest.fixture(scope="session")
def orchestrator_url(house: Processes) -> str:
    return next(child.url for child in house.children if child.name == "orchestrator")


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"
