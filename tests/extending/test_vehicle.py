"""A vehicle from a package outside the tree, in its own process: it keeps the agreement that every vehicle keeps."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from contracts.geometry import Point3
from contracts.orchestrator import MissionSettings
from mission.mission import Mission
from mission.placement import OwnVehicle
from mission.vehicles.agreement import CHECKS, Candidate, Check
from mission.vehicles.http_vehicle import HttpVehicle
from service_kit.client import ServiceClient
from tests.load.processes import Running, service
from tests.mission.box_world import BlockWorld, block_ports
from tests.mission.test_mission import Events

WAY = (Point3(x=4.0, y=0.0, z=2.0), Point3(x=4.0, y=4.0, z=2.0))
"""Two seconds of flight from where it is after taking off."""


@pytest.fixture(scope="module")
def running(extras: Path) -> Iterator[Running]:
    with service("vln_extras.point_vehicle", {"PYTHONPATH": str(extras)}) as process:
        yield process


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
async def test_the_point_vehicle(check: Check, running: Running) -> None:
    async with ServiceClient("vehicle", running.url) as client:
        vehicle = await HttpVehicle.at(client)
        try:
            await check(Candidate(vehicle, WAY))
        finally:
            await vehicle.release()


async def test_a_mission_flies_it_and_says_in_words_why_it_ends(running: Running) -> None:
    log = Events()
    async with ServiceClient("vehicle", running.url) as client:
        placement = OwnVehicle(await HttpVehicle.at(client))
        mission = Mission(block_ports(BlockWorld()), placement, MissionSettings(), log)
        result = await mission.fly("Please come to floor 4, the window with the green flower pot")
        assert (await placement.vehicle.state()).mode == "landed"
    assert (result.outcome, result.verdict) == ("no_building", None)
    assert "no building stands about the drone" in result.message
    (placed,) = log.of("placed")
    assert (placed.data.vehicle, placed.data.vehicle_kind) == ("point", "point")
