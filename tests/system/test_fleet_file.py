"""A fleet file with a simulator and a drone of one's own, flown and listed on the command line."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from orchestrator import sample_library
from service_kit.addresses import Addresses
from tests.system.orchestrator_process import OrchestratorProcess, heard

SAMPLE = sample_library.load("villa-teddy-bear")


@pytest.fixture
def drone(at: Addresses) -> Iterator[str]:
    """The address of a drone that stands before a building, as an autopilot's would; the scene is the test's secret."""
    question = {"scene": SAMPLE.scene.model_dump(mode="json"), "key": "own-drone", "lease_s": 600}
    begun = httpx.post(f"{at.sim}/v1/episodes", json=question, timeout=60)
    assert begun.status_code in (200, 201), begun.text
    address = f"{at.sim}/v1/episodes/{begun.json()['id']}"
    yield address
    httpx.delete(address)


@pytest.fixture
def orchestrator(at: Addresses, runs: Path, drone: str, tmp_path: Path) -> Iterator[OrchestratorProcess]:
    file = tmp_path / "fleet.toml"
    file.write_text(
        f"""
[[vehicle]]
name = "practice"
kind = "simulator"
address = "{at.sim}"
room = 2

[[vehicle]]
name = "hexa-1"
kind = "vehicle"
address = "{drone}"
"""
    )
    process = OrchestratorProcess(at, runs, {"FLEET": str(file)})
    process.start()
    yield process
    process.kill()


def listed(orchestrator: OrchestratorProcess) -> dict[str, dict[str, object]]:
    command = [sys.executable, "-m", "command_line", "vehicles", "--at", orchestrator.url, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {vehicle["name"]: vehicle for vehicle in json.loads(done.stdout)["vehicles"]}


def test_a_vehicle_of_the_fleet_file_flies_where_it_stands_and_is_listed(orchestrator: OrchestratorProcess) -> None:
    # nobody tells the oracle which of the simulator's vehicles this one is: the embedded model looks
    name = orchestrator.post(request=SAMPLE.request, settings={"max_exploration_steps": 1})
    fleet = listed(orchestrator)
    assert fleet.keys() == {"practice", "hexa-1"}
    events = heard(orchestrator, name)
    assert "placed" in [e.kind for e in events]
    delivery = orchestrator.delivery(name)
    assert delivery.result is not None
    assert delivery.result.outcome in ("stopped_not_judged", "object_not_found", "blocked")
    assert (delivery.vehicle, delivery.scene, delivery.result.verdict) == ("hexa-1", None, None)
    assert delivery.result.flight_s > 0
    assert (fleet["hexa-1"]["problem"], fleet["practice"]["room"]) == (None, 2)
    assert httpx.get(f"{orchestrator.url}/v1/vehicles").json()["vehicles"][0]["name"] == "hexa-1"


def test_an_orchestrator_that_is_not_there_is_said_in_one_line() -> None:
    command = [sys.executable, "-m", "command_line", "vehicles", "--at", "http://127.0.0.1:9"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) <= 2
    assert "orchestrator" in done.stderr
    assert "Traceback" not in done.stderr
