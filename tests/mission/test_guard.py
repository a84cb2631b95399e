"""The flight guard before a vehicle: every flight goes through it, and its limits are the operator's."""

import math
import re
from dataclasses import dataclass, field

import pytest

from contracts.depth_assist import ApproachSettings
from contracts.flight_limits import FlightLimits
from contracts.geometry import Point3
from contracts.images import decode_depth_units, encode_depth_units
from contracts.orchestrator import DeliveryResult, MissionSettings, SearchSettings
from contracts.sim import EpisodeQuestion, Flight
from contracts.vehicle import Battery, FlightMode, Health, Move, MoveResult, Observation, VehicleState
from contracts.vlm_gateway import FloorCountAnswer, FloorCountQuestion
from mission.clearances import within_limits
from mission.frames import FlightRefused
from mission.guard import GuardedVehicle, guarded
from mission.mission import Mission
from mission.policies import completed
from mission.ports import ServiceRefused
from tests.mission.block import RADIUS_M, Block, block_scene
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
from tests.mission.box_world import RIG, WHO, BlockVision, block_placement, block_ports
from tests.mission.test_mission import BEHIND, REQUEST, Events

AHEAD = Move(path=(Point3(x=0.0, y=-10.0, z=1.5),))


@dataclass
class Faulty:
    """A vehicle with faults that are switched on while it flies."""

    vehicle: BlockVehicle
    frozen: bool = False
    blind: bool = False
    jump_m: float = 0.0
    remaining: float | None = None
    healthy: bool = True
    mode: FlightMode | None = None
    refuses: ServiceRefused | None = None
    flight_s: float = 0.0
    old: bool = False
    looks: int = field(default=0, init=False)
    seen: Observation | None = field(default=None, init=False)

    def __getattr__(self, name: str) -> object:
        return getattr(self.vehicle, name)

    async def state(self) -> VehicleState:
        return self._told(await self.vehicle.state())

    async def observe(self, cameras=None, *, depth: bool = True) -> Observation:
        if not self.frozen or self.seen is None:
            self.seen = await self.vehicle.observe(cameras, depth=depth)
        self.looks += 1
        state = await self.state()
        number = 1 if self.old else self.looks
        seen = self.seen.model_copy(update={"number": number, "pose": state.pose})
        if not self.blind:
            return seen
        dark = [v.model_copy(update={"depth": encode_depth_units(0 * decode_depth_units(v.depth))}) for v in seen.views]
        return seen.model_copy(update={"views": tuple(dark)})

    async def hold(self) -> VehicleState:
        if self.refuses is not None:
            raise self.refuses
        return await self.vehicle.hold()

    async def fly(self, number: int, move: Move, progress=None) -> MoveResult:
        if self.refuses is not None:
            raise self.refuses
        done = await self.vehicle.fly(number, move, progress)
        return done.model_copy(update={"vehicle": self._told(done.vehicle)})

    def _told(self, state: VehicleState) -> VehicleState:
        pose = state.pose.model_copy(update={"x": state.pose.x + self.jump_m})
        battery = Battery(remaining=self.remaining if self.remaining is not None else 1.0)
        health = Health() if self.healthy else Health(ok=False, problems=("a rotor stutters",))
        flight_s = state.flight_s + self.flight_s
        mode = self.mode or state.mode
        changes = {"pose": pose, "battery": battery, "health": health, "flight_s": flight_s, "mode": mode}
        return state.model_copy(update=changes)


async def faulty(limits: FlightLimits | None = None, block: Block | None = None) -> tuple[Faulty, GuardedVehicle]:
    block = block or Block()
    world = BlockWorld(block)
    vehicle = await world.begin(EpisodeQuestion(scene=block_scene(block), rig=RIG, key="m"))
    fault = Faulty(vehicle)
    return fault, await guarded(fault, limits or FlightLimits(), None)


async def refusal(guard: GuardedVehicle, move: Move, number: int = 1) -> FlightRefused:
    with pytest.raises(FlightRefused) as caught:
        await guard.fly(number, move)
    return caught.value


