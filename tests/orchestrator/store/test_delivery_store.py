"""What deliveries' tables promise, over SQLite and PostgreSQL."""

import contextlib
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from sqlalchemy import event

from orchestrator.store.database import RENEWED_AFTER_S, SQLITE_KEPT, Database
from orchestrator.store.deliveries import DeliveryStore, Following, Superseded, mark_queued
from orchestrator.store.executors import ExecutorStore
from orchestrator.store.lines import LineStore
from orchestrator.store.tables import schema_version
from orchestrator.store.vehicles import VehicleStore
from service_kit.settings import BadSetting


@pytest.fixture
def store(database: Database) -> DeliveryStore:
    return DeliveryStore(database.engine)


def row(name: str, **more: object) -> dict[str, object]:
    now = time.time()
    usual = {"question": "{}", "request": "bring it", "scene": "street", "priority": 0, "created": now, "due": now}
    return usual | {"id": name, "status": "waiting", "phase": "parse", "lane": "request"} | more


def test_a_delivery_is_added_once_under_its_id_and_its_key(store: DeliveryStore) -> None:
    assert store.add(row("a", idempotency_key="k"))
    assert not store.add(row("a"))
    assert not store.add(row("b", idempotency_key="k"))
    found = store.of_key("k")
    assert found is not None
    assert (found.id, store.get("b"), store.of_key("other")) == ("a", None, None)


def test_deliveries_added_together_are_each_added_once_under_their_ids_and_keys(store: DeliveryStore) -> None:
    store.add(row("old", idempotency_key="k"))
    together = [
        row("a", idempotency_key=None),
        row("b", idempotency_key="new"),
        row("c", idempotency_key="new"),
        row("d", idempotency_key="k"),
        row("a", idempotency_key=None, request="another"),
        row("old", idempotency_key=None),
    ]
    found = store.add_all(together)
    assert [stored and stored.id for stored in found] == ["a", "b", "b", "old", None, None]
    assert found[0] == store.get("a")
    assert found[0] is not None
    assert (found[0].request, found[0].answers, found[0].turn) == ("bring it", "[]", 1)
    assert store.known(["c", "d"]) == set()


def test_due_turns_come_by_priority_and_then_by_age_until_they_are_queued(
    store: DeliveryStore, database: Database
) -> None:
    now = time.time()
    waiting = [("old", 0, now), ("new", 0, now), ("urgent", 9, now), ("later", 9, now + 99)]
    for k, (name, priority, due) in enumerate(waiting):
        store.add(row(name, priority=priority, due=due, created=now + k))
    assert [stored.id for stored in store.due(10)] == ["urgent", "old", "new"]
    urgent, old, _ = store.due(10)
    with database.engine.begin() as transaction:
        mark_queued(transaction, [urgent, replace(old, turn=7)])
    assert [stored.id for stored in store.due(10)] == ["old", "new"], "turn 7 is another one"


def test_whoever_takes_a_delivery_up_last_carries_it_on_and_the_others_are_refused(store: DeliveryStore) -> None:
    store.add(row("a"))
    first, second = store.take_up("a", 1, "one"), store.take_up("a", 1, "two")
    assert first is not None
    assert second is not None
    with pytest.raises(Superseded):
        store.commit("a", first.version, {"phase": "explore"}, [(1, "of the first")])
    store.commit("a", second.version, {"phase": "place"}, [(1, "of the second")])
    assert store.events("a", 0) == ["of the second"]
    assert store.take_up("a", 2, "one") is None, "turn 2 has not begun"


def test_a_step_that_fails_leaves_neither_state_nor_events(store: DeliveryStore) -> None:
    store.add(row("a"))
    stored = store.take_up("a", 1, "one")
    assert stored is not None
    version = store.commit("a", stored.version, {"phase": "place"}, [(1, "x")])
    with pytest.raises(Exception, match=r"(?i)unique"):
        store.commit("a", version, {"phase": "explore"}, [(1, "x again")])
    again = store.get("a")
    assert again is not None
    assert (again.phase, again.events, store.events("a", 0)) == ("place", 1, ["x"])


