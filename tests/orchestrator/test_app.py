"""The REST door over real HTTP, with the block world behind it."""

import json
import re
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest

from contracts.events import Event, read_event
from contracts.orchestrator import Delivery, DeliveryQuestion
from mission.clients import Simulated
from mission.ports import ServiceRefused, ServiceUnreachable, UnknownModel
from mission.record import read_events
from orchestrator.access import Access
from orchestrator.delivery import Order, Run
from tests.conftest import free_port
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import BlockVision, block_ports
from tests.orchestrator.door import Door
from tests.postgres import Postgres

BEHIND = Block(thing=(2.0, 6.2, 10.5), thing_normal=(0.0, 1.0))
REQUEST = "Please come to floor 4, the window with the green flower pot"


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


@pytest.fixture
def door(runs: Path) -> Iterator[Callable[..., httpx.Client]]:
    """`door(world)` opens an orchestrator, and closes the one that was opened before."""
    opened: list[Door] = []

    def make(world: BlockWorld, **options: object) -> httpx.Client:
        if opened:
            opened.pop().close()
        opened.append(Door(runs, world, **options))
        return opened[-1].client

    yield make
    for one in opened:
        one.close()


def order(world: BlockWorld, **more: object) -> dict[str, object]:
    scene = json.loads(block_scene(world.block).model_dump_json())
    return {"request": REQUEST, "scene": scene, "settings": {"image_size": 120}} | more


def events_of(client: httpx.Client, name: str, after: int | None = None) -> list[Event]:
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    found = []
    with client.stream("GET", f"/v1/deliveries/{name}/events", headers=headers) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            if line.startswith("data: {") and line != "data: {}":
                found.append(read_event(line.removeprefix("data: ")))
    return found


def until(client: httpx.Client, name: str, status: str) -> Delivery:
    """The delivery once it is of that status, or as it stands after ten seconds."""
    give_up = time.monotonic() + 10
    while True:
        delivery = Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())
        if delivery.status == status or time.monotonic() > give_up:
            assert delivery.status == status
            return delivery
        time.sleep(0.02)


def read(client: httpx.Client, name: str) -> None:
    """Returns once the request has been read and the delivery stands in the queue for a vehicle."""
    with client.stream("GET", f"/v1/deliveries/{name}/events") as answer:
        next(line for line in answer.iter_lines() if '"kind":"parsed"' in line)
    time.sleep(1.0)


def finished(client: httpx.Client, name: str) -> Delivery:
    events_of(client, name)
    return Delivery.model_validate(client.get(f"/v1/deliveries/{name}").json())


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


@pytest.mark.parametrize("named", [{"backend": "qwen"}, {"settings": {"image_size": 120, "vision_model": "qwen"}}])
def test_a_model_that_there_is_not_is_refused_before_anything_is_flown(door, runs: Path, named: dict) -> None:
    world = BlockWorld(BEHIND)
    unknown = UnknownModel("vlm_gateway: no model 'qwen'; there are embedded")
    vision = BlockVision(world, {"preflight": [unknown]})
    refused = door(world, vision=vision).post("/v1/deliveries", json=order(world, **named))
    assert refused.status_code == 422
    assert refused.json()["error"]["code"] == "unknown_model"
    assert "there are embedded" in refused.json()["error"]["message"]
    assert not list(runs.glob("2*"))
    assert vision.asked == []


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"viewpoint": {"slices": 30}}, "contour has no setting slices; paper has it"),
        ({"viewpoint": {"policy": "contour", "choice": "centre"}}, "contour has no setting choice"),
        ({"viewpoint": {"policy": "sideways"}}, "no search policy sideways; there are paper, random, default, contour"),
        ({"choice": "centre"}, "choice is a setting of a search policy"),
    ],
)
def test_a_setting_that_would_have_no_effect_is_refused(door, runs: Path, settings: dict, said: str) -> None:
    refused = door(BlockWorld(BEHIND)).post("/v1/deliveries", json=order(BlockWorld(BEHIND), settings=settings))
    assert refused.status_code == 422
    assert said in refused.json()["error"]["message"]
    assert not list(runs.glob("2*"))


