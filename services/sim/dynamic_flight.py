"""A flight by dynamics, flown in advance to its end, as a kinematic one is planned: what it will do among things that
stand still is known as soon as the wind is drawn. It may be broken off at any moment, also by what moves
(`episode_kit.encounters`)."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Pose
from contracts.scene import Wind
from contracts.sim import Flight
from episode_kit.kinematics import Vector, wrapped
from episode_kit.trajectory import Flown, Sweep, Sweeper, Trajectory, plan
from services.sim.quadrotor import Body, BodyState, Reference, Target, at_rest, body
from services.sim.wind import DT_S, Gusts, mean_wind

STEPS_A_SAMPLE = 10
SETTLE_MAX_S = 6.0
NEAR_M, SQUARE_RAD, SLOW_M_S, CALM_S = 0.12, 0.03, 0.2, 0.3
"""The drone has arrived when it stays so near, turned so exactly and so slow for so long."""


class _Sample(NamedTuple):
    time_s: float
    state: BodyState
    path_m: float
    horizontal_m: float
    effort_s: float

    def flown(self, hit: str | None = None) -> Flown:
        x, y, z = self.state.position.tolist()
        pose = Pose(x=x, y=y, z=z, yaw=wrapped(self.state.yaw))
        return Flown(pose, self.path_m, self.horizontal_m, self.time_s, hit, self.effort_s)


class _Open:
    """A sweeper of empty air: the course that is wanted, whatever is in its way."""

    def sweep(self, start: Vector, end: Vector) -> Sweep:
        return Sweep(math.dist(start, end), None)


class DynamicFlight:
    """Has what `episode_kit.trajectory.Trajectory` has."""

    def __init__(self, samples: list[_Sample], hit: str | None, brake: Callable[[_Sample], "DynamicFlight"]) -> None:
        self._samples = samples
        self._times = [sample.time_s for sample in samples]
        self._hit = hit
        self._brake = brake

    @property
    def duration_s(self) -> float:
        return self._times[-1]

    @property
    def end(self) -> Flown:
        return self._samples[-1].flown(self._hit)

    def at(self, time_s: float) -> Flown:
        if time_s >= self.duration_s:
            return self.end
        return self._before(time_s).flown()

    def stopped_at(self, time_s: float) -> Flown:
        return self.end if time_s >= self.duration_s else self._brake(self._before(time_s)).end

    def _before(self, time_s: float) -> _Sample:
        return self._samples[max(0, bisect_right(self._times, time_s) - 1)]


class Pilot:
    """Flies the body of one episode. `seeds`: of the wind, each flight draws its own."""

    def __init__(self, world: Sweeper, flight: Flight, wind: Wind, seeds: tuple[int, ...]) -> None:
        self._world = world
        self._flight = flight
        self._wind = wind
        self._seeds = seeds
        self._flights = 0

    def plan(self, pose: Pose, path: Sequence[Vector], yaw: float | None) -> DynamicFlight:
        """The flight from `pose` along `path`; the drone hovers at its start."""
        self._flights += 1
        course = plan(_Open(), self._flight, pose, path, yaw)
        start = at_rest((pose.x, pose.y, pose.z), pose.yaw, mean_wind(self._wind))
        first = _Sample(0.0, start, 0.0, 0.0, 0.0)
        return self._flown(first, _following(course), course.duration_s, (*self._seeds, self._flights))

    def _flown(self, first: _Sample, wanted: Reference, duration_s: float, seeds: tuple[int, ...]) -> DynamicFlight:
        gusts = Gusts(self._wind, seeds)
        samples, hit, calm_s = [first], None, 0.0
        with body(first.state) as drone:
            time_s = 0.0
            while hit is None and time_s < duration_s + SETTLE_MAX_S and calm_s < CALM_S:
                time_s = self._sampled(drone, wanted, gusts, time_s)
                sample, hit = self._swept(samples[-1], drone, first.time_s + time_s, first.effort_s)
                samples.append(sample)
                arrived = time_s >= duration_s and _calm(sample, wanted(time_s))
                calm_s = calm_s + STEPS_A_SAMPLE * DT_S if arrived else 0.0
        return DynamicFlight(samples, hit, lambda sample: self._braked(sample, (*seeds, 1)))

    def _sampled(self, drone: Body, wanted: Reference, gusts: Gusts, time_s: float) -> float:
        for _ in range(STEPS_A_SAMPLE):
            time_s += DT_S
            drone.step(wanted(time_s), gusts)
        return time_s

    def _swept(self, last: _Sample, drone: Body, time_s: float, effort_s: float) -> tuple[_Sample, str | None]:
        """The next sample, as far as nothing is in the way, and what is."""
        state = drone.state()
        a, b = last.state.position, state.position
        found = self._world.sweep((a[0], a[1], a[2]), (b[0], b[1], b[2]))
        if found.hit is not None:
            share = found.free_m / max(1e-9, float(np.linalg.norm(b - a)))
            state = state._replace(position=a + (b - a) * share)
        gap = state.position - a
        return (
            _Sample(
                time_s,
                state,
                last.path_m + float(np.linalg.norm(gap)),
                last.horizontal_m + float(np.hypot(gap[0], gap[1])),
                effort_s + drone.effort_s,
            ),
            found.hit,
        )

    def _braked(self, sample: _Sample, seeds: tuple[int, ...]) -> DynamicFlight:
        """As hard as it may, and then it holds."""
        state = sample.state
        speed = float(np.linalg.norm(state.velocity))
        slow = self._flight.max_acceleration_m_s2
        way = state.velocity / speed if speed > 0.0 else np.zeros(3)

        def stopping(time_s: float) -> Target:
            t = min(time_s, speed / slow)
            place = state.position + way * (speed * t - slow * t * t / 2.0)
            slowing = way * (-slow if time_s < speed / slow else 0.0)
            return Target(place, way * max(0.0, speed - slow * t), slowing, state.yaw)

        return self._flown(sample, stopping, speed / slow, seeds)


def _following(course: Trajectory) -> Reference:
    @lru_cache(maxsize=4)
    def place(step: int) -> tuple[NDArray[np.float64], float]:
        pose = course.at(step * DT_S).pose
        return np.array((pose.x, pose.y, pose.z)), pose.yaw

    def wanted(time_s: float) -> Target:
        step = round(time_s / DT_S)
        (here, yaw), (before, _), (earlier, _) = place(step), place(step - 1), place(step - 2)
        velocity = (here - before) / DT_S
        return Target(here, velocity, (velocity - (before - earlier) / DT_S) / DT_S, yaw)

    return wanted


def _calm(sample: _Sample, target: Target) -> bool:
    gap = float(np.linalg.norm(sample.state.position - target.place))
    off = abs(math.remainder(sample.state.yaw - target.yaw, math.tau))
    return gap < NEAR_M and off < SQUARE_RAD and float(np.linalg.norm(sample.state.velocity)) < SLOW_M_S
