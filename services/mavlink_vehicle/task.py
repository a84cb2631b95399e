"""What one mission flies with."""

from dataclasses import dataclass
from typing import NamedTuple

from services.mavlink_vehicle.cameras.port import Cameras
from services.mavlink_vehicle.course import FlightLimits
from services.mavlink_vehicle.frames import Alignment


class Body(NamedTuple):
    """`radius_m`: of a ball that holds all of it; `stands_m`: how high its centre is when it stands on the ground.
    `reserve`: of its battery."""

    radius_m: float
    stands_m: float
    reserve: float


@dataclass
class Task:
    """What one mission flies with. `name`: the vehicle's for that mission. `alignment`: null until it is known where
    the vehicle stood."""

    name: str
    cameras: Cameras
    limits: FlightLimits
    body: Body
    alignment: Alignment | None = None