@pytest.mark.parametrize("first", ["answer", "parking"])
def test_an_answer_is_due_at_once_before_the_parking_and_after_it(store: DeliveryStore, first: str) -> None:
    store.add(row("a", open_question="q", status="needs_answer"))
    stored = store.take_up("a", 1, "one")
    assert stored is not None
    later = time.time() + 600
    told = {"status": "needs_answer", "open_question": "q"}
    if first == "answer":
        assert store.answer("a", "q", ["fourth"])
        store.park("a", stored.version, told, [], Following("request", later, question=1))
    else:
        store.park("a", stored.version, told, [], Following("request", later, question=1))
        assert store.due(10) == []
        assert store.answer("a", "q", ["fourth"])
    [due] = store.due(10)
    assert (due.answers, due.executor) == ('["fourth"]', None)
    assert due.turn > 1


@pytest.mark.parametrize("first", ["end", "parking"])
def test_an_end_is_due_at_once_before_the_parking_and_after_it(store: DeliveryStore, first: str) -> None:
    store.add(row("a"))
    stored = store.take_up("a", 1, "one")
    assert stored is not None
    later = Following("fleet", time.time() + 600)
    if first == "end":
        store.end("a", "cancelled")
        assert store.to_be_ended("one") == [("a", "cancelled")]
        store.park("a", stored.version, {}, [], later)
    else:
        store.park("a", stored.version, {}, [], later)
        store.end("a", "cancelled")
    [due] = store.due(10)
    assert (due.lane, due.ending) == ("prompt", "cancelled")
    store.end("a", "deadline_passed")
    again = store.get("a")
    assert again is not None
    assert again.ending == "cancelled", "the first reason stands"


def test_a_turn_that_the_engine_lost_is_due_again_unless_it_went_on(store: DeliveryStore) -> None:
    store.add(row("a"))
    stored = store.take_up("a", 1, "dead")
    assert stored is not None
    assert [one.id for one in store.carried_by(["dead", "other"])] == ["a"]
    store.commit("a", stored.version, {})
    store.queue_again(stored)
    assert store.due(10) == []
    [now] = store.carried_by(["dead"])
    store.queue_again(now)
    [due] = store.due(10)
    assert (due.turn, due.executor) == (2, None)


def test_a_delivery_boards_a_free_vehicle_of_its_kind_the_one_with_most_room(database: Database) -> None:
    store, vehicles = DeliveryStore(database.engine), VehicleStore(database.engine)
    vehicles.register("small", "simulator", 1)
    vehicles.register("large", "simulator", 2)
    vehicles.register("hexa", "vehicle", 1)
    boarded = []
    for name in "abcd":
        store.add(row(name))
        stored = store.take_up(name, 1, "one")
        assert stored is not None
        boarded.append(vehicles.board(name, stored.version, "simulator"))
    assert boarded.count("large") == 2
    assert boarded.count("small") == 1
    assert boarded[-1] is None
    flown = store.get("a")
    assert flown is not None
    assert (flown.status, flown.vehicle, flown.flights) == ("flying", "large", 1)
    store.commit("a", flown.version, {"status": "done"})
    vehicles.mark_lost("large", "nobody there")
    free = store.get("d")
    assert free is not None
    assert vehicles.board("d", free.version, "simulator") is None, "the vehicle with room is lost"
    assert vehicles.room() == {"simulator": 1, "vehicle": 1}
    vehicles.mark_ready("large")
    assert vehicles.board("d", free.version, "simulator") == "large"
    assert {v.name: v.flying for v in vehicles.all()}["hexa"] == ()


def test_processes_are_heard_of_until_they_leave_and_one_that_retires_is_as_good_as_dead(database: Database) -> None:
    executors = ExecutorStore(database.engine)
    before = time.time()
    executors.beat("one")
    executors.beat("one")
    executors.beat("two")
    executors.retire("two")
    heard = executors.all()
    assert heard["one"] >= before
    assert heard["two"] == 0.0
    executors.leave("two")
    assert executors.all().keys() == {"one"}


