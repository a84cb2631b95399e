"""A link to an autopilot without MAVLink: a drone in this process that is at once where its set-points are."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import cast

from services.mavlink_vehicle.cameras.simulated import NoCameras
from services.mavlink_vehicle.course import FlightLimits
from services.mavlink_vehicle.drone import Drone
from services.mavlink_vehicle.frames import Enu, Ned, enu_of
from services.mavlink_vehicle.link import CommandRefused, Firmware, Link
from services.mavlink_vehicle.task import Body, Task
from services.mavlink_vehicle.telemetry import Mode, Telemetry
from services.mavlink_vehicle.vehicle import Vehicle

SAYS_EVERY_S, CLIMB_M_S = 0.02, 10.0
LIMITS = FlightLimits(2.0, 8.0, 3.0)
BODY = Body(0.3, 0.3, 0.2)


class ObedientLink:
    """`refusals`: so often it still refuses to arm. `short_m`: so much lower than it was told a take-off ends.
    `disarms`: its motors rest by themselves once it stands. `late`: so often it does not take set-points yet; its
    take-off ends meanwhile, and it holds."""

    firmware: Firmware = "px4"
    found = True
    silence = "it says nothing"

    def __init__(self, refusals: int = 0, short_m: float = 0.0, *, disarms: bool = True, late: int = 0) -> None:
        self.telemetry = Telemetry(missing=(), armable=True, landed=True)
        self.place = Enu(3.0, -2.0, 0.4, 1.0)
        self.refusals = refusals
        self.short_m = short_m
        self.disarms = disarms
        self.late = late
        self._rises_to_m: float | None = None
        self._told("hold")

    async def says(self) -> None:
        """What an autopilot tells, until it is cancelled."""
        while True:
            if self._rises_to_m is not None:
                up_m = min(self.place.up_m + CLIMB_M_S * SAYS_EVERY_S, self._rises_to_m)
                self.place = self.place._replace(up_m=up_m)
            self._told(self.telemetry.mode)
            await asyncio.sleep(SAYS_EVERY_S)

    async def arm(self) -> None:
        if self.refusals > 0:
            self.refusals -= 1
            raise CommandRefused("the autopilot refuses to arm (gyros still settling)")
        self.telemetry.armed = True

    async def take_off(self, height_m: float) -> None:
        self.telemetry.landed = False
        self._rises_to_m = self.place.up_m + height_m - self.short_m
        self._told("takeoff")

    async def take_set_points(self) -> None:
        if self.late > 0:
            self.late -= 1
            asyncio.get_running_loop().call_later(0.25, self._told, "hold")
            raise CommandRefused("the autopilot refuses to take set-points")
        self._rises_to_m = None
        self._told("offboard")

    async def set_point(self, ned: Ned) -> None:
        self.place = enu_of(ned)

    async def hold(self) -> None:
        self._told("hold")

    async def land(self) -> None:
        self.telemetry.landed, self.telemetry.armed = True, not self.disarms
        self._told("land")

    async def disarm(self) -> None:
        self.telemetry.armed = False

    def _told(self, mode: Mode) -> None:
        telemetry = self.telemetry
        telemetry.heard()
        telemetry.yaw, telemetry.mode, telemetry.mode_told_s = self.place.yaw, mode, telemetry.clock()
        last = telemetry.poses.last
        gap_m = 0.0 if last is None else math.dist(self.place[:3], last.place[:3])
        telemetry.moved(self.place, 0.0 if last is None else gap_m / max(1e-3, telemetry.clock() - last.time_s))


@asynccontextmanager
async def flying(link: ObedientLink, task: Task | None = None, arms_within_s: float = 30.0) -> AsyncIterator[Vehicle]:
    """A vehicle behind that link; all of it ends with the block."""
    drone = Drone(cast(Link, link), arms_within_s=arms_within_s)
    vehicle = Vehicle(drone, task or idle())
    runs = [asyncio.create_task(run) for run in (link.says(), drone.run(), vehicle.run())]
    try:
        yield vehicle
    finally:
        await vehicle.close()
        for run in runs:
            run.cancel()
            with suppress(asyncio.CancelledError):
                await run


def idle(name: str = "vehicle") -> Task:
    """A mission that sees nothing."""
    return Task(name, NoCameras(), LIMITS, BODY)
