"""The flight under way: one at a time, gone on with when its caller hangs up, ended when somebody says so."""

import asyncio
from collections.abc import Awaitable

from contracts.vehicle import FlightMode
from service_kit.errors import Conflict, Unavailable
from services.mavlink_vehicle.drone import Drone
from services.mavlink_vehicle.flight_ends import Interrupted, Stopped, TakenOver
from services.mavlink_vehicle.link import CommandRefused, LinkLost
from services.mavlink_vehicle.report import Odometer


class Activity:
    """`doing`: null between flights."""

    def __init__(self, drone: Drone, odometer: Odometer) -> None:
        self._drone = drone
        self._odometer = odometer
        self._task: asyncio.Task[None] | None = None
        self.doing: FlightMode | None = None

    @property
    def busy(self) -> bool:
        return self._task is not None and not self._task.done()

    @property
    def under_way(self) -> asyncio.Task[None] | None:
        """To be waited for with `over`; null between flights."""
        return self._task if self.busy else None

    def start(self, doing: FlightMode, flight: Awaitable[None]) -> asyncio.Task[None]:
        """Nothing else may be under way. To be waited for with `over`."""
        self.doing = doing
        self._task = asyncio.create_task(self._carried_out(flight))
        self._task.add_done_callback(_looked_at)
        return self._task

    async def stop(self) -> None:
        """What is under way ends, and the vehicle stands in the air; an autopilot's own landing or return goes on until
        something else is begun."""
        if self._task is None or self._task.done():
            return
        self._drone.stop_asked = True
        try:
            await asyncio.wait({self._task})
        finally:
            self._drone.stop_asked = False

    async def close(self) -> None:
        """What is under way is given up."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait({self._task})

    async def _carried_out(self, flight: Awaitable[None]) -> None:
        measuring = asyncio.create_task(self._odometer.measure(self._drone.telemetry))
        try:
            await flight
        finally:
            measuring.cancel()
            self.doing = None


async def over(flight: asyncio.Task[None]) -> None:
    """Waits for a flight; a caller that leaves does not end it. Raises Conflict, Unavailable."""
    try:
        await asyncio.shield(flight)
    except TakenOver as error:
        raise Conflict(str(error), code="manual_control") from None
    except Stopped:
        return
    except (Interrupted, CommandRefused) as error:
        raise Unavailable(str(error), code="not_flown") from None
    except LinkLost as error:
        raise Unavailable(str(error), code="link_lost") from None


def _looked_at(task: asyncio.Task[None]) -> None:
    """Whoever waits is told what went wrong; that nobody waits any more is no error."""
    if not task.cancelled():
        task.exception()
