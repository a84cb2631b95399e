"""A drone behind either autopilot keeps what every vehicle keeps; its set-points never pause while a model thinks."""

import asyncio
from collections.abc import Callable

import pytest

from contracts.geometry import Point3
from contracts.vehicle import Move
from mission.vehicles.agreement import CHECKS, Candidate, Check
from service_kit.client import ServiceClient
from tests.autopilot.stand_in import StandIn
from tests.services.mavlink_vehicle.conftest import begun, standing

WAY = (Point3(x=0.0, y=-15.0, z=3.0), Point3(x=-12.0, y=-15.0, z=3.0))
NEAR_M = 0.8
THINKS_S = 30.0
Client = Callable[[str], ServiceClient]
pytestmark = pytest.mark.slow


@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
async def test_vehicle(
    firmware: str,
    check: Check,
    stand_in: Callable[..., StandIn],
    behind: Callable[..., str],
    client: Client,
    simulator: str,
) -> None:
    service = client(behind(stand_in(firmware, yaw=1.0), sim_url=simulator))
    async with begun(service) as vehicle:
        await check(Candidate(vehicle, WAY, NEAR_M))


async def test_set_points_never_pause_while_a_model_takes_half_a_minute(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client
) -> None:
    autopilot = stand_in("px4")
    vehicle = await standing(client(behind(autopilot)))
    await vehicle.take_off(2.0)
    await vehicle.fly(1, Move(path=(Point3(x=2.0, y=0.0, z=2.0),)))
    autopilot.told()
    await asyncio.sleep(THINKS_S)
    streamed = autopilot.told()
    assert (streamed["mode"], streamed["offboard_lost"]) == ("offboard", 0)
    assert streamed["set_points"] >= 18 * THINKS_S
    assert streamed["longest_gap_s"] <= 0.1
    await vehicle.land()
