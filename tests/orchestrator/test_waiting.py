"""Deliveries that wait: for room, for their turn or their time, for the customer's answer."""

import sqlite3
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from contracts.orchestrator import Delivery
from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.orders import BEHIND, VAGUE, aloft, asked, events_of, finished, order, queued, until


def test_a_delivery_that_has_no_room_to_fly_waits_and_is_flown_when_there_is(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_live=1)
    first = aloft(client, world)
    second = client.post("/v1/deliveries", json=order(world)).json()["id"]
    waiting = client.get(f"/v1/deliveries/{second}").json()
    assert (waiting["status"], waiting["started"], waiting["ended"]) == ("waiting", None, None)
    assert client.delete(f"/v1/deliveries/{first}").json()["result"]["outcome"] == "cancelled"
    world.hovers = False
    flown = finished(client, second)
    assert flown.result.outcome == "delivered"
    assert flown.created <= flown.started <= flown.ended


def test_of_those_that_wait_the_one_of_the_highest_priority_is_flown_first(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_live=1)
    flying = aloft(client, world)
    usual, urgent = (client.post("/v1/deliveries", json=order(world, priority=p)).json()["id"] for p in (0, 9))
    for name in (usual, urgent):
        queued(runs, name)
    client.delete(f"/v1/deliveries/{flying}")
    world.hovers = False
    assert finished(client, urgent).ended <= finished(client, usual).started


