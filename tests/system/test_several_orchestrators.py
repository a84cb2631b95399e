"""Several orchestrators on one PostgreSQL: each answers for all deliveries, and what one leaves the others carry on."""

import random
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from contracts.events import Event
from contracts.orchestrator import DeliveryResult
from service_kit.addresses import Addresses
from tests.postgres import Postgres
from tests.system.orchestrator_process import ForkedOrchestrator, OrchestratorProcess, heard, without_clocks

SMALL = {"sample": "villa-teddy-bear", "backend": "oracle", "settings": {"image_size": 160}}
SHORT = SMALL | {"settings": {"image_size": 96, "max_exploration_steps": 1}}
"""Ends after one look round the building."""


@pytest.fixture
def started(at: Addresses, runs: Path, postgres: Postgres) -> Iterator[Callable[[int], list[OrchestratorProcess]]]:
    """`started(n)`: so many orchestrators on one database."""
    settings = {"DATABASE_URL": postgres.database(), "LOST_AFTER_S": "2", "MAX_LIVE_DELIVERIES": "3"}
    processes: list[OrchestratorProcess] = []

    def start(count: int) -> list[OrchestratorProcess]:
        for _ in range(count):
            processes.append(ForkedOrchestrator(at, runs, settings))
            processes[-1].start()
        return processes

    yield start
    for process in processes:
        process.kill()


@pytest.fixture
def two(started: Callable[[int], list[OrchestratorProcess]]) -> list[OrchestratorProcess]:
    return started(2)


def start_after(process: OrchestratorProcess, seconds: float) -> None:
    time.sleep(seconds)
    process.start()


def kill_again_and_again(processes: list[OrchestratorProcess], kills: int, chance: random.Random) -> None:
    """Each time one of those that answer; it is started again at once, or after the others have taken over. Returns
    when all answer."""
    starting: dict[OrchestratorProcess, Future[None]] = {}
    with ThreadPoolExecutor(len(processes)) as starters:
        for _ in range(kills):
            time.sleep(chance.uniform(0.2, 2.0))
            while len(starting) == len(processes) and not any(start.done() for start in starting.values()):
                time.sleep(0.1)
            answering = [process for process in processes if process not in starting or starting[process].done()]
            victim = chance.choice(answering)
            if victim in starting:
                starting.pop(victim).result()
            victim.kill()
            starting[victim] = starters.submit(start_after, victim, chance.choice([0.0, 4.0]))
        for start in starting.values():
            start.result()


def fly_while_killed(
    processes: list[OrchestratorProcess], questions: list[dict[str, object]], kills: int, chance: random.Random
) -> int:
    """The questions are posted to the first two processes, all of them fly, and random ones are killed; how many
    deliveries were not done after the last kill."""
    first, second = processes[:2]
    undisturbed: dict[str, tuple[DeliveryResult, list[tuple[str, str]]]] = {}
    for question in questions:
        if repr(question) not in undisturbed:
            name = first.post(**question)
            told = [(e.kind, e.message) for e in heard(second, name)]
            undisturbed[repr(question)] = without_clocks(second.delivery(name).result), told
    before = {delivery.id for delivery in first.deliveries()}
    names = [processes[k % 2].post(**question) for k, question in enumerate(questions)]
    listened: dict[str, list[Event]] = {}

    def listen(name: str, at: OrchestratorProcess) -> None:
        listened[name] = heard(at, name, within_s=7200.0)

    # each is heard at the orchestrator that has not taken it
    listeners = [
        threading.Thread(target=listen, args=(n, processes[(k + 1) % 2]), daemon=True) for k, n in enumerate(names)
    ]
    for listener in listeners:
        listener.start()
    kill_again_and_again(processes, kills, chance)
    left = sum(listener.is_alive() for listener in listeners)
    for listener in listeners:
        listener.join()
    for name, question in zip(names, questions, strict=True):
        delivery = first.delivery(name)
        assert delivery == second.delivery(name)
        expected, told = undisturbed[repr(question)]
        assert without_clocks(delivery.result) == expected
        assert delivery.flights == 1
        events = listened[name]
        assert [e.number for e in events] == list(range(1, len(events) + 1))
        assert [(e.kind, e.message) for e in events] == told
    for process in processes:
        assert {delivery.id for delivery in process.deliveries()} == before | set(names)
    return left


def test_a_delivery_goes_on_at_another_orchestrator_when_its_own_dies(two: list[OrchestratorProcess]) -> None:
    fly_while_killed(two, [SMALL] * 3, 2, random.Random(0))


def test_a_database_that_breaks_off_every_connection_costs_no_delivery(
    two: list[OrchestratorProcess], postgres: Postgres
) -> None:
    names = [process.post(**SMALL) for process in two]
    while two[0].delivery(names[0]).status != "flying":
        time.sleep(0.05)
    postgres.restart()
    for name, other in zip(names, two[::-1], strict=True):
        events = heard(other, name)
        assert [e.number for e in events] == list(range(1, len(events) + 1))
        delivery = other.delivery(name)
        assert delivery.result is not None
        assert (delivery.result.outcome, delivery.flights) == ("delivered", 1)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_three_hundred_deliveries_and_a_hundred_kills_of_four_processes_lose_none_and_double_none(
    started: Callable[[int], list[OrchestratorProcess]],
) -> None:
    questions = [SMALL if k % 10 == 0 else SHORT for k in range(300)]
    assert fly_while_killed(started(4), questions, 100, random.Random(1)) > 0, "some were killed when all was over"
