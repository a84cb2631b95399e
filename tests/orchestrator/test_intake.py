"""Deliveries that come in together, over SQLite."""

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from orchestrator.intake import Intake
from orchestrator.store.database import Database
from orchestrator.store.deliveries import DeliveryStore
from tests.orchestrator.store.test_delivery_store import row


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    yield opened
    opened.close()


def post(name: str, **more: object) -> dict[str, object]:
    return row(name, idempotency_key=None) | more


async def test_what_comes_in_while_a_transaction_is_under_way_is_written_in_the_next_one(database: Database) -> None:
    commits: list[sa.Connection] = []
    sa.event.listen(database.engine, "commit", commits.append)
    intake = Intake(DeliveryStore(database.engine))
    found = await asyncio.gather(*(intake.add(post(f"d{k:03d}")) for k in range(100)))
    assert [stored and stored.id for stored in found] == [f"d{k:03d}" for k in range(100)]
    assert DeliveryStore(database.engine).waiting() == 100
    assert len(commits) <= 2


async def test_a_delivery_that_cannot_be_stored_fails_alone(database: Database) -> None:
    intake = Intake(DeliveryStore(database.engine))
    rows = [post("a"), post("b", request=object()), post("c")]
    found = await asyncio.gather(*map(intake.add, rows), return_exceptions=True)
    assert isinstance(found[1], DBAPIError)
    assert DeliveryStore(database.engine).known(["a", "b", "c"]) == {"a", "c"}


async def test_what_can_wait_lets_a_burst_pass_but_not_for_ever(database: Database) -> None:
    intake = Intake(DeliveryStore(database.engine))
    began = time.monotonic()
    await intake.let_pass(5.0)
    assert time.monotonic() - began < 1.0, "nothing came in"

    async def burst() -> None:
        for k in range(1000):
            await intake.add(post(f"d{k:03d}"))

    bursting = asyncio.create_task(burst())
    await asyncio.sleep(0)
    began = time.monotonic()
    await intake.let_pass(0.1)
    assert time.monotonic() - began >= 0.1
    assert not bursting.done()
    bursting.cancel()
