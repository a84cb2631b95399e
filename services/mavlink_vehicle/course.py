"""The course of a move: where the set-point is at each moment, on straight legs with bounded speed and acceleration.

The set-point itself keeps to the limits and stops at every corner, so that the autopilot, which follows it by its own
controller, neither exceeds them nor cuts corners. The nose turns at the end, where the drone hovers. Metres, ENU,
radians.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from contracts.geometry import Point3, Pose
from episode_kit.kinematics import SpeedProfile, speed_profile, wrapped

SHORTEST_LEG_M = 1e-3


class FlightLimits(NamedTuple):
    """Of the set-point's motion; `climb_m_s` and `sink_m_s` of its upward and its downward part."""

    speed_m_s: float
    acceleration_m_s2: float
    yaw_rate_rad_s: float
    climb_m_s: float = math.inf
    sink_m_s: float = math.inf

    def profile(self, start: Pose, end: Pose) -> SpeedProfile:
        """The speed along a leg: no faster than its upward or downward part may be."""
        length_m = distance_m(start, end)
        steep = (end.z - start.z) / max(length_m, SHORTEST_LEG_M)
        upright_m_s = self.climb_m_s if steep > 0.0 else self.sink_m_s
        most = upright_m_s / abs(steep) if abs(steep) > SHORTEST_LEG_M else math.inf
        return speed_profile(length_m, min(self.speed_m_s, most), self.acceleration_m_s2)


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
        profile = self.limits.profile(part.start, part.end)
        return _between(part.start, part.end, profile.distance_at(time_s) / part.length_m)

    def stop(self, part: Part, time_s: float) -> Pose:
        """Where the set-point comes to a stop when it brakes `time_s` after a part was begun."""
        if part.length_m < SHORTEST_LEG_M:
            return self.at(part, time_s)
        profile = self.limits.profile(part.start, part.end)
        brake_m = profile.speed_at(time_s) ** 2 / (2.0 * self.limits.acceleration_m_s2)
        share = min(1.0, (profile.distance_at(time_s) + brake_m) / part.length_m)
        return _between(part.start, part.end, share)


def course(start: Pose, path: Sequence[Point3], yaw: float | None, limits: FlightLimits) -> Course:
    """From `start` along `path`; then the nose turns to `yaw`, or to where the last level leg went."""
    here, parts, heading = start, [], None
    for corner in path:
        there = Pose(x=corner.x, y=corner.y, z=corner.z, yaw=start.yaw)
        if distance_m(here, there) < SHORTEST_LEG_M:
            continue
        parts.append(Part(here, there, limits.profile(here, there).duration_s))
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
