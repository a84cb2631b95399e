"""A vehicle behind the HTTP contract: a point that flies in real time through empty air, and sees nothing.

`PORT=8200 python -m vln_extras.point_vehicle` serves it; its base address is the service's own.
"""

import asyncio
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from fastapi import FastAPI, Query, Response

from contracts.cameras import default_rig
from contracts.geometry import Point3, Pose
from contracts.images import encode_depth, encode_jpeg
from contracts.vehicle import (
    FlightMode,
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    SensedView,
    TakeOff,
    VehicleCapabilities,
    VehicleState,
)
from service_kit.app import create_app
from service_kit.errors import BadQuestion, Conflict, NotFound
from service_kit.run import main
from service_kit.settings import ServiceSettings

SPEED_M_S = 4.0
TICK_S = 0.02
HOME = Pose(x=0.0, y=0.0, z=0.0, yaw=math.pi / 2)


@dataclass
class Flight:
    """A numbered move under way, or flown: `task` brings its result."""

    move: Move
    task: "asyncio.Task[MoveResult]"
    length_m: float
    flown_m: float = 0.0
    stopped: bool = False


class PointVehicle:
    """One vehicle; between missions it stands at home again."""

    def __init__(self) -> None:
        self._rig = default_rig().scaled_to(64)
        self._observations = 0
        self.reset()

    def reset(self) -> None:
        self._pose = HOME
        self._mode: FlightMode = "landed"
        self._flights: dict[int, Flight] = {}
        self._path_m = self._level_m = self._flight_s = 0.0

    @property
    def capabilities(self) -> VehicleCapabilities:
        return VehicleCapabilities(
            kind="point",
            cameras=self._rig.cameras,
            radius_m=0.1,
            max_speed_m_s=SPEED_M_S,
            cancels_moves=True,
            lands=True,
        )

    @property
    def state(self) -> VehicleState:
        return VehicleState(
            id="point",
            mode=self._mode,
            pose=self._pose,
            moves=len(self._flights),
            path_m=self._path_m,
            path_horizontal_m=self._level_m,
            flight_s=self._flight_s,
            collided=False,
        )

    def observe(self, cameras: list[str] | None, *, depth: bool) -> Observation:
        """Grey pictures, and nothing within any depth camera's reach. Raises BadQuestion."""
        carried = {camera.name: camera for camera in self._rig.cameras}
        unknown = sorted(set(cameras or ()) - set(carried))
        if unknown:
            raise BadQuestion(f"there is no camera {', '.join(unknown)}; there are {', '.join(carried)}")
        self._observations += 1
        views = tuple(
            SensedView(
                camera=carried[name],
                image=encode_jpeg(np.full((carried[name].height, carried[name].width, 3), 128, np.uint8)),
                depth=encode_depth(np.full((carried[name].height, carried[name].width), np.inf)) if depth else None,
            )
            for name in (cameras or carried)
        )
        return Observation(vehicle="point", number=self._observations, pose=self._pose, views=views)

    async def fly(self, number: int, move: Move) -> MoveResult:
        """The same number and move again waits for the same result. Raises Conflict."""
        flight = self._flights.get(number)
        if flight is None:
            flight = self._begin(number, move)
        if flight.move != move:
            raise Conflict(f"move {number} was another one; the next number is {len(self._flights) + 1}")
        return await asyncio.shield(flight.task)  # a caller that leaves does not end the flight

    def progress(self, number: int) -> MoveProgress:
        """Raises NotFound."""
        flight = self._flight(number)
        state: Literal["flying", "done", "cancelled"] = "flying"
        if flight.task.done():
            state = "cancelled" if flight.stopped else "done"
        share = 1.0 if state == "done" else min(1.0, flight.flown_m / max(flight.length_m, 1e-9))
        return MoveProgress(number=number, state=state, pose=self._pose, share=share)

    async def stop(self, number: int) -> MoveResult:
        """Raises NotFound."""
        flight = self._flight(number)
        flight.stopped = flight.stopped or not flight.task.done()
        return await asyncio.shield(flight.task)

    async def hold(self) -> VehicleState:
        if self._mode == "moving":
            await self.stop(len(self._flights))
        return self.state

    async def take_off(self, height_m: float) -> VehicleState:
        if self._mode == "landed":
            self._mode, self._pose = "holding", self._pose.model_copy(update={"z": self._pose.z + height_m})
        return self.state

    async def home(self) -> VehicleState:
        await self.hold()
        if self._mode == "holding":
            self._pose = self._pose.model_copy(update={"x": HOME.x, "y": HOME.y})
        return self.state

    async def land(self) -> VehicleState:
        await self.hold()
        self._mode, self._pose = "landed", self._pose.model_copy(update={"z": HOME.z})
        return self.state

    def _flight(self, number: int) -> Flight:
        if number not in self._flights:
            raise NotFound(f"there is no move {number}; {len(self._flights)} were begun")
        return self._flights[number]

    def _begin(self, number: int, move: Move) -> Flight:
        if number != len(self._flights) + 1:
            raise Conflict(f"the next number is {len(self._flights) + 1}, not {number}")
        if self._mode != "holding":
            raise Conflict(f"the vehicle is {self._mode}; it moves while it is holding")
        corners: list[Pose | Point3] = [self._pose, *move.path]
        length_m = sum(_gap_m(a, b) for a, b in pairwise(corners))
        self._mode = "moving"
        flight = self._flights[number] = Flight(move, asyncio.create_task(self._follow(number, move)), length_m)
        return flight

    async def _follow(self, number: int, move: Move) -> MoveResult:
        await asyncio.sleep(0)  # until the flight is listed
        flight, before_s = self._flights[number], self._flight_s
        for corner in move.path:
            while not flight.stopped and (left_m := _gap_m(self._pose, corner)) > 0.0:
                self._advance(flight, corner, min(1.0, SPEED_M_S * TICK_S / left_m))
                await asyncio.sleep(TICK_S)
        if not flight.stopped:
            self._pose = self._pose.model_copy(update={"yaw": move.yaw if move.yaw is not None else self._pose.yaw})
        self._mode = "holding"
        return MoveResult(
            number=number,
            pose=self._pose,
            reached=not flight.stopped,
            cancelled=flight.stopped,
            collided=False,
            path_m=flight.flown_m,
            flight_s=self._flight_s - before_s,
            vehicle=self.state,
        )

    def _advance(self, flight: Flight, corner: Point3, share: float) -> None:
        here = self._pose
        x, y, z = (a + share * (b - a) for a, b in ((here.x, corner.x), (here.y, corner.y), (here.z, corner.z)))
        yaw = math.atan2(corner.y - here.y, corner.x - here.x) if (x, y) != (here.x, here.y) else here.yaw
        there = corner if share == 1.0 else Point3(x=x, y=y, z=z)
        self._pose = Pose(x=there.x, y=there.y, z=there.z, yaw=yaw)
        step_m = _gap_m(here, self._pose)
        flight.flown_m += step_m
        self._path_m += step_m
        self._level_m += math.dist((here.x, here.y), (self._pose.x, self._pose.y))
        self._flight_s += step_m / SPEED_M_S


