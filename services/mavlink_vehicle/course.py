"""The course of a move: where the set-point is at each moment, on straight legs with bounded speed and acceleration.

The set-point itself keeps to the limits and stops at every corner, so that the autopilot, which follows it by its own
controller, neither exceeds them nor cuts corners. The nose turns at the end, where the drone hovers. Metres, ENU,
radians.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from contracts.geometry import Point3, Pose
from services.mavlink_vehicle.frames import wrapped

SHORTEST_LEG_M = 1e-3


class FlightLimits(NamedTuple):
    """Of the set-point's motion; `climb_m_s` and `sink_m_s` of its upward and its downward part."""

    speed_m_s: float
    acceleration_m_s2: float
    yaw_rate_rad_s: float
    climb_m_s: float = math.inf
    sink_m_s: float = math.inf

    def along(self, start: Pose, end: Pose) -> "FlightLimits":
        """The limits of a leg: no faster than its upward or downward part may be."""
        steep = (end.z - start.z) / max(distance_m(start, end), SHORTEST_LEG_M)
        upright_m_s = self.climb_m_s if steep > 0.0 else self.sink_m_s
        most = upright_m_s / abs(steep) if abs(steep) > SHORTEST_LEG_M else math.inf
        return self._replace(speed_m_s=min(self.speed_m_s, most))


class Part(NamedTuple):
    """A leg, or a turn on the spot, and when it begins: seconds of the course."""

    start: Pose
    end: Pose
    duration_s: float

    @property
    def length_m(self) -> float:
        return distance_m(self.start, self.end)


class Course(NamedTuple):
    """Parts in their order; each is begun when the drone has come to the end of the one before."""

    parts: tuple[Part, ...]
    limits: FlightLimits

    @property
    def duration_s(self) -> float:
        return sum(part.duration_s for part in self.parts)

    def at(self, part: Part, time_s: float) -> Pose:
        """The set-point `time_s` after a part was begun."""
        if time_s >= part.duration_s:
            return part.end
        if part.length_m < SHORTEST_LEG_M:
            turn = wrapped(part.end.yaw - part.start.yaw) * time_s / part.duration_s
            return part.start.model_copy(update={"yaw": wrapped(part.start.yaw + turn)})
        limits = self.limits.along(part.start, part.end)
        share = _distance_at(time_s, part.length_m, limits) / part.length_m
        return _between(part.start, part.end, share)

    def stop(self, part: Part, time_s: float) -> Pose:
        """Where the set-point comes to a stop when it brakes `time_s` after a part was begun."""
        here = self.at(part, time_s)
        if part.length_m < SHORTEST_LEG_M:
            return here
        later = self.at(part, time_s + 0.01)
        speed = distance_m(here, later) / 0.01
        brake_m = speed**2 / (2.0 * self.limits.acceleration_m_s2)
        share = min(1.0, (distance_m(part.start, here) + brake_m) / part.length_m)
        return _between(part.start, part.end, share)


def course(start: Pose, path: Sequence[Point3], yaw: float | None, limits: FlightLimits) -> Course:
    """From `start` along `path`; then the nose turns to `yaw`, or to where the last level leg went."""
    here, parts, heading = start, [], None
    for corner in path:
        there = Pose(x=corner.x, y=corner.y, z=corner.z, yaw=start.yaw)
        length_m = distance_m(here, there)
        if length_m < SHORTEST_LEG_M:
            continue
        parts.append(Part(here, there, _duration_s(length_m, limits.along(here, there))))
        if math.dist((here.x, here.y), (there.x, there.y)) > SHORTEST_LEG_M:
            heading = math.atan2(there.y - here.y, there.x - here.x)
        here = there
    wanted = yaw if yaw is not None else heading
    turn = 0.0 if wanted is None else wrapped(wanted - here.yaw)
    if turn:
        end = here.model_copy(update={"yaw": wrapped(here.yaw + turn)})
        parts.append(Part(here, end, abs(turn) / limits.yaw_rate_rad_s))
    return Course(tuple(parts), limits)


def distance_m(a: Pose, b: Pose) -> float:
    return math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))


def _between(a: Pose, b: Pose, share: float) -> Pose:
    x, y, z = (p + (q - p) * share for p, q in ((a.x, b.x), (a.y, b.y), (a.z, b.z)))
    return Pose(x=x, y=y, z=z, yaw=a.yaw)


def _top_speed(length_m: float, limits: FlightLimits) -> float:
    return min(limits.speed_m_s, math.sqrt(length_m * limits.acceleration_m_s2))


def _duration_s(length_m: float, limits: FlightLimits) -> float:
    top = _top_speed(length_m, limits)
    return length_m / top + top / limits.acceleration_m_s2


def _distance_at(time_s: float, length_m: float, limits: FlightLimits) -> float:
    """Speeding up, steady, slowing down."""
    top, slow = _top_speed(length_m, limits), limits.acceleration_m_s2
    ramp_s, whole_s = top / slow, _duration_s(length_m, limits)
    if time_s < ramp_s:
        return slow * time_s**2 / 2.0
    if time_s < whole_s - ramp_s:
        return top * (time_s - ramp_s / 2.0)
    return length_m - slow * max(0.0, whole_s - time_s) ** 2 / 2.0
