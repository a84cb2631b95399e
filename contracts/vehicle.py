"""The vehicle's contract: what every vehicle can do for a mission, whether a simulator or an autopilot flies it.

Over HTTP a vehicle is a base address; a fleet's service has one such address a vehicle (the simulator:
`/v1/episodes/{id}`). Relative to it:

    GET    (itself)             VehicleState
    GET    /capabilities        VehicleCapabilities
    GET    /observation         Observation; `cameras=front,left` (all without it), `depth=false` leaves the depth out
    POST   /take-off            VehicleState; TakeOff
    PUT    /moves/{n}           MoveResult; Move number n = 1, 2, ...; the same number and body again is the same move
    GET    /moves/{n}           MoveProgress while the move is flown and after
    DELETE /moves/{n}           MoveResult; the vehicle stops on the way and holds; `cancelled` is set
    POST   /hold                VehicleState; stops on the way
    POST   /return              VehicleState, once it holds where it took off
    POST   /land                VehicleState, once it has landed
    DELETE (itself)             204; the mission needs the vehicle no more

Positions in metres, ENU (x east, y north, z up from the ground at the start); yaw in radians, counter-clockwise from
east. Nothing here names a scene, a renderer, or anything else that only a simulator has.
"""

from typing import Annotated, Literal

from pydantic import Field

from contracts.base import Metres, Name, Radians, Unit, Wire
from contracts.cameras import Camera
from contracts.geometry import Point3, Pose
from contracts.images import DepthMap, JpegImage

FlightMode = Literal["landed", "taking_off", "holding", "moving", "returning", "landing", "manual", "lost"]
MAX_PATH_POINTS = 64
ClockSeconds = Annotated[float, Field(ge=0.0, le=1e10)]


class PoseUncertainty(Wire):
    """Standard deviations of the measured pose; null where the vehicle does not know."""

    horizontal_m: Metres | None = None
    vertical_m: Metres | None = None
    yaw_rad: Annotated[float, Field(ge=0.0, le=7.0)] | None = None


class Battery(Wire):
    """`remaining`: of a full charge, 0..1; null where nothing measures it. `reserve`: what is kept for the way home."""

    remaining: Unit | None = None
    reserve: Unit | None = None
    voltage_v: float | None = Field(default=None, ge=0.0, le=1_000.0)


class Health(Wire):
    """`problems` are for people; a vehicle with any is not ready for a mission."""

    ok: bool = True
    problems: tuple[str, ...] = ()


class VehicleCapabilities(Wire):
    """What the vehicle is and carries. `radius_m`: of a ball round its centre that holds all of it. `cancels_moves`: it
    stops on the way when a move is cancelled. `lands`: it can take off, land and return to where it took off."""

    kind: Name
    cameras: tuple[Camera, ...]
    radius_m: Metres
    max_speed_m_s: float
    cancels_moves: bool
    lands: bool


class VehicleState(Wire):
    """As the vehicle measures itself. `moves`: the number of the last move begun, 0 before the first. `collided` never
    goes back to false. Paths and times add up over all moves. `time_s`: what the vehicle's clock shows, seconds; null
    where it has none."""

    id: Name
    mode: FlightMode
    pose: Pose
    uncertainty: PoseUncertainty = PoseUncertainty()
    battery: Battery = Battery()
    health: Health = Health()
    moves: int = Field(ge=0)
    path_m: Metres
    path_horizontal_m: Metres
    flight_s: float = Field(ge=0.0)
    collided: bool
    time_s: ClockSeconds | None = None


class TakeOff(Wire):
    """To `height_m` above where it stands; a vehicle that flies already stays where it is."""

    height_m: Metres = 1.5


class Move(Wire):
    """Fly along `path` (straight legs from where the drone is), then turn to `yaw` (radians); without `yaw` the drone
    ends facing the direction of its last horizontal travel. An empty path only turns."""

    path: tuple[Point3, ...] = Field(default=(), max_length=MAX_PATH_POINTS)
    yaw: Radians | None = None


class MoveProgress(Wire):
    """How far move `number` has come; `share`: how much of it is flown, 0..1."""

    number: int
    state: Literal["flying", "done", "cancelled"]
    pose: Pose
    share: Unit


class MoveResult(Wire):
    """What came of move `number`: `reached` is false when something stopped the drone at `pose`; `cancelled` says that
    it was told to. `collided` and `hit` (what was hit, for people) are of this move; the vehicle's own remembers."""

    number: int
    pose: Pose
    reached: bool
    cancelled: bool = False
    collided: bool
    hit: str | None = None
    path_m: Metres
    flight_s: float = Field(ge=0.0)
    vehicle: VehicleState


class SensedView(Wire):
    """One camera's picture and depth."""

    camera: Camera
    image: JpegImage
    depth: DepthMap | None = None


class Observation(Wire):
    """Views of one moment and the pose measured then. `number` counts observations; `time_s` is the vehicle's clock
    when the views were taken (`VehicleState.time_s`), null where it has none: cameras that froze give the same views
    with the same time. `timings_s` is wall time by part (a simulator: `render`, `encode`)."""

    vehicle: Name
    number: int
    pose: Pose
    time_s: ClockSeconds | None = None
    uncertainty: PoseUncertainty = PoseUncertainty()
    views: tuple[SensedView, ...] = Field(min_length=1)
    timings_s: dict[str, float] = {}
