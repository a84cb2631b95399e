"""A trial's vehicle holds its episode by the lease."""

import asyncio
import gc
from collections.abc import Callable

import pytest

from contracts.cameras import default_rig
from contracts.sim import EpisodeQuestion
from episode_kit.limits import Limits
from mission.vehicles.http_vehicle import HttpVehicle
from mission.vehicles.simulator_trial import SimulatorTrial
from service_kit.client import ServiceClient
from services.sim.app import build_app
from services.sim.episodes import Episodes
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from tests.conftest import Serve
from tests.services.sim.conftest import build_boxes, make_yard
from tests.services.sim.running_sim import CATALOGUE

LEASE_S = 0.6


class Sim:
    def __init__(self, serve: Serve) -> None:
        renderer = RenderThread(choose_renderer)
        self.episodes = Episodes(build_boxes, renderer, Limits(lease_s=LEASE_S))
        self.url = serve(build_app(self.episodes, renderer, CATALOGUE))

    async def begin(self, client: ServiceClient, key: str) -> HttpVehicle:
        question = EpisodeQuestion(scene=make_yard(), rig=default_rig().scaled_to(64), key=key)
        return await SimulatorTrial(client).begin(question)


@pytest.fixture
def sim(serve: Serve) -> Sim:
    return Sim(serve)


async def until(condition: Callable[[], bool]) -> None:
    for _ in range(1_500):
        if condition():
            return
        await asyncio.sleep(0.02)
    raise AssertionError("it has not come within 30 s")


async def test_an_episode_is_held_while_a_model_thinks_and_freed_when_its_mission_is_gone(sim: Sim) -> None:
    async with ServiceClient("sim", sim.url) as client:
        vehicle = await sim.begin(client, "thoughtful")
        await asyncio.sleep(3 * LEASE_S)
        assert (await vehicle.state()).moves == 0
        del vehicle
        gc.collect()
        await until(lambda: sim.episodes.live == 0)


async def test_another_process_takes_the_lease_over(sim: Sim) -> None:
    async with ServiceClient("sim", sim.url) as client:
        vehicle = await sim.begin(client, "carried-on")
        other = await SimulatorTrial(client).resume(vehicle.name)
        del vehicle
        await asyncio.sleep(3 * LEASE_S)
        assert (await other.state()).moves == 0
        await other.release()
        assert sim.episodes.live == 0
