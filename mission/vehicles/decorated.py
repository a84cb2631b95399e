"""Vehicles and placements that stand before others: every call goes on to the one behind, as it is. A subclass changes
the calls that it is there for."""

from collections.abc import Awaitable, Sequence
from typing import TypeVar

from contracts.geometry import Point3
from contracts.sim import Verdict
from contracts.vehicle import Move, MoveResult, Observation, VehicleCapabilities, VehicleState
from mission.placement import Placement
from mission.vehicle import Progress, Vehicle

T = TypeVar("T")


class DecoratedVehicle:
    """A vehicle before another one, with its name. Every method raises what that one raises."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    async def _awaited(self, call: Awaitable[T]) -> T:
        """How a call to the vehicle behind is awaited; its release is not asked for through here."""
        return await call

    @property
    def name(self) -> str:
        return self._vehicle.name

    async def connect(self) -> VehicleCapabilities:
        return await self._awaited(self._vehicle.connect())

    async def state(self) -> VehicleState:
        return await self._awaited(self._vehicle.state())

    async def take_off(self, height_m: float) -> VehicleState:
        return await self._awaited(self._vehicle.take_off(height_m))

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        return await self._awaited(self._vehicle.observe(cameras, depth=depth))

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        return await self._awaited(self._vehicle.fly(number, move, progress))

    async def hold(self) -> VehicleState:
        return await self._awaited(self._vehicle.hold())

    async def return_home(self) -> VehicleState:
        return await self._awaited(self._vehicle.return_home())

    async def land(self) -> VehicleState:
        return await self._awaited(self._vehicle.land())

    async def release(self) -> None:
        await self._vehicle.release()


class DecoratedPlacement:
    """A placement before another one. Every method raises what that one raises."""

    def __init__(self, placement: Placement) -> None:
        self._placement = placement

    def _before(self, vehicle: Vehicle) -> Vehicle:
        """What the mission gets instead of a vehicle of the placement behind."""
        return vehicle

    async def _awaited(self, call: Awaitable[T]) -> T:
        """How a call to the placement behind is awaited."""
        return await call

    @property
    def rig_name(self) -> str | None:
        return self._placement.rig_name

    @property
    def sensors_name(self) -> str | None:
        return self._placement.sensors_name

    async def begin(self, key: str) -> Vehicle:
        return self._before(await self._awaited(self._placement.begin(key)))

    async def resume(self, vehicle: str) -> Vehicle:
        return self._before(await self._awaited(self._placement.resume(vehicle)))

    async def renderer(self, vehicle: str) -> str | None:
        return await self._awaited(self._placement.renderer(vehicle))

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return await self._awaited(self._placement.claim(vehicle, target))
