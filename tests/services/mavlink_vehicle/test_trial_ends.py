"""How trials end: before they have begun, during a move, forgotten by the simulator; a drone and a simulator of this
process that do what they are told at once."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.responses import JSONResponse

from contracts.cameras import default_rig
from contracts.geometry import Point3, Pose
from contracts.sim import Episode, EpisodeQuestion
from contracts.vehicle import Battery, Health, Move, VehicleState
from service_kit.client import ServiceClient
from service_kit.errors import NotFound
from services.mavlink_vehicle.simulator import Simulator
from services.mavlink_vehicle.trial import Terms, Trials
from services.mavlink_vehicle.vehicle import Vehicle
from tests.conftest import Serve
from tests.services.mavlink_vehicle.obedient import LIMITS, ObedientLink, flying
from tests.services.sim.conftest import make_yard

QUESTION = EpisodeQuestion(scene=make_yard(), rig=default_rig().scaled_to(64), key="k", owner="o")
STATE = VehicleState(
    id="scene",
    mode="landed",
    pose=Pose(x=0.0, y=0.0, z=0.0, yaw=0.0),
    battery=Battery(remaining=1.0, reserve=0.2),
    health=Health(ok=True),
    moves=0,
    path_m=0.0,
    path_horizontal_m=0.0,
    flight_s=0.0,
    collided=False,
    time_s=0.0,
)
EPISODE = Episode(
    id="scene",
    status="flying",
    scene="yard",
    renderer="tiny",
    renderer_detail="none",
    flight=QUESTION.flight,
    rig="rig",
    sensors="perfect",
    lease_s=60.0,
    expires_in_s=60.0,
    vehicle=STATE,
)


class Yard:
    """A simulator that draws nothing. `draws`: it answers a beginning; `poses`: how it answers poses, a status."""

    def __init__(self) -> None:
        self.draws = True
        self.asked = threading.Event()
        self.poses = 200
        self.ended: list[str] = []
        self.app = FastAPI()
        self.app.post("/v1/episodes", status_code=201)(self._begin)
        self.app.put("/v1/episodes/{name}/pose")(self._put)
        self.app.delete("/v1/episodes/{name}", status_code=204)(self._end)
        self.app.delete("/v1/episodes", status_code=204)(self._free)

    async def _begin(self) -> dict[str, Any]:
        self.asked.set()
        if not self.draws:
            await asyncio.sleep(60.0)
        return EPISODE.model_dump(mode="json")

    async def _put(self, name: str) -> JSONResponse:
        if self.poses != 200:
            return JSONResponse({"error": {"code": "c", "message": "not today", "details": {}}}, self.poses)
        return JSONResponse({"collided": False, "hit": None})

    async def _end(self, name: str) -> None:
        self.ended.append(name)

    async def _free(self, key: str) -> None:
        self.ended.append(key)


@asynccontextmanager
async def trials_in(yard: Yard, serve: Serve) -> AsyncIterator[tuple[Trials, Vehicle]]:
    """A vehicle whose trials that yard draws."""
    simulator = Simulator(ServiceClient("sim", serve(yard.app), timeout_s=5.0))
    async with flying(ObedientLink()) as vehicle:
        trials = Trials(vehicle, simulator, Terms(LIMITS, 0.2, 60.0))
        try:
            yield trials, vehicle
        finally:
            await trials.close()


async def until(true: Callable[[], bool]) -> None:
    async with asyncio.timeout(30):
        while True:
            if true():
                return
            await asyncio.sleep(0.02)


async def test_a_trial_that_is_ended_while_it_is_begun_says_so_and_leaves_nothing_in_the_simulator(
    serve: Serve,
) -> None:
    yard = Yard()
    yard.draws = False
    async with trials_in(yard, serve) as (trials, _):
        asked = asyncio.create_task(trials.begin(QUESTION))
        await until(yard.asked.is_set)
        await trials.free("k")
        with pytest.raises(NotFound, match="ended before it had begun"):
            await asked
        assert len(yard.ended) == 1
        yard.draws = True
        assert (await trials.begin(QUESTION)).id == "scene"


async def test_a_trial_that_ends_during_a_move_answers_it_and_the_drone_lands(serve: Serve) -> None:
    yard = Yard()
    async with trials_in(yard, serve) as (trials, vehicle):
        await trials.begin(QUESTION)
        await vehicle.take_off(2.0)
        start = vehicle.state().pose
        far = Move(path=(Point3(x=start.x + 600.0, y=start.y, z=start.z),))
        flight = asyncio.create_task(vehicle.move(1, far))
        await until(lambda: vehicle.state().mode == "moving" and vehicle.state().path_m > 2.5)
        await trials.end("scene")
        assert (await flight).cancelled
        await until(lambda: vehicle.state().mode == "landed")
        assert (vehicle.state().id, vehicle.state().moves, yard.ended) == ("vehicle", 0, ["scene"])


async def test_a_scene_that_the_simulator_has_forgotten_ends_the_trial_and_the_drone_is_its_own_again(
    serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    yard = Yard()
    async with trials_in(yard, serve) as (trials, vehicle):
        await trials.begin(QUESTION)
        yard.poses = 409
        await vehicle.take_off(2.0)
        await until(lambda: "the simulator does not judge" in caplog.text)
        yard.poses = 404
        await until(lambda: vehicle.state().mode == "landed")
        assert vehicle.state().id == "vehicle"
        with pytest.raises(NotFound):
            trials.found("scene")
