"""What a vehicle with cameras of its own does when a mission needs it no more."""

import asyncio
import logging
from typing import Literal

from service_kit.errors import ServiceError
from services.mavlink_vehicle.link import CommandRefused, LinkLost
from services.mavlink_vehicle.vehicle import Vehicle

log = logging.getLogger("mavlink_vehicle.release")

AfterMission = Literal["hold", "return", "land"]
_GOING: set[asyncio.Task[None]] = set()


async def release(vehicle: Vehicle, after: AfterMission) -> None:
    """Whatever is under way is stopped. The flight home or down is begun, not waited for."""
    drone = vehicle.drone
    if drone.telemetry.in_air and drone.control.in_hand() != "taken" and after != "hold":
        going = asyncio.create_task(_go(vehicle, after))
        _GOING.add(going)
        going.add_done_callback(_GOING.discard)
        return
    try:
        await drone.leave()
    except (CommandRefused, LinkLost) as error:
        log.warning("it is not told to hold by itself: %s", error)
    vehicle.begin(vehicle.task)


async def _go(vehicle: Vehicle, after: AfterMission) -> None:
    try:
        if after == "return":
            await vehicle.return_home()
        await vehicle.land()
        vehicle.begin(vehicle.task)
    except ServiceError as error:
        log.warning("after the mission: %s", error)
