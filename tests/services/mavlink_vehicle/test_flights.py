"""Flights through real MAVSDK and MAVLink: the stand-in autopilot, the service over HTTP, the yard of the simulator."""

import asyncio
import math
from collections.abc import Callable

import pytest

from contracts.geometry import Point3
from contracts.vehicle import Move, MoveProgress
from mission.ports import ServiceRefused
from mission.vehicles.http_vehicle import HttpVehicle
from mission.vehicles.simulator_trial import SimulatorTrial
from service_kit.client import ServiceClient
from tests.autopilot.stand_in import StandIn
from tests.services.mavlink_vehicle.conftest import begun
from tests.services.sim.conftest import make_yard

NEAR_M = 0.7
START = make_yard().start
ASIDE = (Point3(x=3.0, y=-15.0, z=3.0), Point3(x=3.0, y=-17.0, z=3.0))
Client = Callable[[str], ServiceClient]


async def until_it_flies(vehicle: HttpVehicle) -> None:
    async with asyncio.timeout(20):
        while True:
            state = await vehicle.state()
            if state.mode == "moving" and state.path_m > 1.0:
                return
            await asyncio.sleep(0.05)


async def test_it_takes_off_flies_a_path_looks_and_lands_and_its_set_points_never_pause(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client
) -> None:
    autopilot = stand_in("px4", yaw=2.0)
    async with begun(client(behind(autopilot))) as vehicle:
        stands = await vehicle.state()
        # laid about the drone where it stands, however it is turned
        assert (stands.mode, stands.health.problems) == ("landed", ())
        assert math.dist((stands.pose.x, stands.pose.y), (START.position.x, START.position.y)) < NEAR_M
        assert stands.pose.yaw == pytest.approx(START.yaw, abs=0.05)
        risen = await vehicle.take_off(2.0)
        assert risen.mode == "holding"
        assert risen.pose.z == pytest.approx(stands.pose.z + 2.0, abs=NEAR_M)
        autopilot.told()
        seen = await vehicle.observe(["front"])
        assert seen.views[0].depth is not None
        assert math.dist((seen.pose.x, seen.pose.y, seen.pose.z), (risen.pose.x, risen.pose.y, risen.pose.z)) < NEAR_M
        told: list[MoveProgress] = []
        done = await vehicle.fly(1, Move(path=ASIDE), told.append)
        assert (done.reached, done.collided, done.cancelled) == (True, False, False)
        assert math.dist((done.pose.x, done.pose.y, done.pose.z), (3.0, -17.0, 3.0)) < NEAR_M
        assert done.pose.yaw == pytest.approx(-math.pi / 2, abs=0.1)
        assert done.path_m == pytest.approx(5.1, abs=1.2)
        assert [p.share for p in told] == sorted(p.share for p in told)
        assert await vehicle.fly(1, Move(path=ASIDE)) == done
        await asyncio.sleep(2.0)  # the model thinks
        streamed = autopilot.told()
        assert streamed["mode"] == "offboard"
        assert streamed["offboard_lost"] == 0
        assert streamed["longest_gap_s"] < 0.3, "twenty a second; a busy machine may be late"
        assert streamed["set_points"] > 50
        landed = await vehicle.land()
        assert landed.mode == "landed"
        assert not landed.collided
        assert not autopilot.told()["armed"]


async def test_a_pilot_who_moves_a_stick_has_the_drone_and_keeps_it(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client
) -> None:
    autopilot = stand_in("px4")
    async with begun(client(behind(autopilot))) as vehicle:
        await vehicle.take_off(1.5)
        flight = asyncio.create_task(vehicle.fly(1, Move(path=(Point3(x=-30.0, y=-15.0, z=2.0),))))
        await until_it_flies(vehicle)
        autopilot.told("pilot", mode="position")
        done = await flight
        assert (done.reached, done.cancelled) == (False, False)
        assert done.vehicle.mode == "manual"
        assert done.vehicle.health.problems == ("the pilot has taken over: its mode is POSCTL",)
        assert done.pose.x > -29.0
        for refused in (vehicle.hold(), vehicle.fly(2, Move(path=ASIDE)), vehicle.land()):
            with pytest.raises(ServiceRefused) as refusal:
                await refused
            assert (refusal.value.status, refusal.value.code) == (409, "manual_control")
        await asyncio.sleep(1.0)
        assert autopilot.told()["mode"] == "position"


async def test_arducopter_streams_when_asked_takes_off_in_guided_and_stops_when_a_move_is_cancelled(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client
) -> None:
    autopilot = stand_in("ardupilot")
    async with begun(client(behind(autopilot))) as vehicle:
        assert (await vehicle.connect()).kind == "ardupilot"
        assert (await vehicle.take_off(2.0)).mode == "holding"
        assert 511 in autopilot.told()["commands"]
        flight = asyncio.create_task(vehicle.fly(1, Move(path=(Point3(x=-30.0, y=-15.0, z=2.0),))))
        await until_it_flies(vehicle)
        flight.cancel()
        await asyncio.wait({flight})
        again = await vehicle.fly(1, Move(path=(Point3(x=-30.0, y=-15.0, z=2.0),)))
        assert (again.cancelled, again.reached) == (True, False)
        stopped = await vehicle.state()
        assert stopped.mode == "holding"
        assert stopped.pose.x > -29.0
        await asyncio.sleep(0.5)
        assert math.dist((stopped.pose.x, stopped.pose.y), await _level(vehicle)) < NEAR_M
        assert (await vehicle.land()).mode == "landed"


@pytest.mark.slow
async def test_what_the_drone_flies_into_in_the_scene_ends_its_move_as_a_collision(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client
) -> None:
    service = client(behind(stand_in("px4")))
    async with begun(service) as vehicle:
        await vehicle.take_off(2.0)
        done = await vehicle.fly(1, Move(path=(Point3(x=0.0, y=0.0, z=2.4),)))
        assert (done.reached, done.collided, done.hit) == (False, True, "house")
        assert (await vehicle.state()).collided
        verdict = await SimulatorTrial(service).claim(vehicle.name, None)
        assert verdict.collided
        assert not verdict.delivered
        assert await SimulatorTrial(service).claim(vehicle.name, Point3(x=0.0, y=0.0, z=0.0)) == verdict


async def _level(vehicle: HttpVehicle) -> tuple[float, float]:
    pose = (await vehicle.state()).pose
    return pose.x, pose.y
