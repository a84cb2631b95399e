"""The REST door over real HTTP, with the block world behind it: deliveries followed, listed, and shown."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

from contracts.orchestrator import Delivery, DeliveryQuestion
from mission.clients import Simulated
from mission.record import read_events
from orchestrator.delivery import Order, Run
from tests.conftest import free_port
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import block_ports
from tests.orchestrator.orders import BEHIND, events_of, finished, order
from tests.postgres import Postgres


def test_a_posted_delivery_is_flown_and_can_be_followed_to_its_result(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    answer = client.post("/v1/deliveries", json=order(world))
    assert answer.status_code == 202
    name = answer.json()["id"]
    assert answer.headers["location"] == f"/v1/deliveries/{name}"
    events = events_of(client, name)
    assert [e.number for e in events] == list(range(1, len(events) + 1))
    assert events[-1].kind == "result"
    done = Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())
    assert done.status == "done"
    assert done.result is not None
    assert done.result.outcome == "delivered"


def test_the_stream_goes_on_after_the_last_event_that_was_heard_live_and_from_the_record(door, runs: Path) -> None:
    world = BlockWorld(BEHIND, slow_s=0.02)
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world)).json()["id"]
    live = events_of(client, name, after=3)
    assert live[0].number == 4
    again = events_of(client, name)
    assert [e.number for e in again] == list(range(1, len(again) + 1))
    assert events_of(client, name, after=len(again) - 1) == again[-1:]
    restarted = door(world)
    assert events_of(restarted, name) == again


def test_pictures_that_events_name_are_served_and_nothing_else_of_the_machine(door, runs: Path) -> None:
    world = BlockWorld()
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world)).json()["id"]
    pictures = [p for e in events_of(client, name) for p in e.pictures]
    assert pictures
    for picture in pictures:
        answer = client.get(f"/v1/deliveries/{name}/files/{picture}")
        assert answer.headers["content-type"] == "image/jpeg"
        assert answer.content[:2] == b"\xff\xd8"
    assert client.get(f"/v1/deliveries/{name}/files/summary.png").content[:4] == b"\x89PNG"
    (runs / "secret.txt").write_text("secret")
    for evil in ("..%2Fsecret.txt", "%2e%2e%2fsecret.txt", "delivery.json", "0001_view.jpg%00"):
        answer = client.get(f"/v1/deliveries/{name}/files/{evil}")
        assert answer.status_code == 404, evil
        assert "secret" not in answer.text
    for evil in ("logs", "20250101-000000-zzzzzz", "%2e%2e%2f"):
        assert client.get(f"/v1/deliveries/{evil}/files/secret.txt").status_code == 404


def test_deliveries_are_listed_newest_first_and_survive_a_restart(door) -> None:
    world = BlockWorld()
    client = door(world)
    names = []
    for _ in range(2):
        names.append(client.post("/v1/deliveries", json=order(world)).json()["id"])
        finished(client, names[-1])
    before = client.get("/v1/deliveries").json()["deliveries"]
    assert [delivery["id"] for delivery in before] == names[::-1]
    assert door(world).get("/v1/deliveries").json()["deliveries"] == before


async def test_records_flown_without_an_orchestrator_are_listed_broken_ones_as_failed(door, runs: Path) -> None:
    world = BlockWorld()
    question = DeliveryQuestion.model_validate(order(world))
    whole, cut = (Run(Order(question), runs) for _ in range(2))
    await whole.fly(Simulated(block_ports(world), world))
    cut.record.close()
    client = door(world)
    listed = {d["id"]: d for d in client.get("/v1/deliveries").json()["deliveries"]}
    assert listed.keys() == {whole.id, cut.id}
    outcomes = {name: delivery["result"]["outcome"] for name, delivery in listed.items()}
    assert (outcomes[whole.id], outcomes[cut.id]) == ("delivered", "failed")
    assert events_of(client, whole.id) == read_events(runs / whole.id)


def test_a_database_that_does_not_answer_is_a_503_until_it_does(door, tmp_path: Path) -> None:
    postgres = Postgres(free_port())
    try:
        client = door(BlockWorld(), database=postgres.database())
        name = client.post("/v1/deliveries", json=order(BlockWorld())).json()["id"]
        finished(client, name)
        postgres.stop()
        for answer in (client.get("/v1/deliveries"), client.post("/v1/deliveries", json=order(BlockWorld()))):
            assert (answer.status_code, answer.json()["error"]["code"]) == (503, "no_database")
        postgres.restart()
        assert client.get(f"/v1/deliveries/{name}").json()["status"] == "done"
    finally:
        postgres.close()


def test_the_list_comes_in_pages_and_by_status_and_words(door) -> None:
    client = door(BlockWorld())
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    names = [client.post("/v1/deliveries", json=order(BlockWorld(), not_before=later)).json()["id"] for _ in range(3)]
    first = client.get("/v1/deliveries", params={"limit": 2}).json()
    rest = client.get("/v1/deliveries", params={"limit": 2, "before": first["next"]}).json()
    assert {d["id"] for d in first["deliveries"] + rest["deliveries"]} == set(names)
    assert rest["next"] is None
    assert client.get("/v1/deliveries", params={"status": "done"}).json()["deliveries"] == []
    assert len(client.get("/v1/deliveries", params={"text": "FLOWER pot"}).json()["deliveries"]) == 3
    for wrong in ({"status": "lost"}, {"limit": 0}, {"since": "yesterday"}):
        assert client.get("/v1/deliveries", params=wrong).status_code == 422
    assert client.get("/v1/deliveries", params={"before": "20250101-000000-abcdef"}).status_code == 404


def test_the_viewer_asks_for_nothing_from_elsewhere(door) -> None:
    answer = door(BlockWorld()).get("/")
    assert answer.status_code == 200
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "http://" not in answer.text.replace("http://www.w3.org/2000/svg", "")
    assert "https://" not in answer.text
    for named in re.findall(r'(?:href|src)="([^"]*)"', answer.text):
        assert named.startswith(("/", "#")), named
