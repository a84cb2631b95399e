"""How long a flight takes: straight legs under a bounded speed and acceleration, and turns at a bounded rate.

Pure mathematics, no simulator. The drone stands still at the start and the end of every straight leg: it stops at
each corner of its path (legs that run straight on are flown as one), and turns its nose only while it stands.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

Vector = tuple[float, float, float]

SAME_PLACE_M = 1e-6
STRAIGHT_ON_RAD = 1e-3
"""Two legs whose directions differ by less than this are one straight leg."""


class SpeedProfile(NamedTuple):
    """A trapezoid of speed over time: up for `ramp_s`, level at `peak_m_s` for `cruise_s`, down for `ramp_s`.

    A leg too short to reach the top speed has no level part and a lower peak.
    """

    length_m: float
    peak_m_s: float
    ramp_s: float
    cruise_s: float

    @property
    def duration_s(self) -> float:
        return 2.0 * self.ramp_s + self.cruise_s

    def distance_at(self, time_s: float) -> float:
        """Metres flown after `time_s`; 0 before the start, the whole length after the end."""
        if time_s <= 0.0 or self.length_m == 0.0:
            return 0.0
        if time_s >= self.duration_s:
            return self.length_m
        ramp_m = self.peak_m_s * self.ramp_s / 2.0
        if time_s < self.ramp_s:
            return ramp_m * (time_s / self.ramp_s) ** 2
        if time_s <= self.ramp_s + self.cruise_s:
            return ramp_m + self.peak_m_s * (time_s - self.ramp_s)
        left = (self.duration_s - time_s) / self.ramp_s
        return self.length_m - ramp_m * left**2

    def speed_at(self, time_s: float) -> float:
        """Metres a second after `time_s`; 0 before the start and after the end."""
        if time_s <= 0.0 or time_s >= self.duration_s:
            return 0.0
        return self.peak_m_s * min(1.0, time_s / self.ramp_s, (self.duration_s - time_s) / self.ramp_s)

    def time_at(self, distance_m: float) -> float:
        """Seconds until `distance_m` are flown; the inverse of `distance_at`."""
        if distance_m <= 0.0 or self.length_m == 0.0:
            return 0.0
        if distance_m >= self.length_m:
            return self.duration_s
        ramp_m = self.peak_m_s * self.ramp_s / 2.0
        if distance_m < ramp_m:
            return self.ramp_s * math.sqrt(distance_m / ramp_m)
        if distance_m <= self.length_m - ramp_m:
            return self.ramp_s + (distance_m - ramp_m) / self.peak_m_s
        return self.duration_s - self.ramp_s * math.sqrt((self.length_m - distance_m) / ramp_m)


class Leg(NamedTuple):
    """A straight piece of a path, from standstill to standstill."""

    start: Vector
    end: Vector

    @property
    def length_m(self) -> float:
        return math.dist(self.start, self.end)

    def point_at(self, distance_m: float) -> Vector:
        """The point `distance_m` from the start along the leg."""
        share = min(1.0, max(0.0, distance_m / self.length_m))
        x, y, z = (a + (b - a) * share for a, b in zip(self.start, self.end, strict=True))
        return x, y, z


def speed_profile(length_m: float, max_speed_m_s: float, max_acceleration_m_s2: float) -> SpeedProfile:
    """The fastest way over `length_m` from standstill to standstill within both bounds."""
    if length_m <= 0.0:
        return SpeedProfile(0.0, 0.0, 0.0, 0.0)
    peak = min(max_speed_m_s, math.sqrt(length_m * max_acceleration_m_s2))
    ramp_s = peak / max_acceleration_m_s2
    return SpeedProfile(length_m, peak, ramp_s, max(0.0, length_m / peak - ramp_s))


def straight_legs(start: Vector, path: Sequence[Vector]) -> list[Leg]:
    """The path's legs from `start` on, without those of no length, and with those that run straight on joined."""
    legs: list[Leg] = []
    here = start
    for point in path:
        if math.dist(here, point) < SAME_PLACE_M:
            continue
        leg = Leg(here, point)
        if legs and _bend(legs[-1], leg) < STRAIGHT_ON_RAD:
            leg = Leg(legs.pop().start, point)
        legs.append(leg)
        here = point
    return legs


def heading_of(legs: Sequence[Leg]) -> float | None:
    """The direction of the last horizontal travel, radians counter-clockwise from east; null if there is none."""
    for leg in reversed(legs):
        dx, dy = leg.end[0] - leg.start[0], leg.end[1] - leg.start[1]
        if math.hypot(dx, dy) > 1e-3:
            return math.atan2(dy, dx)
    return None


def wrapped(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned == -math.pi else turned


def turn_time_s(from_yaw: float, to_yaw: float, max_yaw_rate_rad_s: float) -> float:
    """Seconds to turn the shorter way round at a constant rate."""
    return abs(wrapped(to_yaw - from_yaw)) / max_yaw_rate_rad_s


def _bend(a: Leg, b: Leg) -> float:
    u = [(q - p) / a.length_m for p, q in zip(a.start, a.end, strict=True)]
    v = [(q - p) / b.length_m for p, q in zip(b.start, b.end, strict=True)]
    # the chord between two unit vectors keeps its precision where acos of a product near 1 does not
    return 2.0 * math.asin(min(1.0, math.dist(u, v) / 2.0))
