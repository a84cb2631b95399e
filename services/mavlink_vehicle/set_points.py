"""The stream of set-points, 20 a second, whatever else is going on: without it PX4 leaves its offboard mode after half
a second. MAVSDK, in a thread of its own, repeats the last one where this process is kept from its turn."""

import asyncio

from services.mavlink_vehicle.frames import Enu, ned_of
from services.mavlink_vehicle.link import Link, LinkLost

EVERY_S = 0.05


class SetPoints:
    """Runs as a task; `aim` says where to, `stop` ends the stream."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._aim: Enu | None = None

    @property
    def aim_at(self) -> Enu | None:
        """Null where nothing is streamed."""
        return self._aim

    def aim(self, place: Enu) -> None:
        """From now on the vehicle is to be there: its own frame, heading included."""
        self._aim = place

    def stop(self) -> None:
        self._aim = None

    async def run(self) -> None:
        """Until it is cancelled."""
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            if self._aim is not None:
                try:
                    await self._link.set_point(ned_of(self._aim))
                except LinkLost:
                    self._aim = None
            due_s = max(due_s + EVERY_S, loop.time())
            await asyncio.sleep(due_s - loop.time())
