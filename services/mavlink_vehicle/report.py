"""What the vehicle tells of itself beside its pose: battery, health, how far it has flown."""

import asyncio
import math
from typing import NamedTuple, Self

from contracts.vehicle import Battery, Health
from services.mavlink_vehicle.frames import Enu
from services.mavlink_vehicle.telemetry import Telemetry

STEP_M = 0.25
"""Less is the wandering of a vehicle that hovers, and no way."""
MEASURE_EVERY_S = 0.05


class Flown(NamedTuple):
    """So much of a way: in 3-D, on the ground plan, seconds in the air; what was hit."""

    path_m: float = 0.0
    horizontal_m: float = 0.0
    flight_s: float = 0.0
    hit: str | None = None

    def since(self, before: Self) -> Self:
        return self._replace(
            path_m=self.path_m - before.path_m,
            horizontal_m=self.horizontal_m - before.horizontal_m,
            flight_s=self.flight_s - before.flight_s,
        )


class Odometer:
    """Adds up the way flown, while something is flown, and the time in the air, always."""

    def __init__(self) -> None:
        self._last: Enu | None = None
        self._looked_s: float | None = None
        self.reset()

    def reset(self) -> None:
        """A mission begins."""
        self.path_m = self.horizontal_m = self.flight_s = 0.0

    def reading(self) -> Flown:
        return Flown(self.path_m, self.horizontal_m, self.flight_s)

    def tick(self, telemetry: Telemetry) -> None:
        """Time goes on."""
        now = telemetry.clock()
        if self._looked_s is not None and telemetry.in_air:
            self.flight_s += now - self._looked_s
        self._looked_s = now

    def note(self, telemetry: Telemetry, step_m: float = 0.0) -> None:
        """Where it is now, once it is `step_m` away from where it was noted last."""
        self.tick(telemetry)
        place, last = telemetry.place, self._last
        if place is None:
            return
        if last is None:
            self._last = place
        elif (gap_m := math.dist(place[:3], last[:3])) > step_m:
            self.path_m += gap_m
            self.horizontal_m += math.dist(place[:2], last[:2])
            self._last = place

    async def measure(self, telemetry: Telemetry) -> None:
        """Until it is cancelled: a flight is under way."""
        self._last = telemetry.place
        while True:
            self.note(telemetry, STEP_M)
            await asyncio.sleep(MEASURE_EVERY_S)


def battery_of(telemetry: Telemetry, reserve: float) -> Battery:
    return Battery(remaining=telemetry.remaining, reserve=reserve, voltage_v=telemetry.voltage_v)


def health_of(telemetry: Telemetry, taken: str | None, collided: str | None, trouble: str | None) -> Health:
    """`taken`: who else flies it; `collided`: what it has hit; `trouble`: what else went wrong in this mission. A
    battery that runs low is no problem of health: whoever flies it knows how far home is."""
    problems = []
    if telemetry.lost:
        silent = "yet" if math.isinf(telemetry.silent_s) else f"for {telemetry.silent_s:.0f} s"
        problems.append(f"no word from the autopilot {silent}")
    elif telemetry.in_air and telemetry.place is None:
        problems.append("the autopilot does not say where it is any more")
    if taken is not None:
        problems.append(taken)
    if collided is not None:
        problems.append(f"it has hit {collided}")
    if trouble is not None:
        problems.append(trouble)
    # in the air the autopilot's own failsafes deal with what it lacks; that it has no position is told here too
    lacks = telemetry.missing if not telemetry.armed else tuple(m for m in telemetry.missing if m == "a position")
    problems.extend(f"the autopilot lacks {missing}" for missing in lacks)
    return Health(ok=not problems, problems=tuple(problems))
