"""What one mission flies with."""

from dataclasses import dataclass
from typing import NamedTuple

from contracts.geometry import Pose
from services.mavlink_vehicle.cameras.port import Cameras
from services.mavlink_vehicle.course import FlightLimits
from services.mavlink_vehicle.frames import Alignment, Enu


class Body(NamedTuple):
    """`radius_m`: of a ball that holds all of it; `stands_m`: how high its centre is when it stands on the ground.
    `reserve`: of its battery."""

    radius_m: float
    stands_m: float
    reserve: float


@dataclass
class Task:
    """What one mission flies with. `name`: the vehicle's for that mission. `stands`: where in the mission's frame it
    stands before its first take-off; null where that frame begins under it, east staying east. `alignment`: null until
    that take-off."""

    name: str
    cameras: Cameras
    limits: FlightLimits
    body: Body
    stands: Pose | None = None
    alignment: Alignment | None = None

    def alignment_at(self, local: Enu) -> Alignment:
        """The one of a vehicle that stands there, in the autopilot's frame."""
        if self.stands is not None:
            return Alignment.between(local, self.stands)
        return Alignment.from_origin(local, self.body.stands_m)
