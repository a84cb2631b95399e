"""A drone behind the stand-in autopilot, over real HTTP, real MAVSDK and real MAVLink, in a yard of the simulator."""

from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from contracts.cameras import default_rig
from contracts.sim import EpisodeQuestion, Flight
from episode_kit.limits import Limits
from mission.vehicles.simulator_trial import HeldVehicle, SimulatorTrial
from service_kit.client import ServiceClient
from services.mavlink_vehicle.bootstrap import bootstrap
from services.mavlink_vehicle.settings import MavlinkVehicleSettings
from services.sim.app import build_app
from services.sim.episodes import Episodes
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from tests.autopilot.stand_in import StandIn
from tests.conftest import Serve
from tests.services.sim.conftest import build_boxes, make_yard
from tests.services.sim.running_sim import CATALOGUE

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
def simulator(serve: Serve) -> str:
    renderer = RenderThread(choose_renderer)
    return serve(build_app(Episodes(build_boxes, renderer, Limits(max_episodes=100)), renderer, CATALOGUE))


@pytest.fixture
def behind(serve: Serve, simulator: str) -> Callable[..., str]:
    """`behind(stand_in)`: the address of the service that flies it."""

    def start(autopilot: StandIn, **more: Any) -> str:
        settings = MavlinkVehicleSettings(autopilot=autopilot.address, sim_url=simulator, **(SETTINGS | more))
        return serve(bootstrap(settings))

    return start


@pytest.fixture
async def client() -> AsyncIterator[Callable[[str], ServiceClient]]:
    """`client(url)`; all are closed with the test."""
    opened: list[ServiceClient] = []

    def open_(url: str) -> ServiceClient:
        opened.append(ServiceClient("mavlink_vehicle", url, timeout_s=60.0, patience_s=10.0))
        return opened[-1]

    yield open_
    for one in opened:
        await one.close()


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
