"""What the pages ask: the overview, drones, streets, what a customer is shown, and the order form; over real HTTP."""

from collections.abc import Iterator
from itertools import pairwise

import httpx
import pytest

from contracts.overview import DroneSeen, OrderOptions, Overview, Reading, StreetPlan, Tracking
from tests.mission.block_vehicle import BlockWorld
from tests.orchestrator.door import BlockSimulators, Door
from tests.orchestrator.orders import BEHIND, REQUEST, aloft, finished, order, patiently, until


@pytest.fixture(scope="module")
def world() -> BlockWorld:
    return BlockWorld(BEHIND)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory, world: BlockWorld) -> Iterator[httpx.Client]:
    """Two simulators with one room each."""
    fleet = BlockSimulators(1, {"first": world, "second": BlockWorld(BEHIND)})
    door = Door(tmp_path_factory.mktemp("runs"), world, hangar=fleet)
    yield door.client
    door.close()


def post(client: httpx.Client, **more: object) -> str:
    answer = client.post("/v1/deliveries", json=order(BlockWorld(BEHIND), **more))
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def overview(client: httpx.Client, **wanted: object) -> Overview:
    return Overview.model_validate(client.get("/v1/overview", params=wanted).json())


def error(answer: httpx.Response) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def test_the_overview_tells_deliveries_by_state_outcome_and_words(client: httpx.Client) -> None:
    name = post(client)
    finished(client, name)
    asking = post(client, request="floor 4 with a question of its own")
    until(client, asking, "needs_answer")
    everything = overview(client)
    assert everything.counts["needs_answer"] == 1
    delivered = overview(client, outcome="delivered")
    assert [line.id for line in delivered.deliveries] == [name]
    assert [line.id for line in delivered.asking] == [asking], "a filter hides nobody who waits for an answer"
    assert overview(client, outcome="collision").deliveries == ()
    (line,) = overview(client, text="QUESTION of its").deliveries
    assert (line.id, line.question) == (asking, "What can be seen at your window from outside?")
    assert [line.id for line in overview(client, text=name).deliveries] == [name]
    (newest,) = overview(client, limit=1).deliveries
    assert newest.id == asking
    assert overview(client, limit=1, before=newest.id).deliveries[0].id == name
    assert error(client.get("/v1/overview", params={"before": "20200101-000000-abcdef"})) == (404, "not_found")
    client.delete(f"/v1/deliveries/{asking}")


def test_a_drone_in_the_air_is_told_until_it_is_given_back(client: httpx.Client, world: BlockWorld) -> None:
    name = aloft(client, world, vehicle="first")
    drone = f"/v1/deliveries/{name}/drone"
    patiently(lambda: client.get(drone).status_code != 404, "the drone is not told")
    seen = DroneSeen.model_validate(client.get(drone).json())
    assert seen.state.battery.remaining is not None
    (flight,) = [f for f in overview(client).flights if f.delivery == name]
    street = StreetPlan.model_validate(client.get(f"/v1/deliveries/{name}/street").json())
    assert (flight.street, flight.request) == (street.key, REQUEST)
    assert [building.target for building in street.buildings] == [True]
    told = []
    with client.stream("GET", f"/v1/deliveries/{name}/events", params={"drone": True}) as stream:
        kind = ""
        for line in stream.iter_lines():
            kind = line.removeprefix("event: ") if line.startswith("event: ") else kind
            if line.startswith("data: ") and kind == "drone":
                told.append(DroneSeen.model_validate_json(line.removeprefix("data: ")))
                world.hovers = len(told) < 2
    assert len(told) > 1
    assert all(a.time <= b.time for a, b in pairwise(told))
    assert error(client.get(drone)) == (404, "not_found")