def test_a_parser_that_there_is_not_is_refused_before_anything_is_flown(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    unknown = UnknownModel("vlm_gateway: no model 'qwen'; there are embedded")
    client = door(world, vision=BlockVision(world, {"preflight": [unknown, None]}))
    for name, said in (("qwen", "there are embedded; a parser is 'reader', or a chat model"), ("eyes", "reads no")):
        refused = client.post("/v1/deliveries", json=order(world, settings={"parser_model": name}))
        assert (refused.status_code, refused.json()["error"]["code"]) == (422, "unknown_model")
        assert said in refused.json()["error"]["message"]


def test_two_names_for_the_vision_model_that_differ_are_refused(door, runs: Path) -> None:
    world = BlockWorld(BEHIND)
    named = {"backend": "oracle", "settings": {"image_size": 120, "vision_model": "embedded"}}
    refused = door(world).post("/v1/deliveries", json=order(world, **named))
    assert refused.status_code == 422
    assert "backend oracle and settings.vision_model embedded differ" in refused.json()["error"]["message"]
    assert not list(runs.glob("2*"))


def test_a_model_without_eyes_is_refused_and_a_gateway_that_is_away_is_the_missions_business(door) -> None:
    world = BlockWorld(BEHIND)
    blind = ServiceRefused("vlm_gateway: model 'words' takes no pictures", code="bad_question", status=422)
    client = door(world, vision=BlockVision(world, {"preflight": [blind]}))
    refused = client.post("/v1/deliveries", json=order(world, backend="words"))
    assert (refused.status_code, "takes no pictures" in refused.text) == (422, True)
    away = ServiceUnreachable("vlm_gateway: nobody there")
    client = door(world, vision=BlockVision(world, {"preflight": [away, away]}))
    taken = client.post("/v1/deliveries", json=order(world, backend="words"))
    assert taken.status_code == 202
    result = finished(client, taken.json()["id"]).result
    assert result is not None
    assert result.outcome == "service_unreachable"


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


def test_a_delivery_that_has_no_room_to_fly_waits_and_is_flown_when_there_is(door) -> None:
    world = BlockWorld(BEHIND, slow_s=0.1)
    client = door(world, max_live=1)
    first, second = (client.post("/v1/deliveries", json=order(world)).json()["id"] for _ in range(2))
    until(client, first, "flying")
    waiting = client.get(f"/v1/deliveries/{second}").json()
    assert (waiting["status"], waiting["started"], waiting["ended"]) == ("waiting", None, None)
    assert client.delete(f"/v1/deliveries/{first}").json()["result"]["outcome"] == "cancelled"
    flown = finished(client, second)
    assert flown.result.outcome == "delivered"
    assert flown.created <= flown.started <= flown.ended


def test_of_those_that_wait_the_one_of_the_highest_priority_is_flown_first(door) -> None:
    world = BlockWorld(BEHIND, slow_s=0.05)
    client = door(world, max_live=1)
    flying = client.post("/v1/deliveries", json=order(world)).json()["id"]
    until(client, flying, "flying")
    usual, urgent = (client.post("/v1/deliveries", json=order(world, priority=p)).json()["id"] for p in (0, 9))
    for name in (usual, urgent):
        read(client, name)
    client.delete(f"/v1/deliveries/{flying}")
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


def test_a_delivery_does_not_take_off_before_its_time(door) -> None:
    world = BlockWorld(BEHIND)
    client = door(world)
    later = datetime.now(UTC) + timedelta(seconds=3)
    name = client.post("/v1/deliveries", json=order(world, not_before=later.isoformat())).json()["id"]
    assert finished(client, name).result.outcome == "delivered"
    assert world.begun_at >= later.timestamp()


@pytest.mark.parametrize("where", ["waiting", "flying", "needs_answer"])
def test_a_delivery_ends_at_its_deadline_whatever_its_status(door, where: str) -> None:
    world = BlockWorld(BEHIND, slow_s=1.0)
    client = door(world, max_live=1)
    if where == "waiting":
        until(client, client.post("/v1/deliveries", json=order(world)).json()["id"], "flying")
    soon = (datetime.now(UTC) + timedelta(seconds=4 if where == "flying" else 2)).isoformat()
    more = {"request": VAGUE} if where == "needs_answer" else {}
    name = client.post("/v1/deliveries", json=order(world, deadline=soon, **more)).json()["id"]
    until(client, name, where)
    assert finished(client, name).result.outcome == "deadline_passed"


@pytest.mark.parametrize(("times", "said"), [((60, 30), "after not_before"), ((None, -1), "it has passed")])
def test_a_deadline_that_cannot_be_kept_is_refused(door, times: tuple, said: str) -> None:
    world = BlockWorld(BEHIND)
    now = datetime.now(UTC)
    before, deadline = (None if t is None else (now + timedelta(seconds=t)).isoformat() for t in times)
    refused = door(world).post("/v1/deliveries", json=order(world, not_before=before, deadline=deadline))
    assert refused.status_code == 422
    assert said in refused.json()["error"]["message"]


def test_no_more_deliveries_wait_than_may(door) -> None:
    world = BlockWorld(BEHIND, slow_s=0.2)
    client = door(world, max_waiting=2)
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    taken = [client.post("/v1/deliveries", json=order(world, not_before=later)) for _ in range(3)]
    assert [answer.status_code for answer in taken] == [202, 202, 429]
    assert taken[2].headers["retry-after"] == "10"


def test_a_cancelled_delivery_leaves_a_complete_record_and_no_episode(door, runs: Path) -> None:
    world = BlockWorld(BEHIND, slow_s=0.1)
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world)).json()["id"]
    give_up = time.monotonic() + 10
    while not world.live and time.monotonic() < give_up:
        time.sleep(0.01)
    cancelled = Delivery.model_validate(client.delete(f"/v1/deliveries/{name}").json())
    assert cancelled.status == "done"
    assert cancelled.result is not None
    assert cancelled.result.outcome == "cancelled"
    assert not world.live
    assert (runs / name / "result.json").is_file()
    assert events_of(client, name)[-1].kind == "result"
    again = client.delete(f"/v1/deliveries/{name}").json()
    assert again["result"]["outcome"] == "cancelled"


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


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"scene": None}, "scene"),
        ({"sample": "no-such-sample"}, "either"),
        ({"scene": None, "sample": "no-such-sample"}, "no sample"),
        ({"request": None}, "request"),
        ({"request": "   "}, "request"),
        ({"settings": {"max_exploration_steps": 0}}, "max_exploration_steps"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_delivery_that_cannot_be_flown_is_refused_with_a_reason(door, change: dict, said: str) -> None:
    world = BlockWorld()
    answer = door(world).post("/v1/deliveries", json=order(world) | change)
    assert answer.status_code == 422
    assert said in answer.json()["error"]["message"]


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


def test_an_unknown_delivery_is_a_typed_404(door) -> None:
    client = door(BlockWorld())
    for path in ("20250101-000000-abcdef", "20250101-000000-abcdef/events", "nonsense"):
        answer = client.get(f"/v1/deliveries/{path}")
        assert answer.status_code == 404
        assert answer.json()["error"]["code"] == "not_found"


def test_a_body_over_the_limit_is_refused(door) -> None:
    answer = door(BlockWorld()).post("/v1/deliveries", content=b"{" + b" " * (5 * 1024 * 1024))
    assert answer.status_code == 413


def test_a_token_guards_deliveries_and_leaves_health_open(door) -> None:
    client = door(BlockWorld(), access=Access("hush", None, lambda: "key", 60))
    assert client.get("/v1/deliveries").status_code == 401
    assert client.get("/healthz").status_code == 200
    assert client.get("/v1/deliveries", headers={"Authorization": "Bearer hush"}).status_code == 200


def test_the_viewer_asks_for_nothing_from_elsewhere(door) -> None:
    answer = door(BlockWorld()).get("/")
    assert answer.status_code == 200
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "http://" not in answer.text.replace("http://www.w3.org/2000/svg", "")
    assert "https://" not in answer.text
    for named in re.findall(r'(?:href|src)="([^"]*)"', answer.text):
        assert named.startswith(("/", "#")), named


VAGUE = "Please come to the window with the green flower pot"


def asked(client: httpx.Client, name: str) -> Delivery:
    """The delivery once it waits for an answer."""
    return until(client, name, "needs_answer")


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
    world = BlockWorld(BEHIND, slow_s=0.05)
    client = door(world)
    name = client.post("/v1/deliveries", json=order(world)).json()["id"]
    while_flying = client.post(f"/v1/deliveries/{name}/answer", json={"text": "floor 4"})
    assert (while_flying.status_code, while_flying.json()["error"]["code"]) == (409, "nothing_asked")
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
    world = BlockWorld(BEHIND, slow_s=0.1)
    client = door(world, max_live=1)
    waiting = client.post("/v1/deliveries", json=order(world, request=VAGUE)).json()["id"]
    asked(client, waiting)
    flying = client.post("/v1/deliveries", json=order(world)).json()["id"]
    until(client, flying, "flying")
    answered = client.post(f"/v1/deliveries/{waiting}/answer", json={"text": "floor 4"})
    assert (answered.status_code, answered.json()["status"]) == (200, "waiting")
    client.delete(f"/v1/deliveries/{flying}")
    assert finished(client, waiting).result.outcome == "delivered"
