"""People who walk where a drone flies low: it waits for them, or flies over their heads."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from contracts.event_data import MoveData
from contracts.flight_limits import FlightLimits
from contracts.geometry import Point2, Point3, Pose
from contracts.keep_out import KeepOut
from contracts.orchestrator import MissionSettings
from contracts.sim import EpisodeQuestion
from contracts.vehicle import Move, Observation
from mission import passing
from mission.frames import FlightRefused
from mission.guard import GuardedVehicle
from mission.mission import Mission, begin
from mission.passing import OVER_M, RESUMED_S, way_over
from mission.policies import policy_of
from mission.stages import Ended
from mission.state import GuardMemory, MissionState, PlannedFlight
from mission.step import Drone, MissionContext, Step
from tests.mission.block import Block
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
from tests.mission.box_world import RIG, block_placement, block_ports
from tests.mission.test_mission import Events

LOOK_S = 0.4
WAIT_S = 8.0
LOW_M = 2.7
STEPS = 60
WIRES = KeepOut(
    name="tram-wires",
    outline=tuple(Point2(x=x, y=y) for x, y in ((-30.0, -20.0), (30.0, -20.0), (30.0, -11.5), (-30.0, -11.5))),
    min_height_m=3.0,
    max_height_m=9.0,
)
WALK = 0.52
"""Metres a look."""
Walk = Callable[[int], float]
"""How far east somebody is at a look."""


def person(x: float, y: float) -> Block:
    return Block(x0=x - 0.25, x1=x + 0.25, y0=y - 0.25, y1=y + 0.25, floors=1, floor_height_m=1.75)


class Street(BlockVehicle):
    """Somebody walks along before the house; time goes on with looks alone."""

    walk: Walk = staticmethod(lambda look: 0.0)
    y = -10.0

    async def observe(self, cameras=None, *, depth: bool = True) -> Observation:
        self.block = replace(self.block, neighbour=person(self.walk(self.looks), self.y))
        seen = await super().observe(cameras, depth=depth)
        return seen.model_copy(update={"time_s": self.looks * LOOK_S})


@pytest.fixture(autouse=True)
def no_time_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passing, "LOOK_EVERY_S", 0.0)
    monkeypatch.setattr(passing, "WAIT_S", WAIT_S)


class Timeless(Street):
    """Its clock stands still."""

    async def observe(self, cameras=None, *, depth: bool = True) -> Observation:
        return (await super().observe(cameras, depth=depth)).model_copy(update={"time_s": 7.0})


async def street(
    z: float,
    walk: Walk,
    y: float = -10.0,
    limits: FlightLimits | None = None,
    kind: type[Street] = Street,
) -> tuple[Street, GuardedVehicle]:
    """A drone that has looked twice at who walks along `y`."""
    vehicle = kind(Block(start=Pose(x=0.0, y=-15.0, z=z, yaw=1.57)), "e1", RIG)
    vehicle.walk, vehicle.y = walk, y
    memory = GuardMemory(home=vehicle.pose)
    guard = GuardedVehicle(vehicle, await vehicle.connect(), limits or FlightLimits(), memory)
    await guard.observe()
    await guard.observe()
    return vehicle, guard


def to(z: float) -> Move:
    return Move(path=(Point3(x=0.0, y=-11.0, z=z),))


async def test_from_above_a_drone_waits_until_nobody_could_come_into_its_way_down() -> None:
    vehicle, guard = await street(3.0, lambda look: -1.5 + 1.0 * (look > 0) + WALK * look)
    assert guard.memory.passers_by
    assert (await guard.fly(1, to(1.5))).reached
    assert guard.waited_s > 0.5
    assert vehicle.walk(vehicle.looks) > 4.0


async def test_a_guard_that_carries_on_after_somebody_moved_looks_until_it_would_see_them_move() -> None:
    """Of whoever stands in plain sight at its first look nothing tells that they walk."""
    first, guard = await street(3.0, lambda look: -2.5 + 0.5 * look)
    assert guard.memory.passers_by
    vehicle = Street(first.block, "e1", RIG)
    vehicle.walk, vehicle.y = (lambda look: -1.5 + WALK * look), first.y
    carried_on = GuardedVehicle(vehicle, await vehicle.connect(), FlightLimits(), guard.memory)
    assert (await carried_on.fly(1, to(1.5))).reached
    assert carried_on.waited_s >= RESUMED_S
    assert vehicle.walk(vehicle.looks) > 3.0
    assert (await carried_on.fly(2, to(3.0))).reached
    assert carried_on.waited_s == 0.0


async def test_who_never_goes_away_is_waited_for_so_long_and_no_longer() -> None:
    vehicle, guard = await street(3.0, lambda look: 1.0 if look % 2 else -1.0)
    with pytest.raises(FlightRefused, match="walks or drives by") as refused:
        await guard.fly(1, to(1.5))
    assert refused.value.reason == "passer_by"
    assert not refused.value.final
    assert vehicle.looks <= WAIT_S / LOOK_S + 5
    assert vehicle.pose.z == 3.0


async def test_a_low_drone_does_not_wait_in_their_reach_where_it_can_rise() -> None:
    vehicle, guard = await street(1.5, lambda look: 1.0 if look else -1.0)
    assert guard.low_m == pytest.approx(LOW_M)
    with pytest.raises(FlightRefused, match="walks or drives by"):
        await guard.fly(1, to(1.5))
    assert vehicle.looks == 3
    assert (await guard.fly(1, Move(path=(Point3(x=0.0, y=-15.0, z=LOW_M + OVER_M),)))).reached


async def test_who_stands_right_beside_a_low_drone_does_not_keep_it_from_rising() -> None:
    vehicle, guard = await street(1.5, lambda look: 1.0 if look else -1.0, y=-13.6)
    with pytest.raises(FlightRefused, match="walks or drives by"):
        await guard.fly(1, to(1.5))
    up, _ = way_over(PlannedFlight(move=to(1.5), why="on"), vehicle.pose, guard.low_m)
    assert guard.can_rise
    assert (await guard.fly(1, up.move)).reached


@pytest.mark.parametrize("limits", [FlightLimits(max_height_m=2.6), FlightLimits(keep_out=(WIRES,))])
async def test_a_low_drone_that_may_not_rise_waits_where_it_is(limits: FlightLimits) -> None:
    vehicle, guard = await street(1.5, lambda look: -1.5 + 1.0 * (look > 0) + WALK * look, limits=limits)
    assert not guard.can_rise
    assert (await guard.fly(1, to(1.5))).reached
    assert guard.waited_s > 0.5
    assert vehicle.walk(vehicle.looks) > 4.0


async def test_where_the_vehicles_clock_stands_still_a_wait_ends_after_so_many_looks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(passing, "MOST_LOOKS", 20)
    vehicle, guard = await street(3.0, lambda look: 1.0 if look else -1.0, kind=Timeless)
    with pytest.raises(FlightRefused, match="walks or drives by"):
        await guard.fly(1, to(1.5))
    assert 20 <= vehicle.looks <= 25


async def test_a_clock_that_stands_still_does_not_hide_that_somebody_was_waited_for() -> None:
    vehicle, guard = await street(3.0, lambda look: -1.5 + 1.0 * (look > 0) + WALK * look, kind=Timeless)
    assert (await guard.fly(1, to(1.5))).reached
    cleared = next(look for look in range(100) if vehicle.walk(look) > 4.0)
    assert vehicle.looks >= cleared


async def test_where_a_look_ahead_alone_shows_no_way_the_guard_looks_with_all_cameras_before_it_refuses() -> None:
    vehicle = Street(Block(start=Pose(x=0.0, y=-15.0, z=3.0, yaw=1.57)), "e1", RIG)
    guard = GuardedVehicle(vehicle, await vehicle.connect(), FlightLimits(), GuardMemory(home=vehicle.pose))
    await guard.observe(["front"])
    aside = Move(path=(Point3(x=4.0, y=-15.0, z=3.0),), yaw=1.57)
    assert (await guard.fly(1, aside)).reached
    assert vehicle.looks == 2
    with pytest.raises(FlightRefused, match="nobody has seen"):
        await guard.fly(2, Move(path=(Point3(x=4.0, y=-30.0, z=3.0),)))


async def test_over_their_heads_it_flies_at_once() -> None:
    vehicle, guard = await street(3.0, lambda look: 1.0 if look else -1.0)
    assert (await guard.fly(1, to(3.0))).reached
    assert vehicle.looks == 2


async def test_where_nobody_moves_no_flight_waits_and_no_look_is_added() -> None:
    vehicle, guard = await street(1.5, lambda look: 3.0)
    assert not guard.memory.passers_by
    assert (await guard.fly(1, to(1.5))).reached
    assert (vehicle.looks, guard.waited_s) == (2, 0.0)


def test_the_way_over_them_goes_up_across_and_down_at_its_end() -> None:
    pose = Pose(x=0.0, y=0.0, z=1.5, yaw=0.3)
    low = PlannedFlight(
        move=Move(path=(Point3(x=4.0, y=0.0, z=1.5), Point3(x=4.0, y=3.0, z=2.0)), yaw=1.0), why="leg 1"
    )
    up, over = way_over(low, pose, LOW_M)
    over_m = LOW_M + OVER_M
    assert [(p.x, p.y, p.z) for p in up.move.path] == [(0.0, 0.0, over_m)]
    assert [(p.x, p.y, p.z) for p in over.move.path] == [(4.0, 0.0, over_m), (4.0, 3.0, over_m), (4.0, 3.0, 2.0)]
    assert (over.move.yaw, over.why) == (1.0, "leg 1")


class BusyWorld(BlockWorld):
    """Its drone flies in a street with somebody who walks there and back before the house."""

    async def begin(self, question: EpisodeQuestion) -> BlockVehicle:
        if not self.vehicles:
            await super().begin(question)
            vehicle = self.vehicles["e1"] = Street(self.block, "e1", question.rig, rests_below_m=self.rests_below_m)
            vehicle.walk = lambda look: abs((WALK * look) % 24.0 - 12.0) - 6.0
        return await self.resume("e1")


async def mission_among_people(rests_below_m: float) -> tuple[MissionState, Events]:
    """A mission to the ground floor, at its end or after `STEPS` steps."""
    block = Block(thing=(3.0, -6.2, 1.5), start=Pose(x=0.0, y=-15.0, z=1.5, yaw=1.57))
    world, log = BusyWorld(block, rests_below_m=rests_below_m), Events()
    mission = Mission(block_ports(world), block_placement(world), MissionSettings(), log)
    state = begin("floor 1, the green flower pot")
    for _ in range(STEPS):
        state = await mission.advanced(state)
        if state.over:
            break
    return state, log


async def test_a_step_that_waited_and_is_done_again_tells_the_same() -> None:
    vehicle, guard = await street(3.0, lambda look: -1.5 + 1.0 * (look > 0) + WALK * look)
    world, log, settings = BlockWorld(vehicle.block), Events(), MissionSettings()
    context = MissionContext(
        block_ports(world), block_placement(world), settings, policy_of(settings.viewpoint), log,
        drone=Drone(guard, await guard.connect()),
    )  # fmt: skip
    state = begin("floor 1, the green flower pot").model_copy(update={"drone": await guard.state()})
    once, again = Step(state, context), Step(state, context)
    low = PlannedFlight(move=to(1.5), why="down")
    await once.fly(low)
    await again.fly(low)
    once.settle()
    again.settle()
    first, second = log
    assert (first.number, first.kind, first.message) == (second.number, second.kind, second.message)
    assert isinstance(first.data, MoveData)
    assert first.data.waited_s > 0.5
    assert once.state.events == again.state.events


async def test_a_mission_to_the_ground_floor_goes_on_above_the_heads_and_says_so() -> None:
    state, log = await mission_among_people(0.0)
    assert isinstance(state.stage, Ended)
    assert state.stage.outcome == "delivered"
    assert any("on above them" in event.message for event in log)


async def test_a_drone_that_comes_to_rest_a_little_low_is_above_the_heads_all_the_same() -> None:
    state, log = await mission_among_people(0.2)
    assert isinstance(state.stage, Ended)
    assert state.stage.outcome == "delivered"
    assert 1 <= sum("on above them" in event.message for event in log) <= 3


async def test_a_drone_that_never_comes_to_rest_above_the_heads_rises_once_a_stop_at_most() -> None:
    state, log = await mission_among_people(0.8)
    assert state.exploration_steps > 0
    rises = sum("on above them" in event.message for event in log)
    assert 1 <= rises <= state.exploration_steps + 1
