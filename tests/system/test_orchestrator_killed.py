"""An orchestrator killed at any moment: its deliveries go on where they were, as if nothing had happened."""

import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from contracts.events import Event
from service_kit.addresses import Addresses
from tests.system.orchestrator_process import ForkedOrchestrator, OrchestratorProcess, heard, without_clocks

SMALL = {"image_size": 160}


@pytest.fixture
def orchestrator(at: Addresses, runs: Path) -> Iterator[OrchestratorProcess]:
    process = ForkedOrchestrator(at, runs, {"MAX_LIVE_DELIVERIES": "3"})
    process.start()
    yield process
    process.kill()


def killed_again_and_again(orchestrator: OrchestratorProcess, kills: int, chance: random.Random) -> None:
    for _ in range(kills):
        time.sleep(chance.uniform(0.05, 2.0))
        orchestrator.kill()
        orchestrator.start()


def fly_while_killed(
    orchestrator: OrchestratorProcess, runs: Path, samples: list[str], kills: int, chance: random.Random
) -> None:
    """Deliveries flown undisturbed, then the same while the orchestrator is killed."""
    question = {"backend": "oracle", "settings": SMALL}
    undisturbed = {}
    for sample in set(samples):
        name = orchestrator.post(sample=sample, **question)
        told = heard(orchestrator, name)
        undisturbed[sample] = (orchestrator.delivery(name).result, [(e.kind, e.message) for e in told])
    names = [orchestrator.post(sample=sample, **question) for sample in samples]
    listened: dict[str, list[Event]] = {}

    def listen(name: str) -> None:
        listened[name] = heard(orchestrator, name, within_s=7200.0)

    listeners = [threading.Thread(target=listen, args=(name,), daemon=True) for name in names]
    for listener in listeners:
        listener.start()
    killed_again_and_again(orchestrator, kills, chance)
    for listener in listeners:
        listener.join()
    for name, sample in zip(names, samples, strict=True):
        expected, told = undisturbed[sample]
        delivery = orchestrator.delivery(name)
        assert without_clocks(delivery.result) == without_clocks(expected)
        assert delivery.flights == 1, "the drone went on where it was"
        events = listened[name]
        assert [e.number for e in events] == list(range(1, len(events) + 1))
        assert [(e.kind, e.message) for e in events] == told
        recorded = (runs / name / "events.jsonl").read_text().splitlines()
        assert [e.model_dump_json() for e in events] == recorded


def test_a_killed_orchestrator_carries_its_deliveries_on_where_they_were(
    orchestrator: OrchestratorProcess, runs: Path
) -> None:
    fly_while_killed(orchestrator, runs, ["villa-teddy-bear", "villa-teddy-bear"], 4, random.Random(0))


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_a_hundred_kills_lose_no_delivery_and_double_none(orchestrator: OrchestratorProcess, runs: Path) -> None:
    samples = ["villa-teddy-bear", "green-flower-pot", "tower-watering-can"] * 4
    fly_while_killed(orchestrator, runs, samples, 100, random.Random(1))
