"""Services and models that are away for a while: missions wait with the drone holding, and then go on, or end."""

import asyncio
from collections.abc import Callable

import pytest

from contracts.events import Event
from contracts.orchestrator import DeliveryResult, MissionSettings
from contracts.vehicle import Health, VehicleState
from contracts.vlm_gateway import ChooseDirectionQuestion
from mission.mission import Mission
from mission.outages import Patience
from mission.ports import (
    ModelRejected,
    ModelUnreachable,
    PortError,
    ServiceRefused,
    ServiceUnreachable,
    ServiceUnusable,
    UnknownModel,
)
from mission.stages import Ended
from mission.state import MissionState, Outage, begin
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
from tests.mission.box_world import BlockVision, block_placement, block_ports
from tests.mission.test_carried_on import without_clocks
from tests.mission.test_mission import BEHIND, PAPER, REQUEST, Events

AWAY = ModelUnreachable("vlm_gateway: nobody answers for model 'm' (model_unreachable)")
LONG = Patience(600.0)
Said = dict[str, list[PortError | None]]


class Heard(Events):
    """A log that calls `then` once, when the first event of that kind is told."""

    def __init__(self, kind: str, then: Callable[[], object]) -> None:
        self._kind, self._then = kind, then

    def write(self, number, phase, message, data, pictures=None):
        super().write(number, phase, message, data, pictures)
        if self[-1].kind == self._kind and len(self.of(self._kind)) == 1:
            self._then()


def mission_in(world: BlockWorld, says: Said, log: Events, patience: Patience = LONG) -> Mission:
    ports, settings = block_ports(world, BlockVision(world, dict(says))), MissionSettings(viewpoint=PAPER)
    return Mission(ports, block_placement(world), settings, log, patience=patience)


def apart_from_outages(events: list[Event]) -> list[tuple[str, str]]:
    return [(event.kind, event.message) for event in events if event.kind != "outage"]


def as_if_undisturbed(result: DeliveryResult) -> DeliveryResult:
    calls = {role: c.model_copy(update={"calls": 0, "unreachable": 0}) for role, c in result.model_calls.items()}
    return without_clocks(result.model_copy(update={"model_calls": calls}))


@pytest.mark.parametrize(
    ("asked", "errors", "unreachable"),
    [
        ("preflight", [AWAY], 0),
        ("floor_count", [AWAY, AWAY], 2),
        ("find_object", [None, ServiceUnreachable("vlm_gateway: can't reach it")], 0),
        ("choose_direction", [AWAY], 1),
    ],
)
async def test_what_comes_back_costs_a_delivery_nothing_but_time(
    asked: str, errors: list[PortError | None], unreachable: int
) -> None:
    undisturbed, told = BlockWorld(BEHIND), Events()
    expected = await mission_in(undisturbed, {}, told).fly(REQUEST)
    assert expected.outcome == "delivered"
    world, log = BlockWorld(BEHIND), Events()
    result = await mission_in(world, {asked: errors}, log).fly(REQUEST)
    assert as_if_undisturbed(result) == as_if_undisturbed(expected)
    assert [event.number for event in log] == list(range(1, len(log) + 1))
    assert apart_from_outages(log) == apart_from_outages(told), "nothing is told twice"
    assert [event.data.over for event in log.of("outage")] == [False, True]
    assert log.of("outage")[0].message.startswith("waits up to 10 minutes: vlm_gateway: ")
    assert sum(calls.unreachable for calls in result.model_calls.values()) == unreachable
    moves = [event.data.number for event in log if event.kind in ("move", "turn")]
    assert moves == list(range(1, world.vehicles["e1"]._state.moves + 1)), "each flight is flown once"


async def test_who_stays_away_ends_the_mission_when_the_time_is_over() -> None:
    world, log = BlockWorld(BEHIND), Events()
    result = await mission_in(world, {"floor_count": [AWAY] * 99}, log, Patience(1.2)).fly(REQUEST)
    assert result.outcome == "model_unreachable"
    assert result.message.startswith(f"{AWAY}; waited 1 second")
    assert [event.data.over for event in log.of("outage")] == [False]
    assert result.model_calls["floors"].unreachable == result.model_calls["floors"].calls > 1
    assert result.timings_s["outage"] > 0.0
    assert world.ended == ["e1"]


