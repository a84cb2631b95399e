"""A vehicle behind the HTTP contract of `contracts.vehicle`: the simulator's episodes, an autopilot's service."""

import asyncio
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Self

from pydantic import BaseModel

from contracts.vehicle import (
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    TakeOff,
    VehicleCapabilities,
    VehicleState,
)
from mission.ports import ServiceRefused
from mission.reached import reached
from mission.vehicle import Progress
from service_kit.client import CallError, ServiceClient, TimedOut

FLIGHT_DEADLINE_S = 900.0
"""No flight takes longer."""
CALL_DEADLINE_S = 60.0
STOP_DEADLINE_S = 5.0
WATCH_EVERY_S = 0.25


class HttpVehicle:
    """`base` is the vehicle's path at the client's address: empty where the address is one vehicle's own."""

    def __init__(self, client: ServiceClient, name: str, base: str = "") -> None:
        self._client = client
        self._name = name
        self._base = base

    @classmethod
    async def at(cls, client: ServiceClient) -> Self:
        """The vehicle that the client's address is. Raises PortError."""
        state = await reached(client.call("GET", "", VehicleState))
        return cls(client, state.id)

    @property
    def name(self) -> str:
        return self._name

    async def connect(self) -> VehicleCapabilities:
        return await reached(self._client.call("GET", f"{self._base}/capabilities", VehicleCapabilities))

    async def state(self) -> VehicleState:
        return await reached(self._client.call("GET", self._base, VehicleState))

    async def take_off(self, height_m: float) -> VehicleState:
        return await self._command("take-off", TakeOff(height_m=height_m))

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        wanted = {} if cameras is None else {"cameras": ",".join(cameras)}
        wanted |= {} if depth else {"depth": "false"}
        path = f"{self._base}/observation"
        return await reached(self._client.call("GET", path, Observation, params=wanted, timeout_s=CALL_DEADLINE_S))

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        watching = asyncio.create_task(self._watch(number, progress)) if progress is not None else None
        try:
            done = await reached(self._flown(number, move))
        except asyncio.CancelledError:
            await self._cancel(number)
            raise
        finally:
            if watching is not None:
                watching.cancel()
        if progress is not None:
            progress(await reached(self._progress(number)))
        return done

    async def hold(self) -> VehicleState:
        return await self._command("hold")

    async def return_home(self) -> VehicleState:
        return await self._command("return")

    async def land(self) -> VehicleState:
        return await self._command("land")

    async def release(self) -> None:
        try:
            await reached(self._client.delete(self._base))
        except ServiceRefused as error:
            if error.status != 404:
                raise

    async def _command(self, verb: str, body: BaseModel | None = None) -> VehicleState:
        path = f"{self._base}/{verb}"
        return await reached(self._client.call("POST", path, VehicleState, body, timeout_s=FLIGHT_DEADLINE_S))

    async def _flown(self, number: int, move: Move) -> MoveResult:
        """A call that takes too long is made again, for it is one move; nobody answering at all is told at once."""
        give_up = time.monotonic() + FLIGHT_DEADLINE_S
        while True:
            try:
                path = f"{self._base}/moves/{number}"
                return await self._client.call("PUT", path, MoveResult, move, timeout_s=CALL_DEADLINE_S)
            except TimedOut:
                await self._progress(number)
                if time.monotonic() > give_up:
                    raise

    async def _progress(self, number: int) -> MoveProgress:
        return await self._client.call("GET", f"{self._base}/moves/{number}", MoveProgress)

    async def _watch(self, number: int, progress: Progress) -> None:
        while True:
            await asyncio.sleep(WATCH_EVERY_S)
            with suppress(CallError):  # the move itself tells what is wrong
                progress(await self._progress(number))

    async def _cancel(self, number: int) -> None:
        path = f"{self._base}/moves/{number}"
        with suppress(CallError):
            await self._client.call("DELETE", path, MoveResult, timeout_s=STOP_DEADLINE_S)
