"""Where drones are, as their vehicles tell it: one question for all who look, and nothing kept of what is over."""

import gc
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import zstandard

from contracts.overview import DroneSeen, StreetPlan
from orchestrator import telemetry
from orchestrator.store.database import Database
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.streets import Streets
from orchestrator.telemetry import Telemetry
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
from tests.mission.box_world import RIG
from tests.orchestrator.door import BlockSimulators
from tests.orchestrator.orders import BEHIND, order
from tests.orchestrator.store.test_delivery_store import row

NAMES = [f"d{k:02d}" for k in range(20)]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[DeliveryStore]:
    """Twenty deliveries, each flown by a drone of its own."""
    database = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    store = DeliveryStore(database.engine)
    for name in NAMES:
        state = zstandard.compress(json.dumps({"vehicle": f"drone-{name}"}).encode())
        flying = {"status": "flying", "vehicle": "simulator", "flights": 1, "state": state}
        store.add(row(name, question=json.dumps(order(BlockWorld(BEHIND))), **flying))
    yield store
    database.close()


@pytest.fixture
def drones(store: DeliveryStore) -> Telemetry:
    names = [f"drone-{name}" for name in NAMES]
    world = BlockWorld(BEHIND, vehicles={name: BlockVehicle(BEHIND, name, RIG) for name in names})
    return Telemetry(BlockSimulators(20, {"simulator": world}), store)


def alive(kind: type) -> int:
    gc.collect()
    return sum(isinstance(thing, kind) for thing in gc.get_objects())


async def test_whoever_looks_at_the_same_moment_is_told_the_same(
    drones: Telemetry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(telemetry, "FRESH_S", 60.0)
    first = await drones.of("d00")
    assert first is not None
    assert first.state.id == "drone-d00"
    assert await drones.of("d00") is first
    assert await drones.of("d99") is None


async def test_what_drones_told_that_nobody_looks_at_any_more_is_not_kept(
    drones: Telemetry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(telemetry, "FRESH_S", 0.0)
    before = alive(DroneSeen)
    for name in NAMES:
        assert await drones.of(name) is not None
    assert alive(DroneSeen) <= before + 1


async def test_of_streets_that_were_looked_at_only_the_keys_are_kept(store: DeliveryStore) -> None:
    streets = Streets(store)
    before = alive(StreetPlan)
    plans = [await streets.of(name) for name in NAMES]
    assert [plan and plan.key for plan in plans] == [await streets.key_of(name) for name in NAMES]
    del plans
    assert alive(StreetPlan) <= before + 1
