"""What is to be told, and what has to go, over SQLite and PostgreSQL."""

import time
from pathlib import Path

import pytest

from orchestrator.record_files import FolderFiles
from orchestrator.records import Records
from orchestrator.retention import Keep, Retention
from orchestrator.store.database import Database
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.store.upkeep import UpkeepStore
from tests.orchestrator.store.test_delivery_store import row

NOW = time.time()


@pytest.fixture
def upkeep(database: Database) -> UpkeepStore:
    return UpkeepStore(database.engine)


def filled(database: Database, count: int, **more: object) -> DeliveryStore:
    store = DeliveryStore(database.engine)
    for k in range(count):
        # two at a time were taken in the same moment
        told = {"created": NOW + k // 2, "request": f"window {k} with 100% blue_things"} | more
        store.add(row(f"d{k:02d}", **told), [(1, "event")])
    return store


def test_a_status_is_told_once_and_old_ones_not_any_more(database: Database, upkeep: UpkeepStore) -> None:
    store = filled(database, 2)
    store.add(row("ancient", status="done", ended=NOW - 1e6))
    store.commit("d01", 0, {"status": "flying"})
    [flying] = upkeep.untold(10)
    assert (flying.id, flying.told) == ("d01", "waiting")
    store.commit("d01", 1, {"status": "done", "ended": time.time()})
    upkeep.told([flying])
    [done] = upkeep.untold(10)
    assert (done.id, done.status, done.told) == ("d01", "done", "flying")
    upkeep.told([done])
    assert upkeep.untold(10) == []


def test_deliveries_go_when_they_are_too_old_and_the_others_stay(database: Database, tmp_path: Path) -> None:
    store = filled(database, 2)
    store.add(row("old", status="done", ended=NOW - 3 * 86_400), [(1, "event")])
    store.add(row("new", status="done", ended=NOW - 1 * 86_400))
    (tmp_path / "old" / "pictures").mkdir(parents=True)
    retention = Retention(UpkeepStore(database.engine), Records(FolderFiles(tmp_path)), Keep(days=2))
    assert retention.clear() == 1
    assert not (tmp_path / "old").exists()
    assert (store.get("old"), store.events("old", 0)) == (None, [])
    assert store.known(["d00", "d01", "new"]) == {"d00", "d01", "new"}
    assert retention.clear() == 0


def test_the_oldest_finished_go_where_records_take_too_much(database: Database, tmp_path: Path) -> None:
    store = filled(database, 4, status="done", record_bytes=100)
    store.add(row("flying", status="flying", created=NOW - 9))
    assert Retention(UpkeepStore(database.engine), Records(FolderFiles(tmp_path)), Keep(max_bytes=250)).clear() == 2
    assert store.known(["d00", "d01", "d02", "d03", "flying"]) == {"d02", "d03", "flying"}
