"""How the stand-in's drone moves: a quadrotor as its position controller lets it, with wind, noise and the ground.

NED as autopilots have it: x north, y east, z down, metres; yaw clockwise from north, radians.
"""

import math
import random
from dataclasses import dataclass, field

DT_S = 0.01
Vector = list[float]


@dataclass
class Limits:
    """As PX4's usual parameters."""

    speed_m_s: float = 12.0
    up_m_s: float = 3.0
    down_m_s: float = 1.5
    acceleration_m_s2: float = 5.0
    yaw_rate_rad_s: float = 1.2


@dataclass
class Body:
    """`position`: as the autopilot estimates it. The position controller asks for a speed, which the body takes on with
    a delay, so that it overshoots. `push`: what the wind adds to its speed."""

    position: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])
    velocity: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])
    yaw: float = 0.0
    ground_m: float = 0.0
    limits: Limits = field(default_factory=Limits)
    push: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])
    noise_m: float = 0.02
    chance: random.Random = field(default_factory=lambda: random.Random(1))
    _asked: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])
    _learnt: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])
    _wander: Vector = field(default_factory=lambda: [0.0, 0.0, 0.0])

    @property
    def height_m(self) -> float:
        return self.ground_m - self.position[2]

    @property
    def measured(self) -> Vector:
        return [p + w for p, w in zip(self.position, self._wander, strict=True)]

    def step(self, target: Vector | None, yaw: float | None, down_m_s: float | None = None) -> None:
        """DT_S on towards `target`; `down_m_s` in place of its height. Without a target it stands, or falls."""
        for axis in range(3):
            self._wander[axis] += -0.5 * DT_S * self._wander[axis] + self.chance.gauss(0.0, self.noise_m) * DT_S**0.5
        if target is None:
            self.velocity, self._learnt = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            return
        gap = [t - p for t, p in zip(target, self.position, strict=True)]
        if down_m_s is not None:
            self._learnt[2] = 0.0  # what holding a height has learnt is of no use for sinking, and could undo it
        for axis in range(2 if down_m_s is not None else 3):
            self._learnt[axis] = max(-2.0, min(2.0, self._learnt[axis] + 0.25 * DT_S * max(-1.0, min(1.0, gap[axis]))))
        level = [0.95 * gap[0], 0.95 * gap[1]]
        fast = math.hypot(*level)
        if fast > self.limits.speed_m_s:
            level = [v * self.limits.speed_m_s / fast for v in level]
        down = down_m_s if down_m_s is not None else max(-self.limits.up_m_s, min(self.limits.down_m_s, 1.0 * gap[2]))
        wanted = [*level, down]
        for axis in range(3):
            # the attitude loop's delay, then the body's
            self._asked[axis] += (wanted[axis] - self._asked[axis]) * DT_S / 0.15
            change = (self._asked[axis] + self._learnt[axis] + self.push[axis] - self.velocity[axis]) / 0.3
            most = self.limits.acceleration_m_s2
            self.velocity[axis] += max(-most, min(most, change)) * DT_S
            self.position[axis] += self.velocity[axis] * DT_S
        if self.position[2] > self.ground_m:
            self.position[2], self.velocity = self.ground_m, [0.0, 0.0, 0.0]
        if yaw is not None:
            off = math.remainder(yaw - self.yaw, math.tau)
            most = self.limits.yaw_rate_rad_s * DT_S
            self.yaw = math.remainder(self.yaw + max(-most, min(most, 2.5 * off * DT_S)), math.tau)
