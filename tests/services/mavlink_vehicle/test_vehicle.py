"""A vehicle and its missions, on a drone of this process that does what it is told at once."""

import asyncio
import math

import pytest

from contracts.geometry import Point3, Pose
from contracts.vehicle import Move
from service_kit.errors import Unavailable
from services.mavlink_vehicle.frames import Enu
from services.mavlink_vehicle.loops import Loops
from services.mavlink_vehicle.task import Task
from services.mavlink_vehicle.vehicle import Vehicle
from tests.services.mavlink_vehicle.obedient import BODY, LIMITS, NoCameras, ObedientLink, flying, idle

FAR = Move(path=(Point3(x=600.0, y=0.0, z=2.0),))


async def under_way(vehicle: Vehicle, move: Move) -> asyncio.Task:
    flight = asyncio.create_task(vehicle.move(1, move))
    async with asyncio.timeout(20):
        while True:
            if vehicle.state().mode == "moving" and vehicle.state().path_m > 2.5:
                return flight
            await asyncio.sleep(0.02)


async def test_a_mission_that_begins_during_a_move_stops_it_and_counts_its_own_from_one() -> None:
    async with flying(ObedientLink()) as vehicle:
        await vehicle.take_off(2.0)
        flight = await under_way(vehicle, FAR)
        await vehicle.begin(idle("next"))
        done = await flight
        assert (done.number, done.cancelled, done.reached) == (1, True, False)
        state = vehicle.state()
        assert (state.id, state.moves, state.path_m, state.mode) == ("next", 0, 0.0, "holding")
        again = await vehicle.move(1, Move(path=(Point3(x=state.pose.x + 1.0, y=state.pose.y, z=state.pose.z),)))
        assert (again.number, again.reached) == (1, True)


async def test_an_autopilot_that_refuses_to_arm_for_a_while_is_asked_again() -> None:
    async with flying(ObedientLink(refusals=2)) as vehicle:
        assert (await vehicle.take_off(2.0)).mode == "holding"


async def test_a_take_off_that_is_over_before_set_points_are_taken_is_nobodys_hand() -> None:
    async with flying(ObedientLink(late=1)) as vehicle:
        assert (await vehicle.take_off(2.0)).mode == "holding"


async def test_an_autopilot_that_never_arms_is_told_in_its_own_words() -> None:
    async with flying(ObedientLink(refusals=99), arms_within_s=0.3) as vehicle:
        with pytest.raises(Unavailable, match="gyros still settling"):
            await vehicle.take_off(2.0)
        assert vehicle.state().mode == "landed"


@pytest.mark.slow
async def test_a_take_off_that_ends_a_little_low_goes_on_to_its_height_by_set_points() -> None:
    async with flying(ObedientLink(short_m=0.8)) as vehicle:
        stood = vehicle.state().pose
        assert (await vehicle.take_off(3.0)).pose.z == pytest.approx(stood.z + 3.0, abs=0.3)


@pytest.mark.slow
async def test_a_drone_whose_motors_go_on_after_a_landing_is_disarmed() -> None:
    link = ObedientLink(disarms=False)
    async with flying(link) as vehicle:
        await vehicle.take_off(2.0)
        assert (await vehicle.land()).mode == "landed"
        assert not link.telemetry.armed


async def test_where_it_stands_is_where_its_trial_begins_however_its_estimate_wanders_before() -> None:
    link = ObedientLink()
    stands = Pose(x=10.0, y=20.0, z=0.32, yaw=-1.0)
    async with flying(link, Task("trial", NoCameras(), LIMITS, BODY, stands)) as vehicle:
        for place in (Enu(0.0, 0.0, 0.0, 0.0), Enu(4.0, -3.0, 1.5, 2.5)):
            link.place = place
            await asyncio.sleep(0.06)
            here = vehicle.state().pose
            assert math.dist((here.x, here.y, here.z), (10.0, 20.0, 0.32)) < 1e-6
            assert here.yaw == pytest.approx(-1.0)
        risen = (await vehicle.take_off(2.0)).pose
        assert (risen.x, risen.y, risen.z, risen.yaw) == pytest.approx((10.0, 20.0, 2.32, -1.0), abs=0.05)
        link.place = link.place._replace(east_m=link.place.east_m + 0.5)
        await vehicle.land()
        assert math.dist((vehicle.state().pose.x, vehicle.state().pose.y), (10.0, 20.0)) < 0.6


async def test_a_loop_that_ends_though_it_should_not_makes_the_service_unready() -> None:
    async def breaks() -> None:
        raise ValueError("a fault")

    loops = Loops()
    loops.start({"the watch": asyncio.Event().wait(), "the stream of set-points": breaks()})  # type: ignore[dict-item]
    assert await loops.problem() is None
    await asyncio.sleep(0.01)
    assert "the stream of set-points has ended" in (await loops.problem() or "")
    await loops.close()
