"""Several orchestrators on one PostgreSQL: each answers for all deliveries, and what one leaves the others carry on."""

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from service_kit.addresses import Addresses
from tests.postgres import Postgres
from tests.system.killing import SMALL, fly_while_killed, three_hundred
from tests.system.orchestrator_process import ForkedOrchestrator, OrchestratorProcess, heard

IN_THE_AIR = 6
"""So many events have come by the time that the drone flies."""


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


def test_a_delivery_goes_on_at_another_orchestrator_when_its_own_dies(
    two: list[OrchestratorProcess], runs: Path
) -> None:
    fly_while_killed(two, runs, [SMALL] * 3, 2, random.Random(0))


def test_a_database_that_breaks_off_every_connection_costs_no_delivery(
    two: list[OrchestratorProcess], postgres: Postgres
) -> None:
    names = [process.post(**SMALL) for process in two]
    two[0].events(names[0], until=IN_THE_AIR)
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
    started: Callable[[int], list[OrchestratorProcess]], runs: Path
) -> None:
    left = fly_while_killed(started(4), runs, three_hundred(), 100, random.Random(1))
    assert left > 0, "some were killed when all was over"