@pytest.mark.parametrize(
    ("error", "outcome"),
    [
        (UnknownModel("no model 'm'"), "model_unreachable"),
        (ModelRejected("401 (model_rejected)"), "model_unreachable"),
        (ServiceUnusable("refuses our token"), "service_unreachable"),
        (ServiceRefused("422", code="invalid", status=422), "failed"),
    ],
    ids=lambda given: type(given).__name__,
)
async def test_what_no_waiting_mends_is_not_waited_for(error: PortError, outcome: str) -> None:
    world, log = BlockWorld(BEHIND), Events()
    vision: Said = {"floor_count": [error]}
    result = await mission_in(world, vision, log).fly(REQUEST)
    assert (result.outcome, result.message) == (outcome, str(error))
    assert log.of("outage") == []


async def test_a_process_that_nobody_starts_again_is_not_waited_for() -> None:
    world, log = BlockWorld(BEHIND), Events()
    result = await mission_in(world, {"floor_count": [AWAY] * 2}, log, Patience(600.0, lambda: True)).fly(REQUEST)
    assert (result.outcome, log.of("outage")) == ("model_unreachable", [])


async def test_who_is_waited_for_may_be_cancelled_at_once() -> None:
    world = BlockWorld(BEHIND)
    flight: list[asyncio.Task[DeliveryResult]] = []
    log = Heard("outage", lambda: asyncio.get_running_loop().call_soon(flight[0].cancel))
    flight.append(asyncio.create_task(mission_in(world, {"find_object": [AWAY] * 9999}, log).fly(REQUEST)))
    result = await flight[0]
    assert result.outcome == "cancelled"
    assert [event.data.over for event in log.of("outage")] == [False], "it did not come back"
    assert world.ended == ["e1"]


async def until_put_off(mission: Mission) -> MissionState:
    state = begin(REQUEST, "m")
    while state.outage is None:
        assert not state.over
        state = await mission.advanced(state)
    return state


async def test_another_process_goes_on_waiting_for_the_rest_of_the_time() -> None:
    world, log = BlockWorld(BEHIND), Events()
    written = (await until_put_off(mission_in(world, {"find_object": [AWAY]}, log))).model_dump_json()
    back = await mission_in(world, {}, log).go_on(MissionState.model_validate_json(written))
    assert back.outcome == "delivered"
    assert [event.data.over for event in log.of("outage")] == [False, True]
    assert [event.number for event in log] == list(range(1, len(log) + 1))


async def test_the_time_that_another_process_waited_counts() -> None:
    world, log = BlockWorld(BEHIND), Events()
    state = await until_put_off(mission_in(world, {"find_object": [AWAY]}, log))
    assert state.outage is not None
    nearly_over = Outage(why=state.outage.why, tries=9, waited_s=599.9)
    second = mission_in(world, {"find_object": [AWAY] * 2}, log)
    state = await second.advanced(state.model_copy(update={"outage": nearly_over}))
    assert isinstance(state.stage, Ended)
    assert state.stage.message == f"{AWAY}; waited 10 minutes"


async def test_a_vehicle_that_is_away_during_a_flight_goes_on_with_the_same_flight() -> None:
    world = BlockWorld(BEHIND)
    log = Heard("move", lambda: setattr(world, "away", True))
    mission = mission_in(world, {}, log)
    state = await until_put_off(mission)
    assert log.of("outage")[0].data.why == "block world: nobody answers"
    world.away = False
    result = await mission.go_on(state)
    assert result.outcome == "delivered"
    numbers = [event.data.number for event in log if event.kind in ("move", "turn")]
    assert numbers == list(range(1, world.vehicles["e1"]._state.moves + 1))


