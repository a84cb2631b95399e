"""Each service killed, ended and halted in each phase of a delivery, under the supervisor of `serve`."""

import asyncio
import contextlib
import logging
import os
import signal
import threading
import time
from collections.abc import Iterator

import pytest

from contracts.events import Event
from contracts.orchestrator import DeliveryResult
from launcher.processes import Processes, free_ports, oracle_settings
from launcher.supervisor import RestartPolicy, Supervisor
from service_kit.addresses import PORTS
from service_kit.settings import process_environment
from tests.system.orchestrator_process import OrchestratorDoor, heard, without_clocks

log = logging.getLogger(__name__)
QUESTION = {"sample": "villa-teddy-bear", "backend": "oracle", "settings": {"image_size": 160}}
HALT_S = 5.0


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """All services, started again when they end, however often."""
    folder = tmp_path_factory.mktemp("kept")
    ports = free_ports(PORTS)
    extra = oracle_settings(ports)
    extra["vlm_gateway"] |= {"CACHE_MODE": "off"}
    extra["sim"] |= {"SIM_LEASE_S": "600"}  # on a loaded machine a process takes more than a minute to be there again
    extra["orchestrator"] = {"RUNS_DIR": str(folder / "runs"), "SERVICE_WITHIN_S": "120"}
    group = Processes(ports, folder / "logs", environment=process_environment(), extra=extra)
    loop = asyncio.new_event_loop()
    supervisor = Supervisor(group, lambda words: log.warning("%s", words), RestartPolicy(longest_s=0.5, times=1000))

    def keep() -> None:
        with contextlib.suppress(asyncio.CancelledError):
            loop.run_until_complete(keeping)

    try:
        group.start()
        asyncio.run(group.ready())
        keeping = loop.create_task(supervisor.run())
        thread = threading.Thread(target=keep)
        thread.start()
        yield group
        loop.call_soon_threadsafe(keeping.cancel)
        thread.join()
    finally:
        group.stop()
        loop.close()


@pytest.fixture(scope="module")
def door(kept: Processes) -> OrchestratorDoor:
    return OrchestratorDoor(next(child.url for child in kept.children if child.name == "orchestrator"))


@pytest.fixture(scope="module")
def undisturbed(door: OrchestratorDoor) -> tuple[DeliveryResult, list[Event]]:
    name = door.post(**QUESTION)
    events = heard(door, name)
    return without_clocks(door.delivery(name).result), events


def apart_from_outages(events: list[Event]) -> list[tuple[str, str]]:
    return [(event.kind, event.message) for event in events if event.kind != "outage"]


def disturb(kept: Processes, service: str, how: str) -> None:
    process = next(child.process for child in kept.children if child.name == service)
    if how == "halted":
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(HALT_S)
        os.kill(process.pid, signal.SIGCONT)
    else:
        process.send_signal({"killed": signal.SIGKILL, "ended": signal.SIGTERM}[how])


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("how", ["killed", "ended", "halted"])
@pytest.mark.parametrize("phase", ["parse", "place", "floors", "explore", "approach"])
@pytest.mark.parametrize("service", PORTS)
def test_a_delivery_ends_as_it_would_have(
    kept: Processes,
    door: OrchestratorDoor,
    undisturbed: tuple[DeliveryResult, list[Event]],
    service: str,
    phase: str,
    how: str,
) -> None:
    expected, told = undisturbed
    name = door.post(**QUESTION)
    begins = 0 if phase == "parse" else next(event.number for event in told if event.phase == phase)
    before = door.events(name, until=begins) if begins else []
    disturb(kept, service, how)
    after = before[-1].number if before else 0
    events = before + heard(door, name, after=after)
    delivery, result = door.delivery(name), without_clocks(door.delivery(name).result)
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    if service == "sim" and how != "halted" and begins:  # its drones are gone with it
        assert (result.outcome, result.path_m, delivery.flights) == ("delivered", expected.path_m, 2)
        return
    assert all(calls.calls >= expected.model_calls[role].calls for role, calls in result.model_calls.items())
    asked = {"model_calls": expected.model_calls}  # what a step had asked before it was put off is asked again
    assert result.model_copy(update=asked) == expected
    assert delivery.flights == 1
    assert apart_from_outages(events) == apart_from_outages(told)
    outages = [event for event in events if event.kind == "outage"]
    assert [event.data.over for event in outages] == [False, True] * (len(outages) // 2), outages
