"""Trials in software in the loop: the stand-in's drone in a yard that a real simulator draws and judges."""

import math
from collections.abc import Callable

import pytest

from contracts.geometry import Point3
from contracts.vehicle import Move
from mission.ports import ServiceRefused, ServiceUnreachable
from mission.vehicles.simulator_trial import SimulatorTrial
from service_kit.client import ServiceClient
from tests.autopilot.stand_in import StandIn
from tests.services.mavlink_vehicle.conftest import begun
from tests.services.sim.conftest import make_yard

NEAR_M = 0.7
START = make_yard().start
Client = Callable[[str], ServiceClient]
pytestmark = pytest.mark.slow


async def test_a_scene_is_laid_about_the_drone_where_it_stands_and_it_sees_and_hits_what_is_there(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client, simulator: str
) -> None:
    service = client(behind(stand_in("px4", yaw=2.0), sim_url=simulator))
    async with begun(service) as vehicle:
        stands = await vehicle.state()
        assert (stands.mode, stands.health.problems) == ("landed", ())
        assert math.dist((stands.pose.x, stands.pose.y), (START.position.x, START.position.y)) < NEAR_M
        assert stands.pose.yaw == pytest.approx(START.yaw, abs=0.05)
        risen = await vehicle.take_off(2.0)
        assert risen.pose.z == pytest.approx(stands.pose.z + 2.0, abs=NEAR_M)
        seen = await vehicle.observe(["front"])
        assert seen.views[0].depth is not None
        assert math.dist((seen.pose.x, seen.pose.y, seen.pose.z), (risen.pose.x, risen.pose.y, risen.pose.z)) < NEAR_M
        done = await vehicle.fly(1, Move(path=(Point3(x=0.0, y=0.0, z=2.4),)))
        assert (done.reached, done.collided, done.hit) == (False, True, "house")
        assert (await vehicle.state()).collided
        verdict = await SimulatorTrial(service).claim(vehicle.name, None)
        assert (verdict.collided, verdict.delivered) == (True, False)
        assert await SimulatorTrial(service).claim(vehicle.name, Point3(x=0.0, y=0.0, z=0.0)) == verdict


async def test_one_drone_flies_one_trial_at_a_time_and_lands_when_it_is_over(
    stand_in: Callable[..., StandIn], behind: Callable[..., str], client: Client, simulator: str
) -> None:
    autopilot = stand_in("px4")
    service = client(behind(autopilot, sim_url=simulator))
    async with begun(service, "one") as vehicle, begun(service, "one") as again:
        assert again.name == vehicle.name
        await vehicle.take_off(1.5)
        with pytest.raises(ServiceUnreachable, match="one at a time"):
            async with begun(service, "two"):
                pass
    with pytest.raises(ServiceRefused) as gone:
        await vehicle.state()
    assert gone.value.status == 404
    async with begun(service, "two") as other:
        assert (await other.state()).mode == "landed"
        assert (await other.state()).moves == 0
    assert not autopilot.told()["armed"]