def test_the_same_key_again_is_the_same_delivery_and_another_delivery_with_it_is_refused(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    key = {"Idempotency-Key": "order 4711"}
    names = {client.post("/v1/deliveries", json=order(world), headers=key).json()["id"] for _ in range(3)}
    assert len(names) == 1
    finished(client, *names)
    again = client.post("/v1/deliveries", json=order(world), headers=key).json()
    assert ({again["id"]}, again["status"]) == (names, "done")
    other = client.post("/v1/deliveries", json=order(world, priority=1), headers=key)
    assert (other.status_code, other.json()["error"]["code"]) == (422, "idempotency_key_reused")
    assert len(client.get("/v1/deliveries").json()["deliveries"]) == 1


def test_a_key_stays_a_delivery_s_when_an_upgrade_has_given_deliveries_another_field(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    key = {"Idempotency-Key": "order 4711"}
    name = client.post("/v1/deliveries", json=order(world), headers=key).json()["id"]
    finished(client, name)
    with sqlite3.connect(runs / "deliveries.sqlite") as database:
        database.execute("UPDATE deliveries SET question = json_remove(question, '$.priority', '$.vehicle')")
    assert client.post("/v1/deliveries", json=order(world), headers=key).json()["id"] == name
    assert client.post("/v1/deliveries", json=order(world, priority=1), headers=key).status_code == 422


def test_a_delivery_does_not_take_off_before_its_time(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    later = datetime.now(UTC) + timedelta(seconds=3)
    name = client.post("/v1/deliveries", json=order(world, not_before=later.isoformat())).json()["id"]
    assert finished(client, name).result.outcome == "delivered"
    assert world.begun_at >= later.timestamp()


@pytest.mark.parametrize("where", ["waiting", "flying", "needs_answer"])
def test_a_delivery_ends_at_its_deadline_whatever_its_status(door, runs: Path, where: str) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_live=1)
    tomorrow = (datetime.now(UTC) + timedelta(days=1)).isoformat()
    if where == "flying":
        name = aloft(client, world, deadline=tomorrow)
    else:
        aloft(client, world)
        more = {"request": VAGUE} if where == "needs_answer" else {}
        name = client.post("/v1/deliveries", json=order(world, deadline=tomorrow, **more)).json()["id"]
        until(client, name, where)
    with sqlite3.connect(runs / "deliveries.sqlite") as database:  # however long it took to come here, it is now
        database.execute("UPDATE deliveries SET deadline = ? WHERE id = ?", (time.time(), name))
    assert finished(client, name).result.outcome == "deadline_passed"


def test_a_deadline_is_kept_from_the_moment_of_the_post_on(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_live=1)
    aloft(client, world)
    soon = datetime.now(UTC) + timedelta(seconds=1)
    name = client.post("/v1/deliveries", json=order(world, deadline=soon.isoformat())).json()["id"]
    ended = finished(client, name)
    assert (ended.result.outcome, ended.started) == ("deadline_passed", None)


@pytest.mark.parametrize(("times", "said"), [((60, 30), "after not_before"), ((None, -1), "it has passed")])
def test_a_deadline_that_cannot_be_kept_is_refused(door, times: tuple, said: str) -> None:
    world = BlockWorld(BEHIND)
    now = datetime.now(UTC)
    before, deadline = (None if t is None else (now + timedelta(seconds=t)).isoformat() for t in times)
    refused = door(world).post("/v1/deliveries", json=order(world, not_before=before, deadline=deadline))
    assert refused.status_code == 422
    assert said in refused.json()["error"]["message"]


def test_no_more_deliveries_wait_than_may(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_waiting=2)
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    taken = [client.post("/v1/deliveries", json=order(world, not_before=later)) for _ in range(3)]
    assert [answer.status_code for answer in taken] == [202, 202, 429]
    assert taken[2].headers["retry-after"] == "10"


def test_a_cancelled_delivery_leaves_a_complete_record_and_no_episode(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    name = aloft(client, world)
    cancelled = Delivery.model_validate(client.delete(f"/v1/deliveries/{name}").json())
    assert cancelled.status == "done"
    assert cancelled.result is not None
    assert cancelled.result.outcome == "cancelled"
    assert not world.live
    assert (runs / name / "result.json").is_file()
    assert events_of(client, name)[-1].kind == "result"
    again = client.delete(f"/v1/deliveries/{name}").json()
    assert again["result"]["outcome"] == "cancelled"


def test_a_delivery_that_leaves_something_open_waits_and_an_answer_goes_on_with_it(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world, request=VAGUE)).json()["id"]
    waiting = asked(client, name)
    assert waiting.status == "needs_answer"
    assert waiting.question is not None
    assert waiting.question.text == "Which floor is the window on?"
    assert not world.live
    assert client.get("/v1/deliveries").json()["deliveries"][0]["status"] == "needs_answer"
    answered = client.post(f"/v1/deliveries/{name}/answer", json={"text": " floor 4 "})
    assert answered.status_code == 200
    assert answered.json()["question"] is None
    kinds = [e.kind for e in events_of(client, name)]
    assert kinds.index("question") < kinds.index("answer") < kinds.index("placed")
    done = finished(client, name)
    assert (done.result.outcome, done.question) == ("delivered", None)


def test_an_answer_that_nobody_asked_for_is_refused(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    name = aloft(client, world)
    while_flying = client.post(f"/v1/deliveries/{name}/answer", json={"text": "floor 4"})
    assert (while_flying.status_code, while_flying.json()["error"]["code"]) == (409, "nothing_asked")
    world.hovers = False
    finished(client, name)
    done = client.post(f"/v1/deliveries/{name}/answer", json={"text": "floor 4"})
    assert (done.status_code, "it is done" in done.text) == (409, True)
    nobody = client.post("/v1/deliveries/20250101-000000-0a0a0a/answer", json={"text": "floor 4"})
    assert nobody.status_code == 404


@pytest.mark.parametrize("body", [{"text": ""}, {"text": " \n "}, {"text": "x" * 1001}, {}, {"text": "4", "more": 1}])
def test_an_answer_without_words_or_with_too_many_is_refused_and_the_question_stays(door, body: dict) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world, request=VAGUE)).json()["id"]
    asked(client, name)
    assert client.post(f"/v1/deliveries/{name}/answer", json=body).status_code == 422
    assert asked(client, name).status == "needs_answer"
    assert client.delete(f"/v1/deliveries/{name}").json()["result"]["outcome"] == "cancelled"


@pytest.mark.parametrize("by", ["deployment", "delivery"])
def test_without_an_answer_in_time_a_delivery_ends_incomplete_with_its_question(door, by: str) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, patience_s=0.3) if by == "deployment" else door(world)
    more = {"answer_within_s": 0.3} if by == "delivery" else {}
    name = client.post("/v1/deliveries", json=order(world, request=VAGUE, **more)).json()["id"]
    result = finished(client, name).result
    assert result is not None
    assert result.outcome == "request_incomplete"
    assert result.message.startswith("no answer came within")
    assert "Which floor is the window on?" in result.message


def test_deliveries_that_wait_on_the_ground_keep_no_others_from_flying(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_live=1)
    waiting = [client.post("/v1/deliveries", json=order(world, request=VAGUE)).json()["id"] for _ in range(3)]
    for name in waiting:
        asked(client, name)
    flown = client.post("/v1/deliveries", json=order(world)).json()["id"]
    assert finished(client, flown).result.outcome == "delivered"
    assert [asked(client, name).status for name in waiting] == ["needs_answer"] * 3


def test_an_answered_delivery_waits_for_its_turn_where_as_many_fly_as_may(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world, max_live=1)
    waiting = client.post("/v1/deliveries", json=order(world, request=VAGUE)).json()["id"]
    asked(client, waiting)
    flying = aloft(client, world)
    answered = client.post(f"/v1/deliveries/{waiting}/answer", json={"text": "floor 4"})
    assert (answered.status_code, answered.json()["status"]) == (200, "waiting")
    client.delete(f"/v1/deliveries/{flying}")
    world.hovers = False
    assert finished(client, waiting).result.outcome == "delivered"
