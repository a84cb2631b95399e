"""What moves about a drone by the clock, and may run into it on its way."""

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from episode_kit.trajectory import Course, Flown

STEP_S = 0.02
"""A drone on its way is held against what moves as often as this."""


class Met(NamedTuple):
    """At which of the times asked about something first touches, and its name."""

    at: int
    name: str


class Movers(Protocol):
    """Whatever moves in a drone's world."""

    def met(self, places: NDArray[np.float64], time_s: NDArray[np.float64]) -> Met | None:
        """What first touches a drone that is at places (T, 3) metres at these seconds (T,) of flight."""
        ...


def met_on_the_way(movers: Movers, course: Course, begun_s: float, from_s: float, until_s: float) -> Flown | None:
    """The part of a course that was begun at `begun_s` of all flight, as far as something that moves cuts it short
    between `from_s` and `until_s` of its own time; null: it doesn't. Looked at in the same moments however often it is
    asked."""
    first, last = math.ceil(from_s / STEP_S), math.floor(min(until_s, course.duration_s) / STEP_S)
    times = [k * STEP_S for k in range(first, last + 1)]
    if until_s >= course.duration_s:
        times.append(course.duration_s)
    flown = [course.at(time_s) for time_s in times]
    return _cut(movers, flown, [begun_s + time_s for time_s in times])


def met_braking(movers: Movers, course: Course, begun_s: float, told_s: float) -> Flown | None:
    """The same for the way on which it brakes, told to stop at `told_s`."""
    before, after = course.at(told_s), course.stopped_at(told_s)
    lasts_s = after.flight_s - before.flight_s
    shares = np.linspace(0.0, 1.0, max(2, math.ceil(lasts_s / STEP_S) + 1))
    flown = [_between(before, after, float(share)) for share in shares]
    return _cut(movers, flown, [begun_s + f.flight_s for f in flown])


def _between(before: Flown, after: Flown, share: float) -> Flown:
    """Slowing evenly from one to the other, `share` of the time in between gone."""
    way = 1.0 - (1.0 - share) ** 2
    if share == 1.0:
        return after
    a, b = before.pose, after.pose
    place = {axis: getattr(a, axis) + way * (getattr(b, axis) - getattr(a, axis)) for axis in ("x", "y", "z")}
    return before._replace(
        pose=a.model_copy(update=place),
        path_m=before.path_m + way * (after.path_m - before.path_m),
        path_horizontal_m=before.path_horizontal_m + way * (after.path_horizontal_m - before.path_horizontal_m),
        flight_s=before.flight_s + share * (after.flight_s - before.flight_s),
    )


def _cut(movers: Movers, flown: list[Flown], time_s: list[float]) -> Flown | None:
    if not flown:
        return None
    places = np.array([(f.pose.x, f.pose.y, f.pose.z) for f in flown])
    met = movers.met(places, np.array(time_s))
    return None if met is None else flown[met.at]._replace(hit=met.name)
