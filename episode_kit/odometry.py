"""Where the drone believes it is: the true place, and an error that grows with the way flown.

The believed frame is the true one turned about the drone and shifted. The drone is told its believed place and is sent
to places in the same frame, so what it sees beside it lies where it says.
"""

import math
from typing import NamedTuple

import numpy as np

from contracts.geometry import Point3, Pose
from contracts.sensor_profiles import PoseSensor
from contracts.vehicle import PoseUncertainty


class Way(NamedTuple):
    """What was flown: in 3-D, on the ground plan, and for how long."""

    path_m: float = 0.0
    horizontal_m: float = 0.0
    flight_s: float = 0.0


_NO_WAY = Way()


class _Frame(NamedTuple):
    """believed = turned by `yaw` about the true place (x, y), then shifted by (east, north, up)."""

    x: float
    y: float
    east: float = 0.0
    north: float = 0.0
    up: float = 0.0
    yaw: float = 0.0


class Odometry:
    """`flight_drift` (a share, 0.01 is a metre in a hundred of the level way) adds to the sensor's own. In which
    direction it drifts, and which way it turns, is drawn once from `seeds`; noise and jumps from them and
    `noise_seed`."""

    def __init__(
        self,
        sensor: PoseSensor,
        flight_drift: float,
        seeds: tuple[int, ...],
        *,
        noise_seed: int = 0,
        start: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._sensor = sensor
        self._drift = sensor.drift + flight_drift
        rng = np.random.default_rng(seeds)
        course = rng.uniform(0.0, math.tau)
        self._direction = math.cos(course), math.sin(course)
        self._up_sign, self._turn_sign = (1.0 if rng.random() < 0.5 else -1.0 for _ in range(2))
        self._noise_seeds = (*seeds, noise_seed)
        self._jumps = np.random.default_rng((*self._noise_seeds, 1))
        self._frame = _Frame(*start)

    def flown(self, pose: Pose, way: Way) -> None:
        """So much more of the way is behind the drone, which truly is at `pose` now."""
        there = self.believed(pose, way)
        leaps = int(self._jumps.poisson(self._sensor.jumps_per_minute * way.flight_s / 60.0))
        courses = self._jumps.uniform(0.0, math.tau, leaps)
        self._frame = _Frame(
            pose.x,
            pose.y,
            there.x - pose.x + self._sensor.jump_m * float(np.cos(courses).sum()),
            there.y - pose.y + self._sensor.jump_m * float(np.sin(courses).sum()),
            there.z - pose.z,
            self._frame.yaw + self._turned(way),
        )

    def jump(self, east_m: float) -> None:
        """The believed position leaps."""
        self._frame = self._frame._replace(east=self._frame.east + east_m)

    def believed(self, pose: Pose, further: Way = _NO_WAY) -> Pose:
        """The pose that is believed in for a true one, `further` of way after the last flight that `flown` was told
        of."""
        frame = self._frame
        off_m = self._drift * further.horizontal_m
        up_m = frame.up + self._up_sign * self._sensor.vertical_drift * further.path_m
        yaw = frame.yaw + self._turned(further)
        east, north = frame.east + self._direction[0] * off_m, frame.north + self._direction[1] * off_m
        if frame.yaw:
            x, y = _turn(pose.x - frame.x, pose.y - frame.y, frame.yaw)
            east, north = east + frame.x + x - pose.x, north + frame.y + y - pose.y
        if (east, north, up_m, yaw) == (0.0, 0.0, 0.0, 0.0):
            return pose
        return Pose(x=pose.x + east, y=pose.y + north, z=pose.z + up_m, yaw=wrapped_sum(pose.yaw, yaw))

    def reading(self, believed: Pose, reading: tuple[int, int]) -> Pose:
        """What is told of a believed pose: the noise is drawn anew for each number of moves and looks."""
        sensor = self._sensor
        if not (sensor.horizontal_noise_m or sensor.vertical_noise_m or sensor.yaw_noise_deg):
            return believed
        x, y, z, yaw = np.random.default_rng((*self._noise_seeds, 2, *reading)).standard_normal(4).tolist()
        return Pose(
            x=believed.x + sensor.horizontal_noise_m * x,
            y=believed.y + sensor.horizontal_noise_m * y,
            z=believed.z + sensor.vertical_noise_m * z,
            yaw=wrapped_sum(believed.yaw, math.radians(sensor.yaw_noise_deg) * yaw),
        )

    def true(self, place: Point3) -> Point3:
        """The place that a believed one means."""
        frame = self._frame
        if frame[2:] == (0.0, 0.0, 0.0, 0.0):
            return place
        x, y = _turn(place.x - frame.east - frame.x, place.y - frame.north - frame.y, -frame.yaw)
        return Point3(x=frame.x + x, y=frame.y + y, z=place.z - frame.up)

    def true_yaw(self, yaw: float) -> float:
        """The heading that a believed one means."""
        return yaw - self._frame.yaw

    def uncertainty(self, way: Way) -> PoseUncertainty:
        """Standard deviations after all of the way that was flown."""
        sensor = self._sensor
        return PoseUncertainty(
            horizontal_m=math.hypot(sensor.horizontal_noise_m, self._drift * way.horizontal_m),
            vertical_m=math.hypot(sensor.vertical_noise_m, sensor.vertical_drift * way.path_m),
            yaw_rad=math.radians(math.hypot(sensor.yaw_noise_deg, sensor.yaw_drift_deg_per_m * way.horizontal_m)),
        )

    def _turned(self, way: Way) -> float:
        return self._turn_sign * math.radians(self._sensor.yaw_drift_deg_per_m) * way.horizontal_m


def wrapped_sum(a: float, b: float) -> float:
    """Of two angles, in (-pi, pi]; the first as it is where the second is 0."""
    return a if b == 0.0 else math.remainder(a + b, math.tau)


def _turn(x: float, y: float, angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return x * c - y * s, x * s + y * c
