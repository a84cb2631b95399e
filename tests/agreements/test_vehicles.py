"""Every vehicle there is keeps the same agreement, and so does every trial. A new one is one more entry of its list."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from uuid import uuid4

import pytest

from contracts.cameras import default_rig
from contracts.geometry import Point3
from contracts.scene import Scene
from contracts.sim import EpisodeQuestion, Flight
from episode_kit.limits import Limits
from mission.ports import ServiceRefused
from mission.trajectory import TrajectoryWriter
from mission.vehicle import Trial
from mission.vehicles.agreement import CHECKS, Candidate, Check
from mission.vehicles.http_vehicle import HttpVehicle
from mission.vehicles.recorded import RecordedVehicle
from mission.vehicles.simulator_trial import SimulatorTrial
from service_kit.client import ServiceClient
from services.sim.app import build_app
from services.sim.episodes import Episodes
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from tests.conftest import Serve
from tests.mission.block import Block, block_scene
from tests.mission.block_vehicle import BlockWorld
from tests.services.sim.conftest import build_boxes, make_yard
from tests.services.sim.running_sim import CATALOGUE

PACE = 0.25
RIG = default_rig().scaled_to(64)
AS_WATCHED = Flight(pace=PACE)
WAY = tuple(Point3(x=x, y=-15.0, z=z) for x, z in ((0.0, 3.0), (-20.0, 3.0)))
"""From the start of both worlds; some seven seconds of flight."""


class Judged(NamedTuple):
    """A trial, and a scene that it can begin."""

    trial: Trial
    scene: Scene


@pytest.fixture(scope="module")
def simulator(serve: Serve) -> str:
    renderer = RenderThread(choose_renderer)
    episodes = Episodes(build_boxes, renderer, Limits(max_episodes=100))
    return serve(build_app(episodes, renderer, CATALOGUE))


@asynccontextmanager
async def simulator_trial(simulator: str) -> AsyncIterator[Judged]:
    async with ServiceClient("sim", simulator) as client:
        yield Judged(SimulatorTrial(client), make_yard())


@asynccontextmanager
async def block_trial(simulator: str) -> AsyncIterator[Judged]:
    block = Block()
    yield Judged(BlockWorld(block, pace=PACE), block_scene(block))


TRIALS: dict[str, Callable[[str], AbstractAsyncContextManager[Judged]]] = {
    "simulator": simulator_trial,
    "block world": block_trial,
}


@asynccontextmanager
async def simulated_vehicle(simulator: str) -> AsyncIterator[Candidate]:
    async with simulator_trial(simulator) as judged:
        yield Candidate(await begun(judged), WAY)


@asynccontextmanager
async def vehicle_at_its_own_address(simulator: str) -> AsyncIterator[Candidate]:
    async with simulator_trial(simulator) as judged:
        name = (await begun(judged)).name
        async with ServiceClient("vehicle", f"{simulator}/v1/episodes/{name}") as client:
            yield Candidate(await HttpVehicle.at(client), WAY)


@asynccontextmanager
async def block_vehicle(simulator: str) -> AsyncIterator[Candidate]:
    async with block_trial(simulator) as judged:
        yield Candidate(await begun(judged), WAY, near_m=0.12)


@asynccontextmanager
async def recorded_vehicle(simulator: str) -> AsyncIterator[Candidate]:
    async with block_vehicle(simulator) as candidate:
        with TemporaryDirectory() as folder, TrajectoryWriter(Path(folder) / "trajectory") as trajectory:
            yield replace(candidate, vehicle=RecordedVehicle(candidate.vehicle, trajectory))


VEHICLES: dict[str, Callable[[str], AbstractAsyncContextManager[Candidate]]] = {
    "simulator": simulated_vehicle,
    "any address": vehicle_at_its_own_address,
    "block world": block_vehicle,
    "recorded": recorded_vehicle,
}


def asked(scene: Scene, key: str) -> EpisodeQuestion:
    return EpisodeQuestion(scene=scene, flight=AS_WATCHED, rig=RIG, key=key)


async def begun(judged: Judged, key: str = "") -> Any:
    return await judged.trial.begin(asked(judged.scene, key or f"key-{uuid4().hex}"))


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
async def test_vehicle(name: str, check: Check, simulator: str) -> None:
    async with VEHICLES[name](simulator) as candidate:
        await check(candidate)


@pytest.mark.parametrize("name", TRIALS)
async def test_the_same_key_is_the_same_vehicle_and_it_can_be_resumed_by_name(name: str, simulator: str) -> None:
    async with TRIALS[name](simulator) as judged:
        first, again = await begun(judged, "k1"), await begun(judged, "k1")
        assert first.name == again.name
        other = await begun(judged, "k2")
        assert other.name != first.name
        resumed = await judged.trial.resume(first.name)
        assert await resumed.state() == await first.state()
        assert await judged.trial.renderer(first.name)
        for vehicle in (first, other):
            await vehicle.release()


@pytest.mark.parametrize("name", TRIALS)
async def test_the_first_claim_counts_and_the_vehicle_may_still_go_home(name: str, simulator: str) -> None:
    async with TRIALS[name](simulator) as judged:
        vehicle = await begun(judged)
        first = await judged.trial.claim(vehicle.name, None)
        assert first.judged
        assert not first.delivered
        assert await judged.trial.claim(vehicle.name, Point3(x=3.0, y=-6.2, z=10.5)) == first
        assert (await vehicle.return_home()).mode == "holding"
        assert (await vehicle.land()).mode == "landed"


@pytest.mark.parametrize("name", TRIALS)
async def test_what_is_released_is_gone(name: str, simulator: str) -> None:
    async with TRIALS[name](simulator) as judged:
        vehicle = await begun(judged)
        await vehicle.release()
        await vehicle.release()
        for gone in (vehicle.state(), vehicle.observe(), judged.trial.resume(vehicle.name)):
            with pytest.raises(ServiceRefused) as refusal:
                await gone
            assert refusal.value.status == 404


async def test_a_trial_that_is_no_longer_waited_for_is_not_kept(simulator: str) -> None:
    async with simulator_trial(simulator) as judged:
        scene = judged.scene.model_copy(update={"seed": 77})  # a new one: it takes a moment to build
        beginning = asyncio.create_task(judged.trial.begin(asked(scene, "given-up")))
        await asyncio.sleep(0.01)
        beginning.cancel()
        await asyncio.wait({beginning})
        assert beginning.cancelled()
        # the key is free again once nothing is kept under it: another question may have it
        other = None
        async with asyncio.timeout(30):
            while other is None:
                with suppress(ServiceRefused):
                    other = await judged.trial.begin(asked(judged.scene, "given-up"))
                await asyncio.sleep(0.02)
        await other.release()
