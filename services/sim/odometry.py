"""Where the drone believes it is: the true place, and an error that grows with the way flown."""

import math

import numpy as np

from contracts.geometry import Point3, Pose


class Odometry:
    """The error is `drift` (a share, 0.01 is a metre in a hundred) of the level way flown, in a direction drawn once
    from the seeds; heights and headings are exact. The drone is told its believed place and is sent to places in the
    same frame, so what it sees beside it lies where it says."""

    def __init__(self, drift: float, seeds: tuple[int, ...]) -> None:
        self._drift = drift
        course = np.random.default_rng(seeds).uniform(0.0, math.tau)
        self._direction = math.cos(course), math.sin(course)
        self._off_m = 0.0

    def flown(self, horizontal_m: float) -> None:
        """So much more of the way is behind the drone, metres on the ground plan."""
        self._off_m += self._drift * horizontal_m

    def believed(self, pose: Pose, further_m: float = 0.0) -> Pose:
        """The pose that is reported for a true one, `further_m` of level way after the last flight that `flown` was
        told of."""
        off_m = self._off_m + self._drift * further_m
        if off_m == 0.0:
            return pose
        east, north = self._direction[0] * off_m, self._direction[1] * off_m
        return pose.model_copy(update={"x": pose.x + east, "y": pose.y + north})

    def true(self, place: Point3) -> Point3:
        """The place that a believed one means."""
        if self._off_m == 0.0:
            return place
        east, north = self._direction[0] * self._off_m, self._direction[1] * self._off_m
        return Point3(x=place.x - east, y=place.y - north, z=place.z)
