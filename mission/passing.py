"""Who walks or drives by is waited for, and flown over: the flight guard's part, and the way over them."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import NamedTuple, Protocol

from contracts.geometry import Point3, Pose
from contracts.vehicle import MAX_PATH_POINTS, Move
from mission.frames import FlightRefused
from mission.guard_looks import GuardLooks
from mission.places import above
from mission.state import PlannedFlight
from navigation import passers_by
from navigation.camera import Place
from navigation.camera import Pose as FlownPose

WAIT_S = 8.0
"""So long somebody who walks by is waited for; at 1.3 m/s they have gone 10 m."""
LOOK_EVERY_S = 0.1
MOST_LOOKS = 200
"""Nor for more looks than that: a vehicle's clock may stand still."""
RESUMED_S = 2.0
"""So long must looks show nobody that begin anew after somebody was seen to move: in one look nothing moves."""
CLEAR_LOOKS = 3
"""After a wait so many looks in a row must show nobody."""
OVER_M = 0.5
"""So far beyond their reach: measured heights are not exact, and a vehicle arrives within 0.3 m or so."""


class Look(Protocol):
    """Takes one look more, or one `instead` of the last; tells when that was, seconds. Raises PortError."""

    async def __call__(self, *, instead: bool = False) -> float: ...


class Wait(NamedTuple):
    """How who walks by is waited for. `seen`: the looks so far, to which `look` adds; `rises`: can the drone go up out
    of their reach instead?"""

    seen: GuardLooks
    speed_m_s: float
    look: Look
    rises: Callable[[], bool]

    async def let_pass(self, path: Sequence[Place], pose: FlownPose, check: Callable[[], Awaitable[None]]) -> float:
        """Looks anew before a flight where anybody could walk, and waits until nobody can come into the way; tells how
        long that took, seconds. `check`, by all else that looks show, comes before and after. Raises FlightRefused
        (passer_by) where somebody still could after a while, or at once where the drone rises; PortError."""
        begun_s = looked_s = await self.look()
        await check()
        clear = looks = 0
        least_s = RESUMED_S if self.seen.resumed else 0.0
        while True:
            near = passers_by.in_the_way(path, pose, self.speed_m_s, self.seen.low_m, self.seen.movers())
            clear = clear + 1 if near is None else 0
            waited_s = looked_s - begun_s
            if near is not None and (waited_s > WAIT_S or looks >= MOST_LOOKS or self.rises()):
                said = f"somebody walks or drives by, {near.away_m:.1f} m from the way"
                raise FlightRefused("passer_by", said, Point3(x=near.at.x, y=near.at.y, z=near.at.z))
            if clear and not looks and not self.seen.resumed:
                return 0.0
            if clear >= CLEAR_LOOKS and (waited_s >= least_s or looks >= MOST_LOOKS):
                break
            await asyncio.sleep(LOOK_EVERY_S)
            looked_s = await self.look(instead=True)
            looks += 1
        await check()
        self.seen.resumed = False
        return max(waited_s, 0.0)


def way_over(flight: PlannedFlight, pose: Pose, low_m: float) -> tuple[PlannedFlight, PlannedFlight]:
    """Straight up out of reach, and from there over them to the flight's end."""
    over_m, path = low_m + OVER_M, flight.move.path
    up = PlannedFlight(move=Move(path=(above(pose, over_m),), yaw=pose.yaw), why="up out of reach of who walks by")
    over = tuple(corner.model_copy(update={"z": max(corner.z, over_m)}) for corner in path)
    down = path[-1:] if path[-1].z < over_m else ()
    move = flight.move.model_copy(update={"path": (*over, *down)[-MAX_PATH_POINTS:]})
    return up, flight.model_copy(update={"move": move})
