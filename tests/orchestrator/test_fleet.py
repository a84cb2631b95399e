"""Deliveries over a fleet: each vehicle gets its next one, and a vehicle that is lost is replaced by another."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from contracts.fleet import FleetList, FleetVehicle
from contracts.orchestrator import Delivery
from orchestrator.fleet import read_fleet
from orchestrator.hangar import Hangar
from service_kit.settings import BadSetting
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
from tests.mission.box_world import RIG
from tests.orchestrator.door import BlockSimulators, Door, OneDrone
from tests.orchestrator.orders import BEHIND, REQUEST, aloft, events_of, finished, order, patiently, until


@pytest.fixture
def open_door(tmp_path: Path) -> Iterator[Callable[..., httpx.Client]]:
    opened: list[Door] = []

    def make(hangar: Hangar, **options: object) -> httpx.Client:
        opened.append(Door(tmp_path / "runs", BlockWorld(BEHIND), hangar=hangar, **options))
        return opened[-1].client

    yield make
    for one in opened:
        one.close()


def simulators(**worlds: BlockWorld) -> BlockSimulators:
    return BlockSimulators(1, worlds)


def fleet_of(client: httpx.Client) -> dict[str, FleetVehicle]:
    vehicles = FleetList.model_validate(client.get("/v1/vehicles").json()).vehicles
    return {vehicle.name: vehicle for vehicle in vehicles}


def post(client: httpx.Client, **question: object) -> str:
    return client.post("/v1/deliveries", json=question or order(BlockWorld(BEHIND))).json()["id"]


def test_each_vehicle_gets_its_next_delivery(open_door) -> None:
    first, second = (BlockWorld(BEHIND, hovers=True) for _ in range(2))
    client = open_door(simulators(first=first, second=second))
    names = [post(client) for _ in range(3)]
    patiently(lambda: all(v.state == "flying" for v in fleet_of(client).values()), "one has no delivery")
    flying = [d for vehicle in fleet_of(client).values() for d in vehicle.deliveries]
    assert len(flying) == 2
    assert set(flying) < set(names)
    first.hovers = second.hovers = False
    flown = [finished(client, name) for name in names]
    assert {delivery.result.outcome for delivery in flown} == {"delivered"}
    assert {delivery.vehicle for delivery in flown} == {"first", "second"}
    assert {vehicle.state for vehicle in fleet_of(client).values()} == {"ready"}
    assert len(first.vehicles) + len(second.vehicles) == 3


def test_a_lost_vehicle_is_marked_and_its_delivery_flown_again_by_another(open_door) -> None:
    worlds = {"first": BlockWorld(BEHIND, hovers=True), "second": BlockWorld(BEHIND, hovers=True)}
    client = open_door(simulators(**worlds))
    name = post(client)
    flown_by = until(client, name, "flying").vehicle
    assert flown_by is not None
    other = next(one for one in worlds if one != flown_by)
    worlds[flown_by].away = True
    worlds[other].hovers = False
    done = finished(client, name)
    assert (done.result.outcome, done.vehicle, done.flights) == ("delivered", other, 2)
    lost = fleet_of(client)[flown_by]
    assert (lost.state, lost.problem) == ("lost", "block world: nobody answers")
    events = events_of(client, name)
    assert [e.number for e in events] == list(range(1, len(events) + 1))
    assert any(f"the vehicle {flown_by} was lost" in e.message for e in events)
    assert [e.kind for e in events].count("parsed") == 1, "the request is not read again"


def test_a_delivery_for_which_no_vehicle_is_left_waits_until_one_is_back(open_door) -> None:
    world = BlockWorld(BEHIND)
    client = open_door(simulators(only=world))
    name = aloft(client, world)
    world.away = True
    until(client, name, "waiting")
    assert fleet_of(client)["only"].state == "lost"
    world.away = world.hovers = False
    done = finished(client, name)
    assert (done.result.outcome, done.flights) == ("delivered", 2)


def test_a_delivery_that_lost_its_vehicle_as_often_as_may_be_ends_with_that_reason(open_door) -> None:
    world = BlockWorld(BEHIND)
    client = open_door(simulators(only=world), flights=1)
    name = aloft(client, world)
    world.away = True
    done = finished(client, name)
    assert (done.result.outcome, done.flights) == ("vehicle_lost", 1)
    assert done.result.message == "only: block world: nobody answers"


def test_a_simulator_that_forgot_the_drone_flies_the_delivery_again_from_the_start(open_door) -> None:
    world = BlockWorld(BEHIND)
    client = open_door(simulators(only=world))
    name = aloft(client, world)
    for vehicle in world.vehicles.values():
        vehicle.released = True
    world.hovers = False
    done = finished(client, name)
    assert (done.result.outcome, done.flights) == ("delivered", 2)
    assert fleet_of(client)["only"].state == "ready", "it is the drone that is gone"


def test_a_service_that_comes_back_in_time_costs_the_delivery_nothing(open_door) -> None:
    world = BlockWorld(BEHIND)
    client = open_door(simulators(only=world), service_within_s=120.0)
    name = aloft(client, world)
    world.away = True
    time.sleep(1.0)
    world.away = world.hovers = False
    done = finished(client, name)
    assert (done.result.outcome, done.flights) == ("delivered", 1)


def test_a_delivery_without_a_scene_is_flown_by_a_vehicle_that_stands_ready(open_door) -> None:
    drone = BlockVehicle(BEHIND, "e1", RIG)
    client = open_door(OneDrone(drone))
    patiently(lambda: fleet_of(client)["hexa"].vehicle is not None, "hexa has not told how it stands")
    hexa = fleet_of(client)["hexa"]
    assert hexa.capabilities is not None
    assert (hexa.state, hexa.capabilities.kind) == ("ready", "block-world")
    done: Delivery = finished(client, post(client, request=REQUEST, settings={"image_size": 120}))
    assert (done.result.outcome, done.scene, done.vehicle) == ("stopped_not_judged", None, "hexa")
    refused = client.post("/v1/deliveries", json=order(BlockWorld(BEHIND)))
    assert refused.status_code == 422
    assert "no simulator is part of the fleet" in refused.json()["error"]["message"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "vehicle: Field required"),
        ("vehicle = 3", "vehicle: "),
        ("[[vehicle]]\nname='a'\nkind='boat'\naddress='http://x'", "vehicle.0.kind: "),
        ("[[vehicle]]\nname='a'\nkind='vehicle'\naddress='x'", "vehicle.0.address: "),
        ("[[vehicle]]\nname='a'\nkind='vehicle'\naddress='http://x'\nroom=2", "a vehicle flies one delivery at a time"),
        ("[[vehicle]]\nname='a'\nkind='simulator'\naddress='http://x'\n" * 2, "a is there twice"),
        ("[[", "not TOML"),
    ],
)
def test_a_fleet_file_that_is_wrong_is_said_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(text)
    with pytest.raises(BadSetting) as refused:
        read_fleet(file)
    assert said in str(refused.value)
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_fleet_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadSetting, match="No such file"):
        read_fleet(tmp_path / "none.toml")
