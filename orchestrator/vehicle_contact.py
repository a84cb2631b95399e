"""Whether a flight's vehicle can still be reached: noted at every call that is made to it anyway."""

from collections.abc import Awaitable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from contracts.geometry import Point3
from contracts.sim import Verdict
from contracts.vehicle import Move, MoveResult, Observation, VehicleCapabilities, VehicleState
from mission.placement import Placement
from mission.ports import ServiceRefused, ServiceUnreachable
from mission.vehicle import Progress, Vehicle

T = TypeVar("T")


@dataclass
class Contact:
    """Whether the vehicle at hand can still be reached: `lost` says why not. `gone`: it answers for itself no more,
    and never will."""

    lost: str | None = None
    gone: bool = False

    async def keeps(self, call: Awaitable[T]) -> T:
        """Awaits a call to the vehicle, and notes what it says of the vehicle. Raises PortError."""
        try:
            answer = await call
        except ServiceUnreachable as error:
            self.lost = str(error)
            raise
        except ServiceRefused as error:
            if error.status == 404:
                self.lost, self.gone = str(error), True
            raise
        self.lost = None
        return answer


class WatchedVehicle:
    """A vehicle whose calls tell a `Contact` how it fares."""

    def __init__(self, vehicle: Vehicle, contact: Contact) -> None:
        self._vehicle = vehicle
        self._contact = contact

    @property
    def name(self) -> str:
        return self._vehicle.name

    async def connect(self) -> VehicleCapabilities:
        return await self._contact.keeps(self._vehicle.connect())

    async def state(self) -> VehicleState:
        return await self._contact.keeps(self._vehicle.state())

    async def take_off(self, height_m: float) -> VehicleState:
        return await self._contact.keeps(self._vehicle.take_off(height_m))

    async def observe(self, cameras: Sequence[str] | None = None, *, depth: bool = True) -> Observation:
        return await self._contact.keeps(self._vehicle.observe(cameras, depth=depth))

    async def fly(self, number: int, move: Move, progress: Progress | None = None) -> MoveResult:
        return await self._contact.keeps(self._vehicle.fly(number, move, progress))

    async def hold(self) -> VehicleState:
        return await self._contact.keeps(self._vehicle.hold())

    async def return_home(self) -> VehicleState:
        return await self._contact.keeps(self._vehicle.return_home())

    async def land(self) -> VehicleState:
        return await self._contact.keeps(self._vehicle.land())

    async def release(self) -> None:
        await self._vehicle.release()


@dataclass(frozen=True)
class WatchedPlacement:
    """A placement whose vehicles are watched."""

    placement: Placement
    contact: Contact

    @property
    def rig_name(self) -> str | None:
        return self.placement.rig_name

    @property
    def sensors_name(self) -> str | None:
        return self.placement.sensors_name

    async def begin(self, key: str) -> Vehicle:
        return WatchedVehicle(await self.contact.keeps(self.placement.begin(key)), self.contact)

    async def resume(self, vehicle: str) -> Vehicle:
        return WatchedVehicle(await self.contact.keeps(self.placement.resume(vehicle)), self.contact)

    async def renderer(self, vehicle: str) -> str | None:
        return await self.contact.keeps(self.placement.renderer(vehicle))

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return await self.contact.keeps(self.placement.claim(vehicle, target))
