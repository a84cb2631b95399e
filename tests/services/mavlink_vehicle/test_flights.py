"""Flights through real MAVSDK and MAVLink: the stand-in autopilot, and the service over HTTP."""

import asyncio
import math
from collections.abc import Callable

import pytest

from contracts.geometry import Point3, Pose
from contracts.vehicle import Move, MoveProgress
from mission.ports import ServiceRefused, ServiceUnreachable
from mission.vehicles.http_vehicle import HttpVehicle
from service_kit.client import ServiceClient
from tests.autopilot.stand_in import StandIn
from tests.services.mavlink_vehicle.conftest import standing

NEAR_M = 0.7
ASIDE = (Point3(x=3.0, y=0.0, z=3.0), Point3(x=3.0, y=-2.0, z=3.0))
FAR = Move(path=(Point3(x=-40.0, y=0.0, z=2.0),))
Client = Callable[[str], ServiceClient]
Start = Callable[..., StandIn]
Behind = Callable[..., str]


def gap_m(a: Pose, x: float, y: float, z: float) -> float:
    return math.dist((a.x, a.y, a.z), (x, y, z))


async def under_way(vehicle: HttpVehicle, move: Move) -> asyncio.Task:
    """A flight that has begun."""
    flight = asyncio.create_task(vehicle.fly(1, move))
    async with asyncio.timeout(20):
        while True:
            state = await vehicle.state()
            if state.mode == "moving" and state.path_m > 1.0:
                return flight
            await asyncio.sleep(0.05)


async def test_it_takes_off_flies_a_path_and_lands_and_its_set_points_never_pause(
    stand_in: Start, behind: Behind, client: Client
) -> None:
    autopilot = stand_in("px4", yaw=0.5)
    vehicle = await standing(client(behind(autopilot)))
    stands = await vehicle.state()
    assert (stands.mode, stands.health.problems) == ("landed", ())
    assert stands.pose.yaw == pytest.approx(math.pi / 2 - 0.5, abs=0.05)
    risen = await vehicle.take_off(2.0)
    assert (risen.mode, risen.battery.remaining) == ("holding", pytest.approx(1.0, abs=0.05))
    assert gap_m(risen.pose, 0.0, 0.0, stands.pose.z + 2.0) < NEAR_M
    autopilot.told()
    told: list[MoveProgress] = []
    done = await vehicle.fly(1, Move(path=ASIDE), told.append)
    assert (done.reached, done.collided, done.cancelled) == (True, False, False)
    assert gap_m(done.pose, 3.0, -2.0, 3.0) < NEAR_M
    north, east, _ = autopilot.told()["position"]
    assert (east, north) == (pytest.approx(3.0, abs=NEAR_M), pytest.approx(-2.0, abs=NEAR_M))
    assert done.pose.yaw == pytest.approx(-math.pi / 2, abs=0.1)
    assert done.path_m == pytest.approx(5.1, abs=1.2)
    assert [p.share for p in told] == sorted(p.share for p in told)
    assert await vehicle.fly(1, Move(path=ASIDE)) == done
    autopilot.told()
    await asyncio.sleep(1.5)  # the model thinks
    streamed = autopilot.told()
    assert (streamed["mode"], streamed["offboard_lost"]) == ("offboard", 0)
    assert streamed["longest_gap_s"] < 0.3, "twenty a second, but a machine that tests may be late"
    assert streamed["set_points"] > 20
    assert (await vehicle.land()).mode == "landed"
    assert not autopilot.told()["armed"]


async def test_a_pilot_who_moves_a_stick_has_the_drone_and_keeps_it(
    stand_in: Start, behind: Behind, client: Client
) -> None:
    autopilot = stand_in("px4")
    vehicle = await standing(client(behind(autopilot)))
    await vehicle.take_off(1.5)
    flight = await under_way(vehicle, FAR)
    autopilot.told("pilot", mode="position")
    done = await flight
    assert (done.reached, done.cancelled) == (False, False)
    assert done.vehicle.mode == "manual"
    assert done.vehicle.health.problems == ("the pilot has taken over: its mode is POSCTL",)
    assert done.pose.x > -39.0
    for refused in (vehicle.hold(), vehicle.fly(2, Move(path=ASIDE)), vehicle.land()):
        with pytest.raises(ServiceRefused) as refusal:
            await refused
        assert (refusal.value.status, refusal.value.code) == (409, "manual_control")
    assert autopilot.told()["mode"] == "position"


async def test_arducopter_streams_when_asked_takes_off_in_guided_and_stops_when_a_move_is_cancelled(
    stand_in: Start, behind: Behind, client: Client
) -> None:
    autopilot = stand_in("ardupilot")
    vehicle = await standing(client(behind(autopilot)))
    assert (await vehicle.connect()).kind == "ardupilot"
    assert (await vehicle.take_off(2.0)).mode == "holding"
    assert 511 in autopilot.told()["commands"]
    flight = await under_way(vehicle, FAR)
    flight.cancel()
    await asyncio.wait({flight})
    again = await vehicle.fly(1, FAR)
    assert (again.cancelled, again.reached) == (True, False)
    stopped = await vehicle.state()
    assert (stopped.mode, stopped.pose.x > -39.0) == ("holding", True)
    await asyncio.sleep(0.5)
    now = (await vehicle.state()).pose
    assert gap_m(now, stopped.pose.x, stopped.pose.y, stopped.pose.z) < NEAR_M
    assert (await vehicle.land()).mode == "landed"


async def test_what_an_autopilot_refuses_is_told_in_its_own_words(
    stand_in: Start, behind: Behind, client: Client
) -> None:
    autopilot = stand_in("px4")
    vehicle = await standing(client(behind(autopilot, vehicle_arms_within_s=0.0)))
    autopilot.told("faults", refuse_arming=True)
    with pytest.raises(ServiceUnreachable, match=r"refuses to arm.*resolve health failures first"):
        await vehicle.take_off(2.0)
    assert (await vehicle.state()).mode == "landed"


async def test_without_an_autopilot_the_service_says_where_it_listens(behind: Behind, client: Client) -> None:
    with StandIn() as nobody:
        address = nobody.address
    service = client(behind(nobody))
    assert f"autopilot: no autopilot was heard at {address} yet: start it" in (await service.ready() or "")
    with pytest.raises(ServiceUnreachable, match="no autopilot was heard"):
        await HttpVehicle(service, "vehicle", "/v1/vehicle").state()
