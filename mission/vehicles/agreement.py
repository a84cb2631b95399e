"""What every vehicle keeps to, as checks that run on any of them: a new one proves itself by passing all of `CHECKS`.

    @pytest.mark.parametrize("check", CHECKS)
    async def test_my_vehicle(check):
        async with my_vehicle() as candidate:
            await check(candidate)

A check needs a vehicle of its own that has flown nothing, and raises AssertionError with what was expected.
"""

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from itertools import pairwise

from contracts.geometry import Point3, Pose
from contracts.vehicle import FlightMode, Move, MoveProgress, VehicleState
from mission.ports import PortError, ServiceRefused
from mission.vehicle import Vehicle

PATIENCE_S = 60.0
TAKE_OFF_M = 2.0
UNKNOWN_CAMERA = "no-such-camera"


@dataclass(frozen=True)
class Candidate:
    """A vehicle to be checked. `way`: free corners from where it stands, in the air; a flight along them lasts at least
    a second. `near_m`: how exactly it flies."""

    vehicle: Vehicle
    way: tuple[Point3, ...]
    near_m: float = 0.05

    @property
    def end(self) -> Point3:
        return self.way[-1]


Check = Callable[[Candidate], Awaitable[None]]


async def connecting_tells_what_it_is_and_may_be_done_again(candidate: Candidate) -> None:
    vehicle = candidate.vehicle
    first = await vehicle.connect()
    assert first == await vehicle.connect()
    assert first.cameras, "it carries no camera"
    names = [camera.name for camera in first.cameras]
    assert len(set(names)) == len(names), f"names of cameras must differ: {names}"
    assert first.radius_m > 0.0
    assert first.max_speed_m_s > 0.0


async def its_state_tells_pose_uncertainty_battery_and_health(candidate: Candidate) -> None:
    state = await candidate.vehicle.state()
    assert state.id == candidate.vehicle.name
    assert (state.moves, state.collided) == (0, False)
    assert state.mode in {"landed", "holding"}, state.mode
    assert state.health.ok, state.health.problems
    assert not state.health.problems
    # a vehicle that does not know says null; none of these may be more sure than it is
    for uncertain in (state.uncertainty.horizontal_m, state.uncertainty.vertical_m, state.uncertainty.yaw_rad):
        assert uncertain is None or uncertain >= 0.0
    assert state.battery.remaining is None or state.battery.remaining > 0.0


async def taking_off_holds_in_the_air_and_leaves_a_flying_vehicle_where_it_is(candidate: Candidate) -> None:
    vehicle = candidate.vehicle
    before = await vehicle.state()
    risen = await vehicle.take_off(TAKE_OFF_M)
    assert risen.mode == "holding"
    climbed_m = TAKE_OFF_M if before.mode == "landed" else 0.0
    assert abs(risen.pose.z - before.pose.z - climbed_m) <= candidate.near_m
    again = await vehicle.take_off(TAKE_OFF_M)
    assert _gap_m(again.pose, risen.pose) <= candidate.near_m


