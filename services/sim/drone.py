"""One numbered move: along its legs, stopped by whatever is in the way, then the turn."""

import math
from typing import NamedTuple, Protocol

from contracts.geometry import Pose
from contracts.sim import Flight, Move
from services.sim.kinematics import Vector, heading_of, speed_profile, straight_legs, turn_time_s, wrapped
from services.sim.world import Sweep


class Sweeper(Protocol):
    """What the drone needs of a world."""

    def sweep(self, start: Vector, end: Vector) -> Sweep: ...


class Flown(NamedTuple):
    """What came of a move. `path_m` is flown in 3-D, `path_horizontal_m` on the plan; `hit` names what stopped it."""

    pose: Pose
    path_m: float
    path_horizontal_m: float
    flight_s: float
    hit: str | None


def fly(world: Sweeper, flight: Flight, pose: Pose, move: Move) -> Flown:
    """Flies `move` from `pose`. A drone that hits something stays where it touched it and does not turn.

    Without a stated yaw the nose ends in the direction of the last horizontal travel, or stays as it is.
    """
    here: Vector = (pose.x, pose.y, pose.z)
    legs = straight_legs(here, [(p.x, p.y, p.z) for p in move.path])
    path_m = horizontal_m = flight_s = 0.0
    for leg in legs:
        profile = speed_profile(leg.length_m, flight.max_speed_m_s, flight.max_acceleration_m_s2)
        free_m, hit = world.sweep(leg.start, leg.end)
        here = leg.end if hit is None else leg.point_at(free_m)
        path_m += free_m
        horizontal_m += math.dist(leg.start[:2], here[:2])
        flight_s += profile.time_at(free_m)
        if hit is not None:
            return Flown(_pose(here, pose.yaw), path_m, horizontal_m, flight_s, hit)
    wanted = move.yaw if move.yaw is not None else heading_of(legs)
    yaw = pose.yaw if wanted is None else wanted
    flight_s += turn_time_s(pose.yaw, yaw, flight.max_yaw_rate_rad_s)
    return Flown(_pose(here, yaw), path_m, horizontal_m, flight_s, None)


def _pose(position: Vector, yaw: float) -> Pose:
    return Pose(x=position[0], y=position[1], z=position[2], yaw=wrapped(yaw))
