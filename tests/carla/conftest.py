"""CARLA's real client and the service that uses it, in a double of CARLA's server whose only map is a yard."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from services.carla_world.app import build_app
from services.carla_world.client import CarlaClient, Server
from services.carla_world.episodes import CarlaEpisodes
from services.carla_world.scene_documents import SceneDocuments
from tests.carla.doubles import DoubleProcess
from tests.carla_double.running import HOST
from tests.conftest import Serve

TIMEOUT_S = 20.0
LEASE_S = 60.0
YARD = 'map = "yard"\nroof_m = 15.0\nunderground_m = -1.0\n'

Launch = Callable[..., httpx.Client]
"""A service before the double at that port; more goes to its client, its documents and its leases."""


@pytest.fixture(scope="module")
def double(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DoubleProcess]:
    with DoubleProcess(tmp_path_factory.mktemp("double") / "log", "--yard") as running:
        yield running


@pytest.fixture(scope="module")
def launch(serve: Serve, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launch]:
    opened: list[httpx.Client] = []

    def go(
        port: int, *, timeout_s: float = TIMEOUT_S, settle: int = 0, document: str = YARD, **more: Any
    ) -> httpx.Client:
        scenes = tmp_path_factory.mktemp("scenes")
        (scenes / "yard.toml").write_text(document)
        client = CarlaClient(Server(HOST, port, timeout_s, 60.0, 0.05), settle_ticks=0)
        episodes = CarlaEpisodes(client, SceneDocuments(Path(scenes)), LEASE_S, 3600.0, **more)
        opened.append(httpx.Client(base_url=serve(build_app(episodes, f"{HOST}:{port}")), timeout=120.0))
        return opened[-1]

    yield go
    for http in opened:
        http.close()


@pytest.fixture(scope="module")
def http(double: DoubleProcess, launch: Launch) -> httpx.Client:
    return launch(double.port)