def test_an_sqlite_file_is_one_orchestrator_s(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'd.sqlite'}"
    first = Database(url)
    with pytest.raises(BadSetting, match="another orchestrator uses"):
        Database(url)
    first.close()
    Database(url).close()


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("nonsense", "give postgresql://"),
        ("mysql://a@b/c", "give postgresql://"),
        ("sqlite://", "give postgresql://"),
        ("postgresql://nobody:secret@127.0.0.1:1/none", "127.0.0.1"),
        ("sqlite:////proc/none/d.sqlite", "/proc/none"),
    ],
)
def test_a_database_that_cannot_be_opened_is_said_in_one_line_without_its_password(url: str, said: str) -> None:
    with pytest.raises(BadSetting) as refused:
        Database(url)
    assert said in str(refused.value)
    assert "secret" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_database_of_a_newer_program_is_left_alone(database: Database) -> None:
    with database.engine.begin() as connection:
        connection.execute(schema_version.update().values(version=1000))
    with pytest.raises(BadSetting, match="run the newer program"):
        database._migrate()


def test_a_database_of_the_version_before_gets_what_today_has_more(database: Database) -> None:
    indexes = {index["name"] for index in sa.inspect(database.engine).get_indexes("deliveries")}
    with database.engine.begin() as connection:
        connection.execute(sa.text("DROP INDEX deliveries_ended"))
        connection.execute(schema_version.update().values(version=1))
    database._migrate()
    assert {index["name"] for index in sa.inspect(database.engine).get_indexes("deliveries")} == indexes


def test_names_are_looked_up_by_statements_of_few_lengths(tmp_path: Path) -> None:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    store = DeliveryStore(opened.engine)
    asked: set[str] = set()
    event.listen(opened.engine, "before_cursor_execute", lambda _c, _u, sql, *_: asked.add(sql))
    store.add_all([row("d07")])
    asked.clear()
    for count in range(1200):
        assert store.known([f"d{k:02d}" for k in range(count)]) == ({"d07"} if count > 7 else set())
    opened.close()
    assert len(asked) == len({2**k for k in range(10)})


def test_how_long_the_last_flights_took_is_found_without_reading_every_delivery(tmp_path: Path) -> None:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    asked: list[tuple[str, Any]] = []
    event.listen(opened.engine, "before_cursor_execute", lambda _c, _u, sql, values, *_: asked.append((sql, values)))
    LineStore(opened.engine).flight_times()
    [(sql, values)] = asked
    with opened.engine.connect() as connection:
        plan = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {sql}", values).all()
    opened.close()
    assert ["deliveries_ended" in step.detail for step in plan] == [True], plan


def test_connections_that_a_burst_opened_to_sqlite_are_closed_after_it(tmp_path: Path) -> None:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    closed: list[object] = []
    sa.event.listen(opened.engine, "close", lambda connection, _: closed.append(connection))
    with contextlib.ExitStack() as burst:
        for _ in range(30):
            burst.enter_context(opened.engine.connect()).execute(sa.text("SELECT 1"))
        assert closed == []
    assert len(closed) == 30 - SQLITE_KEPT
    opened.close()


def test_an_old_connection_to_sqlite_gives_way_to_a_new_one(tmp_path: Path) -> None:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    for engine in (opened.engine, opened.bookkeeping):
        used: list[object] = []
        records: list[Any] = []
        closed: list[object] = []
        event.listen(engine, "checkout", lambda connection, *_, used=used: used.append(connection))
        event.listen(engine, "checkout", lambda _, record, *__, records=records: records.append(record))
        event.listen(engine, "close", lambda connection, _, closed=closed: closed.append(connection))
        for age_s in (0, RENEWED_AFTER_S + 1, 0):
            with engine.connect() as connection:
                connection.execute(sa.text("SELECT 1"))
            records[-1].starttime -= age_s
        assert used[0] is used[1] is not used[2]
        assert closed == used[:1]
    opened.close()


def test_in_sqlite_deliveries_are_synced_to_the_disk_at_every_commit_and_the_engines_notes_with_them(
    tmp_path: Path,
) -> None:
    opened = Database(f"sqlite:///{tmp_path / 'deliveries.sqlite'}")
    found = []
    for engine in (opened.engine, opened.bookkeeping):
        with engine.connect() as connection:
            found.append(connection.exec_driver_sql("PRAGMA synchronous").scalar_one())
    opened.close()
    full, normal = 2, 1
    assert found == [full, normal]