async def it_observes_the_cameras_that_are_named_or_all(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    cameras = (await vehicle.connect()).cameras
    everything = await vehicle.observe()
    assert tuple(view.camera for view in everything.views) == cameras
    assert everything.vehicle == vehicle.name
    for view in everything.views:
        assert view.depth is not None, f"{view.camera.name} has no depth"
        assert (view.depth.width, view.depth.height) == (view.camera.width, view.camera.height)
    names = [camera.name for camera in reversed(cameras[-2:])]
    some = await vehicle.observe(names, depth=False)
    assert [view.camera.name for view in some.views] == names
    assert all(view.depth is None for view in some.views)
    assert some.number > everything.number
    assert _gap_m(some.pose, (await vehicle.state()).pose) <= candidate.near_m


async def a_camera_that_it_does_not_carry_is_refused_by_name(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    refusal = await _refused(vehicle.observe([UNKNOWN_CAMERA]))
    assert refusal.status == 422, refusal
    assert UNKNOWN_CAMERA in str(refusal)


async def it_flies_a_path_and_tells_how_far_it_has_come(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    before = await vehicle.state()
    told: list[MoveProgress] = []
    done = await vehicle.fly(1, Move(path=candidate.way), told.append)
    assert (done.number, done.reached, done.cancelled, done.collided) == (1, True, False, False)
    assert _gap_m(done.pose, candidate.end) <= candidate.near_m
    shares = [progress.share for progress in told]
    assert shares == sorted(shares), f"progress went back: {shares}"
    assert (told[-1].state, told[-1].share) == ("done", 1.0)
    assert any(progress.state == "flying" for progress in told), "nothing was told on the way"
    after = await vehicle.state()
    assert after == done.vehicle or _gap_m(after.pose, done.vehicle.pose) <= candidate.near_m
    assert (after.moves, after.mode) == (1, "holding")
    corners: list[Pose | Point3] = [before.pose, *candidate.way]
    length_m = sum(_gap_m(a, b) for a, b in pairwise(corners))
    assert abs(done.path_m - length_m) <= candidate.near_m * len(corners)
    assert after.path_m >= before.path_m + done.path_m - candidate.near_m
    assert after.flight_s > before.flight_s


async def without_a_path_it_turns_where_it_is(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    before = await vehicle.state()
    turned = await vehicle.fly(1, Move(yaw=before.pose.yaw + 1.0))
    assert turned.reached
    assert abs(math.remainder(turned.pose.yaw - before.pose.yaw - 1.0, math.tau)) <= 0.1
    assert _gap_m(turned.pose, before.pose) <= candidate.near_m


async def the_same_number_again_is_the_same_move(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    move = Move(path=candidate.way)
    first = await vehicle.fly(1, move)
    flown_m = (await vehicle.state()).path_m
    again = await vehicle.fly(1, move)
    assert again == first
    assert abs((await vehicle.state()).path_m - flown_m) <= candidate.near_m


async def a_wrong_number_or_another_move_under_a_number_is_refused(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    move = Move(path=candidate.way)
    for number in (2, 7):
        refusal = await _refused(vehicle.fly(number, move))
        assert refusal.status == 409, refusal
        assert "1" in str(refusal), "a refusal says which number is next"
    assert (await vehicle.state()).moves == 0
    await vehicle.fly(1, move)
    flown_m = (await vehicle.state()).path_m
    refusal = await _refused(vehicle.fly(1, Move(path=candidate.way[:-1])))
    assert refusal.status == 409, refusal
    assert abs((await vehicle.state()).path_m - flown_m) <= candidate.near_m


async def a_move_that_is_no_longer_waited_for_stops_on_the_way(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    assert (await vehicle.connect()).cancels_moves, "it can't be stopped on its way"
    move = Move(path=candidate.way)
    flight = asyncio.create_task(vehicle.fly(1, move))
    await _under_way(vehicle)
    flight.cancel()
    await asyncio.wait({flight}, timeout=PATIENCE_S)
    assert flight.cancelled()
    stopped = await _holding(vehicle)
    assert _gap_m(stopped.pose, candidate.end) > candidate.near_m, "it flew on to the end"
    again = await vehicle.fly(1, move)
    assert (again.cancelled, again.reached) == (True, False)
    assert _gap_m(again.pose, stopped.pose) <= candidate.near_m
    assert (await vehicle.fly(2, Move(path=(candidate.end,)))).reached


async def holding_stops_it_on_the_way(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    flight = asyncio.create_task(vehicle.fly(1, Move(path=candidate.way)))
    await _under_way(vehicle)
    held = await vehicle.hold()
    assert held.mode == "holding"
    done = await asyncio.wait_for(flight, PATIENCE_S)
    assert (done.cancelled, done.reached) == (True, False)
    assert _gap_m(done.pose, candidate.end) > candidate.near_m
    assert (await vehicle.hold()).mode == "holding"


async def it_returns_to_where_it_started_lands_and_takes_off_again(candidate: Candidate) -> None:
    vehicle = await _in_the_air(candidate)
    if not (await vehicle.connect()).lands:
        await _refused(vehicle.land())
        return
    start = (await vehicle.state()).pose
    await vehicle.fly(1, Move(path=candidate.way))
    home = await vehicle.return_home()
    assert home.mode == "holding"
    assert math.dist((home.pose.x, home.pose.y), (start.x, start.y)) <= candidate.near_m
    landed = await vehicle.land()
    assert landed.mode == "landed"
    assert not landed.collided
    assert landed.pose.z < start.z
    refusal = await _refused(vehicle.fly(2, Move(path=candidate.way)))
    assert refusal.status == 409, refusal
    risen = await vehicle.take_off(TAKE_OFF_M)
    assert abs(risen.pose.z - landed.pose.z - TAKE_OFF_M) <= candidate.near_m
    assert (await vehicle.fly(2, Move(yaw=0.0))).reached


async def once_released_it_may_be_released_again(candidate: Candidate) -> None:
    await candidate.vehicle.release()
    await candidate.vehicle.release()


CHECKS: tuple[Check, ...] = (
    connecting_tells_what_it_is_and_may_be_done_again,
    its_state_tells_pose_uncertainty_battery_and_health,
    taking_off_holds_in_the_air_and_leaves_a_flying_vehicle_where_it_is,
    it_observes_the_cameras_that_are_named_or_all,
    a_camera_that_it_does_not_carry_is_refused_by_name,
    it_flies_a_path_and_tells_how_far_it_has_come,
    without_a_path_it_turns_where_it_is,
    the_same_number_again_is_the_same_move,
    a_wrong_number_or_another_move_under_a_number_is_refused,
    a_move_that_is_no_longer_waited_for_stops_on_the_way,
    holding_stops_it_on_the_way,
    it_returns_to_where_it_started_lands_and_takes_off_again,
    once_released_it_may_be_released_again,
)


async def _in_the_air(candidate: Candidate) -> Vehicle:
    vehicle = candidate.vehicle
    await vehicle.connect()
    await vehicle.take_off(TAKE_OFF_M)
    return vehicle


async def _refused(call: Awaitable[object]) -> ServiceRefused:
    try:
        answer = await call
    except ServiceRefused as refusal:
        return refusal
    except PortError as error:
        raise AssertionError(f"that must be refused by the vehicle itself, not fail with {error}") from None
    raise AssertionError(f"that must be refused, not answered with {answer}")


async def _under_way(vehicle: Vehicle) -> VehicleState:
    return await _until(vehicle, "moving", lambda state: state.moves == 1 and state.path_m > 0.0)


async def _holding(vehicle: Vehicle) -> VehicleState:
    return await _until(vehicle, "holding", lambda state: True)


async def _until(vehicle: Vehicle, mode: FlightMode, fits: Callable[[VehicleState], bool]) -> VehicleState:
    give_up = time.monotonic() + PATIENCE_S
    while True:
        state = await vehicle.state()
        if state.mode == mode and fits(state):
            return state
        assert time.monotonic() < give_up, f"it was to be {mode}, but is {state}"
        await asyncio.sleep(0.02)


def _gap_m(a: Pose | Point3, b: Pose | Point3) -> float:
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))
