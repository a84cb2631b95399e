"""The drone of one episode: where it is, what it has flown, what it is doing, and how its battery stands.

A flight is begun, which plans it to its end, and then advanced over its own time by whoever keeps the clock; it can be
broken off at any moment. Metres, ENU; the world outside is told poses as the drone's odometry believes them.
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from contracts.geometry import Point3, Pose
from contracts.sim import Flight
from contracts.vehicle import Battery, FlightMode, Health, VehicleState
from episode_kit.encounters import Movers, met_braking, met_on_the_way
from episode_kit.kinematics import Vector, wrapped
from episode_kit.odometry import Odometry, Way
from episode_kit.trajectory import Course, Flown, Planner

Doing = Literal["taking_off", "moving", "returning", "landing"]
OVER_THE_ROOFS_M = 3.0
UNDERGROUND_M = -1.0
"""Landing aims at this height, and touches down on what is in the way."""


LOOK_S = 0.1
"""By so much the vehicle's clock goes on for each look, beside the time it flies."""
_RATES_S = 0.05


class Rates(NamedTuple):
    """Metres a second east, north and up, and radians a second counter-clockwise."""

    east: float
    north: float
    up: float
    yaw: float


class Drone:
    """Starts in the air, where it holds. One call at a time, but `advance`, `pose` and `state` may come meanwhile."""

    def __init__(
        self,
        planner: Planner,
        flight: Flight,
        start: Pose,
        odometry: Odometry,
        *,
        roof_m: float,
        underground_m: float = UNDERGROUND_M,
        movers: Movers | None = None,
    ) -> None:
        """`roof_m`: the highest roof, over which it flies home; `underground_m`: a height that lies under the ground
        everywhere; `movers`: what the planner knows nothing of, null: nothing moves but the drone."""
        self._planner = planner
        self._movers = movers
        self._flight = flight
        self._underground_m = underground_m
        self._odometry = odometry
        self._home = Point3(x=start.x, y=start.y, z=start.z)
        self._roof_m = roof_m
        self._pose = start
        self._mode: FlightMode = "holding"
        self._path_m = self._path_horizontal_m = self._flight_s = self._effort_s = 0.0
        self._hit: str | None = None
        self._trajectory: Course | None = None
        self._now: Flown | None = None
        self._time_s = 0.0

    @property
    def pose(self) -> Pose:
        """The true one, also on the way."""
        return self._now.pose if self._now is not None else self._pose

    @property
    def flies(self) -> bool:
        """A flight is under way."""
        return self._trajectory is not None

    @property
    def landed(self) -> bool:
        return self._mode == "landed"

    @property
    def collided(self) -> bool:
        """Ever."""
        return self._hit is not None

    @property
    def share(self) -> float:
        """How much of the flight under way is flown, 0..1 of its time; 1 without one."""
        trajectory = self._trajectory
        return 1.0 if trajectory is None or not trajectory.duration_s else self._time_s / trajectory.duration_s

    @property
    def left_s(self) -> float:
        """Seconds that the flight under way still takes."""
        return self._trajectory.duration_s - self._time_s if self._trajectory is not None else 0.0

    def believed(self, pose: Pose) -> Pose:
        """A pose of this flight as the drone's odometry has it."""
        return self._odometry.believed(pose, _way(self._now) if self._now is not None else Way())

    def clock_s(self, looks: int) -> float:
        """What the vehicle's clock shows after so many looks, also on the way."""
        return self._flight_s + (self._now.flight_s if self._now else 0.0) + looks * LOOK_S

    def struck(self, name: str) -> None:
        """Something has run into it where it hovers."""
        self._hit = self._hit or name

    def put(self, pose: Pose, hit: str | None) -> None:
        """Somebody else has flown it straight to `pose`; `hit`: what was on that way."""
        here, there = _vector(self._pose), _vector(pose)
        self._hit = self._hit or hit
        self._pose = pose
        self._path_m += math.dist(here, there)
        self._path_horizontal_m += math.dist(here[:2], there[:2])

    def jump(self, east_m: float) -> None:
        """What it believes of its position leaps; where it is does not."""
        self._odometry.jump(east_m)

    @property
    def rates(self) -> Rates:
        """How it moves, also on the way."""
        if self._trajectory is None:
            return Rates(0.0, 0.0, 0.0, 0.0)
        before, after = (self._trajectory.at(max(0.0, self._time_s + s)).pose for s in (-_RATES_S, _RATES_S))
        span_s = self._time_s + _RATES_S - max(0.0, self._time_s - _RATES_S)
        gaps = (after.x - before.x, after.y - before.y, after.z - before.z, wrapped(after.yaw - before.yaw))
        return Rates(*(gap / span_s for gap in gaps))

    def true(self, place: Point3) -> Point3:
        """The place that one means which the drone believes in, between flights."""
        return self._odometry.true(place)

    def state(self, name: str, moves: int, looks: int = 0) -> VehicleState:
        """As the drone measures itself now."""
        now = self._now
        horizontal_m = self._path_horizontal_m + (now.path_horizontal_m if now else 0.0)
        flight_s = self._flight_s + (now.flight_s if now else 0.0)
        return VehicleState(
            id=name,
            mode=self._mode,
            pose=self._odometry.reading(self.believed(self.pose), (moves, looks)),
            time_s=self.clock_s(looks),
            uncertainty=self._odometry.uncertainty(
                Way(self._path_m + (now.path_m if now else 0.0), horizontal_m, flight_s)
            ),
            battery=Battery(remaining=self._charge, reserve=self._flight.reserve),
            health=self._health(),
            moves=moves,
            path_m=self._path_m + (now.path_m if now else 0.0),
            path_horizontal_m=horizontal_m,
            flight_s=flight_s,
            collided=self.collided,
        )

    def move(self, path: Sequence[Point3], yaw: float | None) -> None:
        """Begins a flight along corners that are meant in the frame which the drone believes in as it sets out."""
        true_yaw = None if yaw is None else self._odometry.true_yaw(yaw)
        self._begin("moving", [_vector(self._odometry.true(corner)) for corner in path], true_yaw)

    def take_off(self, height_m: float) -> None:
        """Straight up from where it stands."""
        here = self._pose
        self._begin("taking_off", [(here.x, here.y, here.z + height_m)], None)

    def return_home(self) -> None:
        """Up over all roofs, straight to where it believes that it started, and down to the height it had there."""
        here, home = self._pose, self._odometry.true(self._home)
        over_m = max(here.z, home.z, self._roof_m + OVER_THE_ROOFS_M)
        self._begin("returning", [(here.x, here.y, over_m), (home.x, home.y, over_m), _vector(home)], None)

    def land(self) -> None:
        """Straight down onto whatever is there."""
        self._begin("landing", [(self._pose.x, self._pose.y, self._underground_m)], None)

    def advance(self, time_s: float) -> Flown | None:
        """To `time_s` seconds after the flight was begun; once it is over, what came of it."""
        trajectory = self._trajectory
        if trajectory is None:
            return None
        if self._movers is not None:
            met = met_on_the_way(self._movers, trajectory, self._flight_s, self._time_s, time_s)
            if met is not None:
                return self._end(met, struck=True)
        if time_s >= trajectory.duration_s:
            return self._end(trajectory.end)
        self._time_s = time_s
        self._now = trajectory.at(time_s)
        return None

    def stop(self) -> Flown | None:
        """Brakes, and holds; how far the flight came, null where none was under way."""
        if self._trajectory is None:
            return None
        if self._movers is not None:
            met = met_braking(self._movers, self._trajectory, self._flight_s, self._time_s)
            if met is not None:
                return self._end(met, struck=True)
        return self._end(self._trajectory.stopped_at(self._time_s))

    def _begin(self, doing: Doing, path: Sequence[Vector], yaw: float | None) -> None:
        trajectory = self._planner.plan(self._pose, path, yaw)
        self._time_s, self._now, self._mode = 0.0, None, doing
        self._trajectory = trajectory

    def _end(self, flown: Flown, *, struck: bool = False) -> Flown:
        """`struck`: by something that moves, on which nobody lands."""
        touched_down = self._mode == "landing" and flown.hit is not None and not struck
        self._mode = "landed" if touched_down else "holding"
        if not touched_down:
            self._hit = self._hit or flown.hit
        self._trajectory = self._now = None
        self._pose = flown.pose
        self._odometry.flown(flown.pose, _way(flown))
        self._path_m += flown.path_m
        self._path_horizontal_m += flown.path_horizontal_m
        self._flight_s += flown.flight_s
        self._effort_s += _effort_s(flown)
        return flown

    @property
    def empty(self) -> bool:
        """Nothing is left in the battery."""
        return self._charge <= 0.0

    @property
    def _charge(self) -> float:
        now = self._now
        effort_s = self._effort_s + (_effort_s(now) if now is not None else 0.0)
        return max(0.0, 1.0 - effort_s / self._flight.endurance_s)

    def _health(self) -> Health:
        problems = []
        if self._hit is not None:
            problems.append(f"it has hit {self._hit}")
        if self.empty:
            problems.append("its battery is empty")
        elif self._charge <= self._flight.reserve:
            problems.append("its battery is down to the reserve")
        return Health(ok=not problems, problems=tuple(problems))


def _effort_s(flown: Flown) -> float:
    return flown.flight_s if flown.effort_s is None else flown.effort_s


def _way(flown: Flown) -> Way:
    return Way(flown.path_m, flown.path_horizontal_m, flown.flight_s)


def _vector(place: Point3 | Pose) -> Vector:
    return place.x, place.y, place.z
