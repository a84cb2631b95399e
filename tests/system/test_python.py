"""The Python surface on real services: an orchestrator asked by both clients, and flights out of this process."""

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from contracts.events import FloorCountEvent, LookEvent
from logisticsvln import (
    AsyncClient,
    BadDelivery,
    BadScene,
    CameraPicture,
    Client,
    LocalServices,
    Look,
    Match,
    MissionSettings,
    NextStop,
    NothingLeft,
    OpenQuestion,
    OwnVision,
    Refused,
    SearchTools,
)
from service_kit.addresses import Addresses

SAMPLE = "green-flower-pot"
SMALL = MissionSettings(image_size=320)
SHORT = MissionSettings(image_size=160, max_exploration_steps=2)


@pytest.fixture
def client(orchestrator_url: str) -> Iterator[Client]:
    with Client(orchestrator_url) as opened:
        yield opened


@pytest.fixture
def local(at: Addresses) -> Iterator[LocalServices]:
    with LocalServices(at=at) as services:
        yield services


def test_a_delivery_is_ordered_followed_and_waited_for(client: Client) -> None:
    ordered = client.deliver(sample=SAMPLE, backend="oracle", settings=SMALL)
    events = list(client.events(ordered.id))
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert events[-1].kind == "result"
    result = client.wait(ordered.id, timeout_s=30)
    assert result.outcome == "delivered", result.message
    assert client.delivery(ordered.id).result == result
    assert client.file(ordered.id, "summary.png").startswith(b"\x89PNG")
    picture = next(event.pictures[0] for event in events if event.pictures)
    assert client.file(ordered.id, picture).startswith(b"\xff\xd8")
    assert list(client.events(ordered.id, after=events[-3].number)) == events[-2:]


def test_the_fleet_the_samples_and_every_page_of_deliveries_are_told(client: Client) -> None:
    assert client.ready().service == "orchestrator"
    assert SAMPLE in client.samples()
    assert [vehicle.kind for vehicle in client.vehicles()] == ["simulator"]
    made = [client.cancel(client.deliver("floor 3, the red kite", sample=SAMPLE).id).id for _ in range(3)]
    found = [delivery.id for delivery in client.deliveries(text="red kite", page=2)]
    assert found == made[::-1]


def test_an_open_question_is_answered_by_a_function(client: Client) -> None:
    asked: list[OpenQuestion] = []

    def answering(question: OpenQuestion) -> str | None:
        asked.append(question)
        return "the fourth floor" if len(asked) == 1 else None

    ordered = client.deliver("the window with the green flower pot", sample=SAMPLE, backend="oracle", settings=SHORT)
    result = client.wait(ordered.id, answering=answering, timeout_s=60)
    assert len(asked) == 1
    assert result.floor == 4


def test_a_refusal_carries_status_code_and_what_would_be_right(client: Client) -> None:
    with pytest.raises(Refused, match="there is no sample 'nowhere'; there are: green-flower-pot") as refused:
        client.deliver(sample="nowhere")
    assert refused.value.status == 422
    with pytest.raises(Refused) as missing:
        client.delivery("20200101-000000-000000")
    assert missing.value.status == 404


def test_a_task_is_flown_through_the_orchestrator_and_judged_as_bench_does(client: Client) -> None:
    heard = []
    flown = client.bench("vld-300", backend="oracle", limit=1, settings=SMALL, on_record=heard.append)
    assert flown.summary.tasks == flown.summary.planned == 1
    assert flown.summary.success.k == 1
    assert [record.task for record in flown.records] == ["vld-300-001"]
    assert heard == list(flown.records)


async def test_the_asynchronous_client_orders_cancels_and_tells_the_same(orchestrator_url: str) -> None:
    async with AsyncClient(orchestrator_url) as client:
        ordered = await client.deliver(sample=SAMPLE, backend="oracle", settings=SMALL)
        await client.cancel(ordered.id)
        result = await client.wait(ordered.id)
        assert result.outcome == "cancelled"
        assert [event.kind async for event in client.events(ordered.id)][-1] == "result"
        assert ordered.id in [delivery.id async for delivery in client.deliveries(page=5)]


def test_a_function_searches_and_is_recorded_by_its_name(local: LocalServices, runs: Path) -> None:
    looks: list[Look] = []

    async def turn_left(look: Look, tools: SearchTools) -> NextStop | NothingLeft:
        looks.append(look)
        return NextStop((), look.pose.yaw + 0.5, "turn") if len(looks) < 3 else NothingLeft("enough")

    settings = SMALL.model_copy(update={"max_exploration_steps": 9})
    flown = local.fly(sample=SAMPLE, policy=turn_left, vision="oracle", settings=settings, out=runs)
    assert (flown.result.outcome, flown.result.search_policy) == ("object_not_found", "turn-left")
    assert "enough" in flown.result.message
    assert len(looks) == 3
    assert flown.folder.parent == runs
    assert flown.summary.exists()


def test_a_function_sees_and_the_gateway_answers_the_rest(local: LocalServices, runs: Path) -> None:
    phrases: list[str] = []

    def blind(views: Sequence[CameraPicture], phrase: str) -> list[Match]:
        phrases.append(phrase)
        assert {view.rgb.shape for view in views} == {(160, 160, 3)}
        return []

    own = OwnVision(blind, rest="oracle")
    flown = local.fly(sample=SAMPLE, vision=own, settings=SHORT, out=runs)
    assert flown.result.outcome == "object_not_found"
    assert set(phrases) == {"green flower pot"}
    answers = [e.data.answer for e in flown.events if isinstance(e, FloorCountEvent | LookEvent)]
    backends = {answer.backend for answer in answers if answer is not None}
    assert backends == {"python", "oracle"}


def test_what_a_model_of_ones_own_raises_reaches_its_author(local: LocalServices, runs: Path) -> None:
    def broken(views: Sequence[CameraPicture], phrase: str) -> list[Match]:
        raise KeyError("weights")

    with pytest.raises(KeyError, match="weights") as raised:
        local.fly(sample=SAMPLE, vision=OwnVision(broken, rest="oracle"), settings=SHORT, out=runs)
    assert "the record of the flight is in" in raised.value.__notes__[0]
    silent = [one for one in logging.getLogger("mission").handlers if isinstance(one, logging.NullHandler)]
    assert len(silent) == 1, "it would be printed by the log as well"


@pytest.mark.parametrize(
    ("asked", "problem"),
    [
        ({"vision": "nobody"}, "nobody"),
        ({"vision": object()}, "object has none of them"),
        ({"policy": "nowhere"}, "there is no search policy nowhere"),
        ({"policy": int}, "int is not derived from SearchPolicy"),
        ({"scene": "somewhere.json"}, "either a scene or the name of a sample|No such file"),
        ({"answers": "fourth floor"}, "a list of texts"),
    ],
)
def test_what_cannot_be_flown_is_refused_with_what_would_be_right(
    local: LocalServices, runs: Path, asked: dict[str, object], problem: str
) -> None:
    with pytest.raises((BadDelivery, BadScene), match=problem):
        local.fly(**({"sample": SAMPLE, "settings": SHORT, "out": runs} | asked))
    assert not runs.exists()


def test_the_oracle_is_refused_where_no_truth_was_switched_on(runs: Path) -> None:
    services = LocalServices()
    with pytest.raises(RuntimeError, match="inside `with` only"):
        services.fly(sample=SAMPLE, out=runs)