def _gap_m(a: Pose | Point3, b: Pose | Point3) -> float:
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))


def build_app(vehicle: PointVehicle) -> FastAPI:
    """The contract's routes; `contracts.vehicle` lists them."""
    app = create_app("point_vehicle", max_body_bytes=64 * 1024)

    @app.get("/")
    async def state() -> VehicleState:
        return vehicle.state

    @app.get("/capabilities")
    async def capabilities() -> VehicleCapabilities:
        return vehicle.capabilities

    @app.get("/observation")
    async def observation(cameras: Annotated[str | None, Query()] = None, depth: bool = True) -> Observation:
        return vehicle.observe(cameras.split(",") if cameras else None, depth=depth)

    @app.put("/moves/{number}")
    async def fly(number: int, move: Move) -> MoveResult:
        return await vehicle.fly(number, move)

    @app.get("/moves/{number}")
    async def progress(number: int) -> MoveProgress:
        return vehicle.progress(number)

    @app.delete("/moves/{number}")
    async def stop(number: int) -> MoveResult:
        return await vehicle.stop(number)

    @app.post("/take-off")
    async def take_off(wanted: TakeOff) -> VehicleState:
        return await vehicle.take_off(wanted.height_m)

    @app.post("/hold")
    async def hold() -> VehicleState:
        return await vehicle.hold()

    @app.post("/return")
    async def home() -> VehicleState:
        return await vehicle.home()

    @app.post("/land")
    async def land() -> VehicleState:
        return await vehicle.land()

    @app.delete("/", status_code=204)
    async def release() -> Response:
        await vehicle.hold()
        vehicle.reset()
        return Response(status_code=204)

    return app


if __name__ == "__main__":
    main("point_vehicle", ServiceSettings, lambda settings: build_app(PointVehicle()))
