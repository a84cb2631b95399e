"""An orchestrator killed at any moment: its deliveries go on where they were, as if nothing had happened."""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from service_kit.addresses import Addresses
from tests.system.killing import SMALL, fly_while_killed, three_hundred
from tests.system.orchestrator_process import ForkedOrchestrator, OrchestratorProcess, heard


@pytest.fixture
def orchestrator(at: Addresses, runs: Path) -> Iterator[OrchestratorProcess]:
    process = ForkedOrchestrator(at, runs, {"MAX_LIVE_DELIVERIES": "3"})
    process.start()
    yield process
    process.kill()


def test_a_killed_orchestrator_carries_its_deliveries_on_where_they_were(
    orchestrator: OrchestratorProcess, runs: Path
) -> None:
    fly_while_killed([orchestrator], runs, [SMALL] * 2, 4, random.Random(0))


def test_an_orchestrator_that_is_ended_leaves_no_traceback_and_goes_on_when_it_is_started_again(
    orchestrator: OrchestratorProcess,
) -> None:
    names = [orchestrator.post(**SMALL) for _ in range(4)]
    for moment in (2, 5, 8):
        orchestrator.events(names[0], until=moment)
        orchestrator.stop()
        log = orchestrator.log()
        assert "Traceback" not in log, log[-4000:]
        assert "after shutdown" not in log, log[-4000:]
        orchestrator.start()
    for name in names:
        assert heard(orchestrator, name)[-1].kind == "result"
        done = orchestrator.delivery(name)
        assert done.result is not None
        assert (done.result.outcome, done.flights) == ("delivered", 1)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_three_hundred_deliveries_and_a_hundred_kills_lose_none_and_double_none(
    orchestrator: OrchestratorProcess, runs: Path
) -> None:
    left = fly_while_killed([orchestrator], runs, three_hundred(), 100, random.Random(1))
    assert left > 0, "some were killed when all was over"