async def test_a_flight_through_what_the_cameras_show_to_be_free_is_flown() -> None:
    fault, guard = await faulty()
    assert (await guard.fly(1, AHEAD)).reached
    assert (await guard.fly(1, AHEAD)).reached  # the same number again is the same move
    assert fault.vehicle.pose.y == pytest.approx(-10.0)


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ([(0.0, -6.2, 1.5)], "clearance"),
        ([(0.0, 0.0, 1.5)], "clearance"),
        ([(0.0, -40.0, 1.5)], "unseen"),
        ([(0.0, -10.0, 0.3)], "below_floor"),
        ([(0.0, -15.0, 60.0)], "above_ceiling"),
        ([(400.0, -15.0, 1.5)], "geofence"),
    ],
)
async def test_what_must_not_be_flown_is_refused_by_name_and_the_vehicle_stays(path: list, reason: str) -> None:
    fault, guard = await faulty()
    before = fault.vehicle.pose
    refused = await refusal(guard, Move(path=tuple(Point3(x=x, y=y, z=z) for x, y, z in path)))
    assert (refused.reason, refused.final) == (reason, False)
    assert fault.vehicle.pose == before


async def test_frozen_cameras_are_noticed_as_soon_as_the_drone_has_moved() -> None:
    fault, guard = await faulty()
    await guard.observe()
    await guard.fly(1, AHEAD)
    fault.frozen = True
    await guard.observe()
    refused = await refusal(guard, Move(path=(Point3(x=0.0, y=-11.0, z=1.5),)), 2)
    assert (refused.reason, refused.final) == ("frozen_frames", True)


@pytest.mark.parametrize(
    ("fault_of", "value", "reason"),
    [
        ("blind", True, "blind"),
        ("jump_m", 5.0, "pose_jump"),
        ("remaining", 0.16, "battery_reserve"),
        ("healthy", False, "health"),
        ("mode", "manual", "manual_control"),
        ("flight_s", 1_199.0, "time_limit"),
    ],
)
async def test_a_fault_in_the_air_ends_all_flying_by_name(fault_of: str, value: object, reason: str) -> None:
    fault, guard = await faulty()
    await guard.observe()
    await guard.fly(1, AHEAD)
    setattr(fault, fault_of, value)
    await guard.observe()
    refused = await refusal(guard, Move(path=(Point3(x=0.0, y=-9.0, z=1.5),)), 2)
    assert (refused.reason, refused.final) == (reason, True)


async def test_a_way_that_takes_too_long_is_refused_by_its_length_and_the_time_that_it_takes() -> None:
    _, guard = await faulty()
    refused = await refusal(guard, Move(path=(Point3(x=0.0, y=-9_000.0, z=1.5),)), 1)
    assert refused.reason == "time_limit"
    assert re.search(r"a way of 89\d\d m and the way home may take \d{4} s; 0 s are flown, 1200 s are", str(refused))


async def test_a_pilot_who_takes_over_between_two_looks_ends_all_flying_and_is_not_interfered_with() -> None:
    fault, guard = await faulty()
    await guard.fly(1, AHEAD)
    fault.refuses = ServiceRefused("the pilot has taken over", code="manual_control", status=409)
    refused = await refusal(guard, Move(path=(Point3(x=0.0, y=-9.0, z=1.5),)), 2)
    assert (refused.reason, refused.final) == ("manual_control", True)
    assert await guard.end(refused.reason) == "none"
    assert await guard.end("health") == "none"


async def test_flying_faster_than_allowed_is_the_last_flight() -> None:
    fault, guard = await faulty(FlightLimits(max_speed_m_s=1.0))
    await guard.fly(1, AHEAD)
    assert (await refusal(guard, AHEAD, 2)).reason == "speed"
    carried_on = await guarded(fault, FlightLimits(max_speed_m_s=1.0), guard.memory)
    assert (await refusal(carried_on, AHEAD, 2)).reason == "speed"
    with pytest.raises(FlightRefused, match="flown at"):
        await carried_on.watch()


async def test_pictures_that_are_not_of_here_are_stale() -> None:
    fault, guard = await faulty()
    await guard.observe()
    fault.old = True
    await guard.observe()
    assert (await refusal(guard, AHEAD)).reason == "stale_frames"


async def test_the_way_back_is_the_way_flown_and_ends_on_the_ground() -> None:
    fault, guard = await faulty()
    await guard.fly(1, Move(path=(Point3(x=0.0, y=-15.0, z=6.0),)))
    await guard.fly(2, Move(path=(Point3(x=4.0, y=-12.0, z=6.0),)))
    fault.frozen = True
    assert await guard.end("frozen_frames") == "return"
    state = await fault.vehicle.state()
    assert state.mode == "landed"
    assert math.hypot(state.pose.x, state.pose.y + 15.0) < 0.1
    assert not state.collided


def test_a_request_may_tighten_a_limit_and_never_loosen_one() -> None:
    operator = FlightLimits(geofence_m=80.0, min_clearance_m=0.3)
    wide = operator.tightened(FlightLimits(geofence_m=4_000.0, min_clearance_m=0.05, battery_reserve=0.0))
    assert wide == operator
    narrow = operator.tightened(FlightLimits(geofence_m=20.0, min_clearance_m=1.0))
    assert (narrow.geofence_m, narrow.min_clearance_m, narrow.max_height_m) == (20.0, 1.0, operator.max_height_m)


