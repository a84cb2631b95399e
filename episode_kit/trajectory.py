"""A flight planned to its end: straight legs, stopped by whatever is in the way, then the turn.

What stands in a scene stands still, so a flight's course is known as soon as it is planned, contacts with it included.
It is then flown along this course, and may be broken off at any moment: by what moves (`episode_kit.encounters`), or by
whoever tells the drone to stop, which then brakes as hard as it may.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from contracts.geometry import Pose
from contracts.sim import Flight
from episode_kit.kinematics import (
    Leg,
    SpeedProfile,
    Vector,
    heading_of,
    speed_profile,
    straight_legs,
    turn_time_s,
    wrapped,
)


class Sweep(NamedTuple):
    """How far the sphere came along a straight line, and what stopped it (null: nothing did)."""

    free_m: float
    hit: str | None


class Sweeper(Protocol):
    """What the drone needs of a world."""

    def sweep(self, start: Vector, end: Vector) -> Sweep: ...


class Flown(NamedTuple):
    """How far a flight came. `path_m` is flown in 3-D, `path_horizontal_m` on the plan; `hit` names what stopped it.
    `effort_s`: seconds of hovering that cost as much, null where that is the flight's own time."""

    pose: Pose
    path_m: float
    path_horizontal_m: float
    flight_s: float
    hit: str | None
    effort_s: float | None = None


class Course(Protocol):
    """A flight that was planned to its end. Times are seconds of flight since it was begun."""

    @property
    def duration_s(self) -> float: ...

    @property
    def end(self) -> Flown:
        """Flown as far as it goes."""
        ...

    def at(self, time_s: float) -> Flown:
        """On the way; the end from `duration_s` on."""
        ...

    def stopped_at(self, time_s: float) -> Flown:
        """Where the drone stands when it was told to stop at that time. It may still hit what lies within the way it
        needs to brake."""
        ...


class Planner(Protocol):
    """Who flies a drone."""

    def plan(self, pose: Pose, path: Sequence[Vector], yaw: float | None) -> Course:
        """The flight from `pose` along the corners of `path`, then to `yaw` (radians). Without a stated yaw the nose
        ends in the direction of the last horizontal travel, or stays as it is."""
        ...


class _SweptLeg(NamedTuple):
    """A leg, how it is flown, how far it is free, and what ends it there."""

    leg: Leg
    profile: SpeedProfile
    free_m: float
    hit: str | None

    @property
    def duration_s(self) -> float:
        return self.profile.time_at(self.free_m)

    def point_at(self, distance_m: float) -> Vector:
        """The leg's own end where it is flown to it: no rounding."""
        whole = self.hit is None and distance_m >= self.free_m
        return self.leg.end if whole else self.leg.point_at(distance_m)


class _Part(NamedTuple):
    """How much of a leg was flown, and for how long."""

    distance_m: float
    time_s: float


class Trajectory:
    """The course of one kinematic flight over time."""

    def __init__(self, start: Pose, legs: Sequence[_SweptLeg], yaw: float, flight: Flight) -> None:
        self._start = start
        self._legs = legs
        self._yaw = yaw
        self._acceleration_m_s2 = flight.max_acceleration_m_s2
        self._yaw_rate_rad_s = flight.max_yaw_rate_rad_s
        self._stopped = bool(legs) and legs[-1].hit is not None
        turn_s = 0.0 if self._stopped else turn_time_s(start.yaw, yaw, flight.max_yaw_rate_rad_s)
        self.duration_s = sum((leg.duration_s for leg in legs), 0.0) + turn_s

    @property
    def end(self) -> Flown:
        return self._at(math.inf, brakes=False)

    def at(self, time_s: float) -> Flown:
        return self._at(time_s, brakes=False)

    def stopped_at(self, time_s: float) -> Flown:
        return self._at(time_s, brakes=True)

    def _at(self, time_s: float, *, brakes: bool) -> Flown:
        here: Vector = (self._start.x, self._start.y, self._start.z)
        path_m = horizontal_m = flight_s = 0.0
        for swept in self._legs:
            begun_s = flight_s
            flown_m = swept.free_m
            if time_s < begun_s + swept.duration_s:
                flown_m, spent_s = self._partly(swept, time_s - begun_s, brakes)
                flight_s += spent_s
            else:
                flight_s += swept.duration_s
            here = swept.point_at(flown_m)
            path_m += flown_m
            horizontal_m += math.dist(swept.leg.start[:2], here[:2])
            hit = swept.hit if flown_m >= swept.free_m else None
            if hit is not None or time_s < begun_s + swept.duration_s:
                return Flown(_pose(here, self._start.yaw), path_m, horizontal_m, flight_s, hit)
        turn_s = turn_time_s(self._start.yaw, self._yaw, self._yaw_rate_rad_s)
        if time_s - flight_s >= turn_s:
            return Flown(_pose(here, self._yaw), path_m, horizontal_m, flight_s + turn_s, None)
        part = wrapped(self._yaw - self._start.yaw) * (time_s - flight_s) / turn_s
        return Flown(_pose(here, self._start.yaw + part), path_m, horizontal_m, time_s, None)

    def _partly(self, swept: _SweptLeg, time_s: float, brakes: bool) -> _Part:
        """Of a leg that was broken off after `time_s`."""
        distance_m = swept.profile.distance_at(time_s)
        if not brakes:
            return _Part(distance_m, time_s)
        speed = swept.profile.speed_at(time_s)
        stop_m = distance_m + speed**2 / (2.0 * self._acceleration_m_s2)
        if stop_m < swept.free_m:
            return _Part(stop_m, time_s + speed / self._acceleration_m_s2)
        if swept.hit is None:
            return _Part(swept.free_m, swept.duration_s)
        left_m = swept.free_m - distance_m
        at_contact = math.sqrt(max(0.0, speed**2 - 2.0 * self._acceleration_m_s2 * left_m))
        return _Part(swept.free_m, time_s + (speed - at_contact) / self._acceleration_m_s2)


def plan(world: Sweeper, flight: Flight, pose: Pose, path: Sequence[Vector], yaw: float | None) -> Trajectory:
    """The flight from `pose` along `path`. A drone that hits something stays where it touched it and does not turn.

    Without a stated yaw the nose ends in the direction of the last horizontal travel, or stays as it is.
    """
    legs = straight_legs((pose.x, pose.y, pose.z), path)
    swept = []
    for leg in legs:
        profile = speed_profile(leg.length_m, flight.max_speed_m_s, flight.max_acceleration_m_s2)
        free_m, hit = world.sweep(leg.start, leg.end)
        swept.append(_SweptLeg(leg, profile, free_m, hit))
        if hit is not None:
            break
    wanted = yaw if yaw is not None else heading_of(legs)
    return Trajectory(pose, swept, pose.yaw if wanted is None else wanted, flight)


class KinematicPlanner:
    """Flies exactly along the path."""

    def __init__(self, world: Sweeper, flight: Flight) -> None:
        self._world = world
        self._flight = flight

    def plan(self, pose: Pose, path: Sequence[Vector], yaw: float | None) -> Trajectory:
        return plan(self._world, self._flight, pose, path, yaw)


def _pose(position: Vector, yaw: float) -> Pose:
    return Pose(x=position[0], y=position[1], z=position[2], yaw=wrapped(yaw))
