"""A model's server that is away while a drone flies, and comes back or does not: real services, real sockets."""

import asyncio
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from contracts.events import Event
from launcher.processes import Processes, free_ports
from service_kit.addresses import Addresses
from service_kit.settings import process_environment
from tests.conftest import free_port
from tests.services.vlm_gateway.openai_mock import OpenAiMock, says
from tests.system.orchestrator_process import ForkedOrchestrator, OrchestratorProcess, heard

CONFIG = """
[models.chooser]
backend = "chat"
base_url = "http://127.0.0.1:{port}/v1"
model = "chooser"
preset = "qwen2.5-vl"
[roles]
floors = "oracle"
recognition = "oracle"
choice = "chooser"
"""
PAPER = {"viewpoint": {"policy": "paper"}, "image_size": 160, "max_exploration_steps": 3}
QUESTION = {"sample": "t-house-umbrella", "settings": PAPER}
"""Its window is round a corner: the chooser is asked which way to fly."""
LONG = "600"
IN_THE_AIR = 6
"""So many events have come by the time that the drone flies."""


class ModelServer:
    """Chooses the way ahead, while it is there."""

    def __init__(self) -> None:
        self.port = free_port()
        self._mock: OpenAiMock | None = None

    @property
    def asked(self) -> int:
        return 0 if self._mock is None else len(self._mock.asked)

    def comes(self) -> None:
        assert self._mock is None
        self._mock = OpenAiMock(self.port)
        self._mock.will(says('{"label": "c"}'))
        self._mock.start()

    def goes(self) -> None:
        if self._mock is not None:
            self._mock.stop()
            self._mock = None


@pytest.fixture
def server() -> Iterator[ModelServer]:
    there = ModelServer()
    yield there
    there.goes()


@pytest.fixture
def gateway(at: Addresses, server: ModelServer, tmp_path: Path) -> Iterator[Processes]:
    """A gateway of its own before that server."""
    config = tmp_path / "gateway.toml"
    config.write_text(CONFIG.format(port=server.port))
    extra = {"vlm_gateway": {"GATEWAY_CONFIG": str(config), "ORACLE_SIM_URL": at.sim, "CACHE_MODE": "off"}}
    group = Processes(free_ports(["vlm_gateway"]), tmp_path / "logs", environment=process_environment(), extra=extra)
    server.comes()
    try:
        group.start()
        asyncio.run(group.ready())
        server.goes()
        yield group
    finally:
        group.stop()


@pytest.fixture
def started(at: Addresses, gateway: Processes, runs: Path) -> Iterator[Callable[[str], OrchestratorProcess]]:
    """`started(within_s)`: an orchestrator that waits for so long."""
    running: list[OrchestratorProcess] = []

    def start(within_s: str) -> OrchestratorProcess:
        through = Addresses(at.llm_parser, gateway.children[0].url, at.depth_assist, at.sim)
        running.append(ForkedOrchestrator(through, runs, {"SERVICE_WITHIN_S": within_s}))
        running[-1].start()
        return running[-1]

    yield start
    for process in running:
        process.kill()


def until_waiting(orchestrator: OrchestratorProcess, name: str) -> list[Event]:
    """The events up to the one that says that something is waited for."""
    events: list[Event] = []
    while not (events and events[-1].kind == "outage"):
        events += orchestrator.events(name, after=len(events), until=len(events) + 1)
        assert events[-1].kind != "result", events[-1]
    return events


def test_a_model_server_that_comes_back_delays_a_delivery_and_changes_nothing(
    started: Callable[[str], OrchestratorProcess], server: ModelServer
) -> None:
    orchestrator = started(LONG)
    server.comes()
    undisturbed = orchestrator.post(**QUESTION)
    told = heard(orchestrator, undisturbed)
    assert server.asked > 0
    server.goes()
    name = orchestrator.post(**QUESTION)
    before = until_waiting(orchestrator, name)
    assert "chooser" in before[-1].message
    orchestrator.kill()  # who waits may die, too
    server.comes()
    orchestrator.start()
    events = before + heard(orchestrator, name, after=len(before))
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert [event.data.over for event in events if event.kind == "outage"] == [False, True]
    same = [(event.kind, event.message) for event in events if event.kind != "outage"]
    assert same == [(event.kind, event.message) for event in told]
    flown, expected = orchestrator.delivery(name), orchestrator.delivery(undisturbed)
    assert flown.result is not None
    assert expected.result is not None
    assert (flown.flights, flown.result.path_m) == (1, expected.result.path_m)


def test_a_model_server_that_stays_away_ends_the_delivery_by_name(
    started: Callable[[str], OrchestratorProcess], server: ModelServer
) -> None:
    orchestrator = started("1")
    name = orchestrator.post(**QUESTION)
    events = heard(orchestrator, name)
    result = orchestrator.delivery(name).result
    assert result is not None
    assert result.outcome == "model_unreachable"
    assert "chooser" in result.message
    assert "; waited " in result.message
    assert [event.data.over for event in events if event.kind == "outage"] == [False]


def test_a_delivery_that_waits_is_cancelled_and_its_drone_given_back(
    started: Callable[[str], OrchestratorProcess], server: ModelServer
) -> None:
    orchestrator = started(LONG)
    name = orchestrator.post(**QUESTION)
    until_waiting(orchestrator, name)
    assert orchestrator.delivery(name).status == "flying"
    orchestrator.cancel(name)
    result = orchestrator.delivery(name).result
    assert result is not None
    assert result.outcome == "cancelled"


def test_a_gateway_that_is_killed_is_waited_for_as_well(
    started: Callable[[str], OrchestratorProcess], gateway: Processes, server: ModelServer
) -> None:
    orchestrator = started(LONG)
    server.comes()
    name = orchestrator.post(**QUESTION)
    orchestrator.events(name, until=IN_THE_AIR)
    child = gateway.children[0]
    os.kill(child.process.pid, signal.SIGKILL)
    child.process.wait()
    until_waiting(orchestrator, name)
    gateway.start_again(child)
    events = heard(orchestrator, name)
    assert [event.data.over for event in events if event.kind == "outage"] == [False, True]
    assert events[-1].kind == "result"
    assert "unreachable" not in events[-1].message