NOTHING = {"clearance_m": 0.0, "tight_clearance_m": 0.0, "drone_radius_m": 0.01}


def test_the_planner_keeps_the_drones_radius_and_the_operators_clearance_whatever_is_asked() -> None:
    approach = ApproachSettings(clearance_m=0.0, drone_radius_m=0.01, stop_distance_m=0.05)
    for search in ({"policy": "contour", **NOTHING}, {"policy": "paper", "safe_distances": NOTHING}):
        asked = MissionSettings(
            viewpoint=SearchSettings(**search), approach=approach, flight=Flight(max_speed_m_s=20.0)
        )
        bounded = within_limits(completed(asked), FlightLimits())
        constants = bounded.viewpoint.constants
        room = constants.get("safe_distances", constants)
        assert room["drone_radius_m"] >= RADIUS_M
        assert min(room["clearance_m"], room["tight_clearance_m"]) >= 0.15
        assert (bounded.approach.drone_radius_m, bounded.flight.max_speed_m_s) == (RADIUS_M, 8.0)


@pytest.mark.parametrize(
    "block",
    [
        Block(),
        Block(thing=(3.0, 6.2, 10.5), thing_normal=(0.0, 1.0)),
        Block(thing=(8.2, 1.0, 10.5), thing_normal=(1.0, 0.0)),
    ],
)
async def test_a_request_that_switches_all_clearances_off_hits_nothing(block: Block) -> None:
    world = BlockWorld(block)
    approach = ApproachSettings(clearance_m=0.0, drone_radius_m=0.01, stop_distance_m=0.05)
    settings = MissionSettings(viewpoint=SearchSettings(policy="contour", **NOTHING), approach=approach)
    result = await Mission(block_ports(world), block_placement(world), settings, Events()).fly(REQUEST)
    assert not world.vehicles["e1"].collided
    assert result.outcome in {"delivered", "blocked", "object_not_found"}


class OneFloorForEver(BlockVision):
    """Says "one floor" to every picture, also to one of the sky."""

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        self._pose("floor_count")
        return FloorCountAnswer(role="floors", floors=1, **WHO)


async def test_a_model_that_counts_floors_for_ever_does_not_send_the_drone_above_the_roof() -> None:
    world, log = BlockWorld(), Events()
    ports = block_ports(world, OneFloorForEver(world))
    result = await Mission(ports, block_placement(world), MissionSettings(), log).fly("floor 200, the green flower pot")
    assert result.outcome == "floor_not_found"
    highest = max(e.data.to.z for e in log.of("move"))
    assert highest <= world.block.top + FlightLimits().roof_margin_m


async def fly_with(fault_at: int, log: Events, **faults: object) -> DeliveryResult:
    """A mission whose vehicle gets its faults with the flight of that number."""
    world = BlockWorld(BEHIND)
    placement = block_placement(world)

    class Struck(Faulty):
        async def fly(self, number: int, move: Move, progress=None) -> MoveResult:
            done = await super().fly(number, move, progress)
            if number == fault_at:
                for name, value in faults.items():
                    setattr(self, name, value)
            return done

    struck: dict[str, Struck] = {}

    class Strikes(BlockWorld):
        async def resume(self, vehicle: str):
            found = await world.resume(vehicle)
            return struck.setdefault(vehicle, Struck(found))

        async def begin(self, question: EpisodeQuestion):
            return await self.resume((await world.begin(question)).name)

        async def claim(self, vehicle, target):
            return await world.claim(vehicle, target)

    placed = type(placement)(Strikes(BEHIND), placement.question)
    result = await Mission(block_ports(world), placed, MissionSettings(), log).fly(REQUEST)
    assert not world.vehicles["e1"].collided
    return result


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ({"frozen": True}, "frozen_frames"),
        ({"blind": True}, "blind"),
        ({"jump_m": 6.0}, "pose_jump"),
        ({"remaining": 0.1}, "battery_reserve"),
    ],
)
async def test_a_mission_whose_vehicle_fails_ends_safely_and_says_why(fault: dict, reason: str) -> None:
    log = Events()
    result = await fly_with(3, log, **fault)
    assert result.outcome == "stopped_by_guard"
    assert "stopped for safety" in result.message
    assert [e.data.reason for e in log.of("refused")][-1] == reason
    assert log.of("refused")[-1].data.action != "none"
