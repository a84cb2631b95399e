"""What a vehicle with cameras of its own does when a mission needs it no more."""

import asyncio
import logging
from typing import Literal

from service_kit.errors import ServiceError
from services.mavlink_vehicle.link import CommandRefused, LinkLost
from services.mavlink_vehicle.vehicle import Vehicle

log = logging.getLogger("mavlink_vehicle.release")

AfterMission = Literal["hold", "return", "land"]


class Release:
    """Of one vehicle. The flight home or down is begun, not waited for."""

    def __init__(self, vehicle: Vehicle, after: AfterMission) -> None:
        self._vehicle = vehicle
        self._after = after
        self._going: asyncio.Task[None] | None = None

    async def begin(self) -> None:
        """A mission needs the vehicle no more; asking again does no harm."""
        drone = self._vehicle.drone
        if self._going is not None and not self._going.done():
            return
        if drone.telemetry.in_air and drone.control.in_hand() != "taken" and self._after != "hold":
            self._going = asyncio.create_task(self._go())
            return
        await self._vehicle.begin(self._vehicle.task)
        try:
            await drone.leave()
        except (CommandRefused, LinkLost) as error:
            log.warning("it is not told to hold by itself: %s", error)

    async def close(self) -> None:
        if self._going is not None:
            self._going.cancel()

    async def _go(self) -> None:
        vehicle = self._vehicle
        try:
            if self._after == "return":
                await vehicle.return_home()
            await vehicle.land()
            await vehicle.begin(vehicle.task)
        except ServiceError as error:
            log.warning("after the mission: %s", error)