def test_a_drone_that_does_not_tell_is_said_to_be_silent(client: httpx.Client, world: BlockWorld) -> None:
    name = aloft(client, world, vehicle="first")
    drone = f"/v1/deliveries/{name}/drone"
    patiently(lambda: client.get(drone).status_code == 200, "the drone is not told")
    world.silent = True
    patiently(lambda: client.get(drone).status_code != 200, "what was told last stands")
    answer = client.get(drone)
    shown = Tracking.model_validate(client.get(f"/v1/deliveries/{name}/tracking").json())
    world.silent = world.hovers = False
    assert error(answer) == (503, "drone_silent")
    assert "nobody answers" in answer.json()["error"]["message"]
    assert (shown.drone, shown.silent) == (None, True)
    finished(client, name)


def test_a_customer_is_told_how_many_are_before_them_and_how_long_a_flight_takes(client: httpx.Client) -> None:
    for _ in range(3):
        name = post(client)
        finished(client, name)
    shown = Tracking.model_validate(client.get(f"/v1/deliveries/{name}/tracking").json())
    assert shown.outlook.flight is not None
    assert 0.0 <= shown.outlook.flight.least_s <= shown.outlook.flight.most_s
    assert (shown.request, shown.picture, shown.drone, shown.question) == (REQUEST, True, None, None)
    later = {"not_before": "2099-01-01T00:00:00Z"}
    first, second = post(client, **later), post(client, **later)
    ahead = [client.get(f"/v1/deliveries/{n}/tracking").json()["outlook"]["ahead"] for n in (first, second)]
    assert ahead == [0, 1]
    urgent = post(client, priority=5, **later)
    assert client.get(f"/v1/deliveries/{first}/tracking").json()["outlook"]["ahead"] == 1
    for waiting in (first, second, urgent):
        client.delete(f"/v1/deliveries/{waiting}")


def test_the_form_tells_what_there_is_to_choose(client: httpx.Client) -> None:
    options = OrderOptions.model_validate(client.get("/v1/order-options").json())
    assert "green-flower-pot" in {sample.name for sample in options.samples}
    assert [(model.name, model.usual) for model in options.models or ()] == [("geometry", True)]
    assert [search.name for search in options.searches if search.usual] == ["contour"]
    assert {vehicle.name for vehicle in options.vehicles} == {"first", "second"}
    assert (options.scenes, options.own_place) == (True, False)


def test_a_request_is_read_before_anything_is_ordered(client: httpx.Client) -> None:
    before = sum(overview(client).counts.values())
    read = Reading.model_validate(client.post("/v1/readings", json={"request": "floor 4"}).json())
    assert (read.answer.floor, read.answer.object) == (4, None)
    assert read.question == "What can be seen at your window from outside?"
    said = [{"question": read.question, "answer": "the green flower pot"}]
    again = Reading.model_validate(client.post("/v1/readings", json={"request": "floor 4", "exchanges": said}).json())
    assert (again.answer.object, again.question, again.known) == ("green flower pot", None, True)
    assert sum(overview(client).counts.values()) == before


def test_answers_given_with_the_order_are_not_waited_for(client: httpx.Client) -> None:
    done = finished(client, post(client, request="floor 4", answers=["the green flower pot"]))
    assert done.result is not None
    assert done.result.outcome == "delivered"


def test_only_the_vehicle_that_is_named_flies_a_delivery(client: httpx.Client) -> None:
    assert {finished(client, post(client, vehicle="second")).vehicle for _ in range(2)} == {"second"}
    refused = client.post("/v1/deliveries", json=order(BlockWorld(BEHIND), vehicle="third"))
    assert error(refused) == (422, "unknown_vehicle")
    assert "first, second" in refused.json()["error"]["message"]


def test_pages_come_with_a_strict_policy_and_assets_with_a_tag(client: httpx.Client) -> None:
    page = client.get("/")
    assert "script-src 'self'" in page.headers["content-security-policy"]
    assert "unsafe" not in page.headers["content-security-policy"]
    script = client.get("/pages/app.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert client.get("/pages/app.js", headers={"If-None-Match": script.headers["etag"]}).status_code == 304
    for path in ("nothing.js", "..%2Fapp.py", "viewer.html"):
        assert client.get(f"/pages/{path}").status_code == 404
