"""A vehicle in CARLA keeps to what every vehicle keeps to."""

from collections.abc import AsyncIterator
from uuid import uuid4

import httpx
import pytest

from contracts.cameras import default_rig
from contracts.geometry import Point3
from contracts.sim import EpisodeQuestion, Flight
from mission.ports import ServiceRefused, ServiceUnreachable
from mission.vehicles.agreement import CHECKS, Candidate, Check
from mission.vehicles.simulator_trial import SimulatorTrial
from service_kit.client import ServiceClient
from tests.services.sim.conftest import make_yard

pytestmark = pytest.mark.carla
WAY = tuple(Point3(x=x, y=-15.0, z=z) for x, z in ((0.0, 3.0), (-20.0, 3.0)))


def question(pace: float = 0.0, key: str | None = None) -> EpisodeQuestion:
    rig = default_rig().scaled_to(64)
    return EpisodeQuestion(scene=make_yard(), flight=Flight(pace=pace), rig=rig, key=key or f"key-{uuid4().hex}")


@pytest.fixture
async def trial(http: httpx.Client) -> AsyncIterator[SimulatorTrial]:
    async with ServiceClient("carla_world", str(http.base_url).rstrip("/")) as client:
        yield SimulatorTrial(client)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
async def test_vehicle(check: Check, trial: SimulatorTrial) -> None:
    vehicle = await trial.begin(question(pace=0.25))
    try:
        await check(Candidate(vehicle, WAY))
    finally:
        await vehicle.release()


async def test_the_same_key_is_the_same_vehicle_and_there_is_room_for_one(trial: SimulatorTrial) -> None:
    asked = question(key="one")
    first, again = await trial.begin(asked), await trial.begin(asked)
    assert first.name == again.name
    assert await trial.renderer(first.name) == "carla"
    with pytest.raises(ServiceUnreachable, match="too_many_episodes"):
        await trial.begin(question(key="two"))
    resumed = await trial.resume(first.name)
    assert await resumed.state() == await first.state()
    await first.release()
    second = await trial.begin(question(key="two"))
    assert second.name != first.name
    await second.release()


async def test_the_first_claim_counts_and_the_vehicle_may_still_go_home(trial: SimulatorTrial) -> None:
    vehicle = await trial.begin(question())
    first = await trial.claim(vehicle.name, None)
    assert first.judged
    assert not first.delivered
    assert await trial.claim(vehicle.name, Point3(x=3.0, y=-6.2, z=10.5)) == first
    assert (await vehicle.return_home()).mode == "holding"
    assert (await vehicle.land()).mode == "landed"
    await vehicle.release()


async def test_what_is_released_is_gone(trial: SimulatorTrial) -> None:
    vehicle = await trial.begin(question())
    await vehicle.release()
    await vehicle.release()
    for gone in (vehicle.state(), vehicle.observe(), trial.resume(vehicle.name)):
        with pytest.raises(ServiceRefused) as refusal:
            await gone
        assert refusal.value.status == 404
