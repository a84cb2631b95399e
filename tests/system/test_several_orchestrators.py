"""Several orchestrators on one PostgreSQL: each answers for all deliveries, and what one leaves the others carry on."""

import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from contracts.events import Event
from service_kit.addresses import Addresses
from tests.postgres import Postgres
from tests.system.orchestrator_process import OrchestratorProcess, heard, without_clocks

SMALL = {"backend": "oracle", "settings": {"image_size": 160}}


@pytest.fixture
def two(at: Addresses, runs: Path, postgres: Postgres) -> Iterator[list[OrchestratorProcess]]:
    settings = {"DATABASE_URL": postgres.database(), "LOST_AFTER_S": "2", "MAX_LIVE_DELIVERIES": "3"}
    processes = [OrchestratorProcess(at, runs, settings) for _ in range(2)]
    for process in processes:
        process.start()
    yield processes
    for process in processes:
        process.kill()


def fly_while_killed(two: list[OrchestratorProcess], deliveries: int, kills: int, chance: random.Random) -> None:
    undisturbed = two[0].post(sample="villa-teddy-bear", **SMALL)
    told = [(e.kind, e.message) for e in heard(two[1], undisturbed)]
    expected = without_clocks(two[1].delivery(undisturbed).result)
    names = [two[k % 2].post(sample="villa-teddy-bear", **SMALL) for k in range(deliveries)]
    listened: dict[str, list[Event]] = {}

    def listen(name: str, at: OrchestratorProcess) -> None:
        listened[name] = heard(at, name)

    # each is heard at the orchestrator that has not taken it
    listeners = [threading.Thread(target=listen, args=(n, two[(k + 1) % 2])) for k, n in enumerate(names)]
    for listener in listeners:
        listener.start()
    for _ in range(kills):
        time.sleep(chance.uniform(0.2, 2.0))
        victim = chance.choice(two)
        victim.kill()
        time.sleep(chance.choice([0.0, 4.0]))  # started again at once, or after the other has taken over
        victim.start()
    for listener in listeners:
        listener.join()
    for name in names:
        delivery = two[0].delivery(name)
        assert delivery == two[1].delivery(name)
        assert without_clocks(delivery.result) == expected
        assert delivery.flights == 1
        events = listened[name]
        assert [e.number for e in events] == list(range(1, len(events) + 1))
        assert [(e.kind, e.message) for e in events] == told


def test_a_delivery_goes_on_at_another_orchestrator_when_its_own_dies(two: list[OrchestratorProcess]) -> None:
    fly_while_killed(two, 3, 2, random.Random(0))
    [listed, other] = [{d.id for d in process.deliveries()} for process in two]
    assert listed == other
    assert len(listed) == 4


def test_a_database_that_breaks_off_every_connection_costs_no_delivery(
    two: list[OrchestratorProcess], postgres: Postgres
) -> None:
    names = [process.post(sample="villa-teddy-bear", **SMALL) for process in two]
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
def test_fifty_deliveries_and_a_hundred_kills_lose_none_and_double_none(two: list[OrchestratorProcess]) -> None:
    fly_while_killed(two, 50, 100, random.Random(1))
    assert len({d.id for d in two[0].deliveries()}) == 51
