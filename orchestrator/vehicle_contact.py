"""Whether a flight's vehicle can still be reached: noted at every call that is made to it anyway."""

from collections.abc import Awaitable
from dataclasses import dataclass
from typing import TypeVar

from mission.placement import Placement
from mission.ports import ServiceRefused, ServiceUnreachable
from mission.vehicle import Vehicle
from mission.vehicles.decorated import DecoratedPlacement, DecoratedVehicle

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


class WatchedVehicle(DecoratedVehicle):
    """A vehicle whose calls tell a `Contact` how it fares."""

    def __init__(self, vehicle: Vehicle, contact: Contact) -> None:
        super().__init__(vehicle)
        self._contact = contact

    async def _awaited(self, call: Awaitable[T]) -> T:
        return await self._contact.keeps(call)


class WatchedPlacement(DecoratedPlacement):
    """A placement whose vehicles are watched."""

    def __init__(self, placement: Placement, contact: Contact) -> None:
        super().__init__(placement)
        self._contact = contact

    def _before(self, vehicle: Vehicle) -> Vehicle:
        return WatchedVehicle(vehicle, self._contact)

    async def _awaited(self, call: Awaitable[T]) -> T:
        return await self._contact.keeps(call)