async def test_the_guard_keeps_watch_over_a_drone_that_waits() -> None:
    class Ailing(BlockVehicle):
        async def state(self) -> VehicleState:
            sound = await super().state()
            ill = Health(ok=False, problems=("motor 3 overheats",))
            return sound.model_copy(update={"health": ill}) if ailing else sound

    class Yard(BlockWorld):
        async def begin(self, question):
            drone = await super().begin(question)
            drone.__class__ = Ailing
            return drone

    ailing: list[bool] = []
    world = Yard(BEHIND)
    log = Heard("outage", lambda: ailing.append(True))
    result = await mission_in(world, {"find_object": [AWAY] * 9999}, log).fly(REQUEST)
    assert result.outcome == "stopped_by_guard"
    assert "motor 3 overheats" in result.message
    assert log.of("refused")[-1].message.startswith("the flight guard ends the waiting: ")


async def test_a_policy_that_is_asked_again_plans_from_where_it_stood() -> None:
    class Once(BlockVision):
        """Its first choice is lost on the way."""

        lost = False

        async def choose_direction(self, question: ChooseDirectionQuestion):
            answer = await super().choose_direction(question)
            if not self.lost:
                self.lost = True
                raise AWAY
            return answer

    results = []
    for seeing in (BlockVision, Once):
        world = BlockWorld(BEHIND)
        settings = MissionSettings(viewpoint=PAPER)
        ports = block_ports(world, seeing(world))
        results.append(await Mission(ports, block_placement(world), settings, Events(), patience=LONG).fly(REQUEST))
    assert as_if_undisturbed(results[0]) == as_if_undisturbed(results[1])


class AwayOncePlaced(BlockWorld):
    """Nobody answers any more as soon as a drone is begun."""

    async def begin(self, question):
        drone = await super().begin(question)
        self.away = True
        return drone


@pytest.mark.parametrize("cancelled", [True, False])
async def test_a_drone_that_was_begun_is_given_back_where_its_placing_was_put_off(cancelled: bool) -> None:
    world, flights = AwayOncePlaced(BEHIND), list[asyncio.Task[DeliveryResult]]()

    def wait_no_more() -> None:
        world.away = False
        flights[0].cancel()

    log = Heard("outage", lambda: asyncio.get_running_loop().call_soon(wait_no_more) if cancelled else None)
    mission = mission_in(world, {}, log, LONG if cancelled else Patience(0.8))
    state = begin(REQUEST)

    async def flown() -> DeliveryResult:
        nonlocal state
        while not state.over:
            state = await mission.advanced(state)
        world.away = False
        await mission.release(state)
        return mission.result(state)

    flights.append(asyncio.create_task(flown()))
    result = await flights[0]
    assert result.outcome == ("cancelled" if cancelled else "service_unreachable")
    assert list(world.vehicles) == world.ended == ["e1"]


@pytest.mark.parametrize("away", [AWAY, ServiceUnreachable("vlm_gateway: nobody answers")], ids=["model", "service"])
async def test_a_drone_that_is_moved_while_it_waits_is_stopped(away: PortError) -> None:
    world = BlockWorld(BEHIND)

    def drift() -> None:
        drone = next(iter(world.vehicles.values()))
        pose = drone._state.pose
        drone._state = drone._state.model_copy(update={"pose": pose.model_copy(update={"x": pose.x - 20.0})})

    result = await mission_in(world, {"find_object": [away]}, Heard("outage", drift)).fly(REQUEST)
    assert result.outcome == "stopped_by_guard"
    assert "20.0 m from where it was left" in result.message


@pytest.mark.parametrize("kind", ["outage", "floor_count"])
async def test_a_log_that_raises_ends_the_mission_and_the_drone_is_given_back(kind: str) -> None:
    def full() -> None:
        raise OSError("no space left on device")

    world = BlockWorld(BEHIND)
    mission = mission_in(world, {"find_object": [AWAY]}, Heard(kind, full))
    result = await mission.fly(REQUEST)
    assert result.outcome == "failed"
    assert isinstance(mission.problem, OSError)
    assert world.ended == ["e1"]
