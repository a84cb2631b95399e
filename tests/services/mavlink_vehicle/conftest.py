"""A drone behind the stand-in autopilot, over real HTTP, real MAVSDK and real MAVLink, in a yard of the simulator."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from typing import Any

import pytest

from contracts.cameras import default_rig
from contracts.sim import EpisodeQuestion, Flight
from launcher.processes import Processes, free_ports
from mission.ports import ServiceUnreachable
from mission.vehicles.http_vehicle import HttpVehicle
from mission.vehicles.simulator_trial import HeldVehicle, SimulatorTrial
from service_kit.client import ServiceClient
from service_kit.settings import process_environment
from services.mavlink_vehicle.bootstrap import bootstrap
from services.mavlink_vehicle.settings import MavlinkVehicleSettings
from tests.autopilot.stand_in import StandIn
from tests.conftest import Serve
from tests.services.sim.conftest import make_yard

QUICK = Flight(max_speed_m_s=8.0, max_acceleration_m_s2=4.0, max_yaw_rate_rad_s=1.2)
SETTINGS = {"vehicle_max_speed_m_s": 8.0, "vehicle_max_acceleration_m_s2": 4.0, "vehicle_max_yaw_rate_deg_s": 90.0}


@pytest.fixture
def stand_in() -> Iterator[Callable[..., StandIn]]:
    """`stand_in(firmware)` starts one; all end with the test."""
    running: list[StandIn] = []

    def start(firmware: str = "px4", **more: Any) -> StandIn:
        running.append(StandIn(firmware, **more))
        return running[-1]

    yield start
    for one in running:
        one.stop()


@pytest.fixture(scope="module")
def simulator(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A real simulator, in a process of its own: building a scene would keep MAVSDK's threads from their turns."""
    folder = tmp_path_factory.mktemp("simulator")
    group = Processes(free_ports(["sim"]), folder, environment=process_environment())
    group.start()
    asyncio.run(group.ready())
    yield group.children[0].url
    group.stop()


@pytest.fixture
def behind(serve: Serve) -> Callable[..., str]:
    """`behind(stand_in)`: the address of the service that flies it."""

    def start(autopilot: StandIn, **more: Any) -> str:
        return serve(bootstrap(MavlinkVehicleSettings(autopilot=autopilot.address, **(SETTINGS | more))))

    return start


@pytest.fixture
async def client() -> AsyncIterator[Callable[[str], ServiceClient]]:
    """`client(url)`; all are closed with the test."""
    opened: list[ServiceClient] = []

    def open_(url: str) -> ServiceClient:
        opened.append(ServiceClient("mavlink_vehicle", url, timeout_s=60.0))
        return opened[-1]

    yield open_
    for one in opened:
        await one.close()


async def standing(client: ServiceClient) -> HttpVehicle:
    """The vehicle at that address, once it says that it is ready."""
    vehicle = HttpVehicle(client, "vehicle", "/v1/vehicle")
    async with asyncio.timeout(120):
        while True:
            with suppress(ServiceUnreachable):  # it has not said yet where it is
                if (await vehicle.state()).health.ok:
                    return vehicle
            await asyncio.sleep(0.05)


@asynccontextmanager
async def begun(client: ServiceClient, key: str = "k") -> AsyncIterator[HeldVehicle]:
    """A trial in the yard."""
    question = EpisodeQuestion(scene=make_yard(), flight=QUICK, rig=default_rig().scaled_to(64), key=key)
    vehicle = await SimulatorTrial(client).begin(question)
    assert isinstance(vehicle, HeldVehicle)
    try:
        yield vehicle
    finally:
        await vehicle.release()
