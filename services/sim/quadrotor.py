"""A quadrotor's body in PyBullet, flown by a position controller through the wind.

It follows the kinematic course as well as thrust, tilt and wind let it: it lags, overshoots, and arrives near the place
rather than at it. The body has mass, inertia and drag; a controller of position and velocity asks for an acceleration,
within a bounded tilt and thrust, and a controller of attitude turns the body towards it. Metres, ENU.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.sim.bullet import pybullet
from services.sim.wind import DT_S, Gusts

Floats = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]

MASS_KG = 1.5
INERTIA_KG_M2 = 0.02
DRAG_N_S2_M2 = 0.037
"""Half the air's density times a drag area of 0.06 m2."""
GRAVITY_M_S2 = 9.81
TILT_MAX_RAD = math.radians(32.0)
THRUST_MAX = 1.9
"""Of the weight."""
_POSITION, _VELOCITY, _INTEGRAL, _FORWARD = 2.6, 2.7, 0.3, 0.75
_ATTITUDE, _RATE = 130.0, 18.0
_TURN_MAX_RAD_S2 = 80.0
_TRIM_MAX_M_S2 = 4.0


class Target(NamedTuple):
    """Where the controller wants the drone to be, how fast, how the speed is to change, and where its nose is to point
    (radians)."""

    place: Floats
    velocity: Floats
    acceleration: Floats
    yaw: float


class BodyState(NamedTuple):
    """position (3,) m, velocity (3,) m/s, orientation (x, y, z, w), spin (3,) rad/s; `trim` (3,) m/s2: what the
    controller has learnt to lean against."""

    position: Floats
    velocity: Floats
    orientation: Quaternion
    spin: Floats
    trim: Floats

    @property
    def yaw(self) -> float:
        return float(pybullet.getEulerFromQuaternion(self.orientation)[2])


Reference = Callable[[float], Target]


def at_rest(position: tuple[float, float, float], yaw: float, wind: Floats) -> BodyState:
    """Hovering, and leaning against the mean wind already."""
    push = DRAG_N_S2_M2 * float(np.linalg.norm(wind)) * wind / MASS_KG
    lean = pybullet.getQuaternionFromEuler((0.0, 0.0, yaw))
    return BodyState(np.array(position), np.zeros(3), lean, np.zeros(3), -push)


@contextmanager
def body(state: BodyState) -> Iterator["Body"]:
    """A body of its own in a physics client of its own."""
    client = pybullet.connect(pybullet.DIRECT)
    if client < 0:
        raise RuntimeError("PyBullet has no physics client left")
    try:
        yield Body(client, state)
    finally:
        pybullet.disconnect(client)


class Body:
    """Advanced in steps of DT_S. `effort_s`: seconds of hovering that cost as much as what was flown so far."""

    def __init__(self, client: int, state: BodyState) -> None:
        self._client = client
        self._trim = state.trim.copy()
        self.effort_s = 0.0
        pybullet.setGravity(0.0, 0.0, -GRAVITY_M_S2, physicsClientId=client)
        pybullet.setTimeStep(DT_S, physicsClientId=client)
        self._body = pybullet.createMultiBody(
            MASS_KG, -1, basePosition=state.position.tolist(), baseOrientation=state.orientation, physicsClientId=client
        )
        pybullet.changeDynamics(
            self._body,
            -1,
            localInertiaDiagonal=(INERTIA_KG_M2,) * 3,
            linearDamping=0.0,
            angularDamping=0.0,
            physicsClientId=client,
        )
        pybullet.resetBaseVelocity(self._body, state.velocity.tolist(), state.spin.tolist(), physicsClientId=client)

    def state(self) -> BodyState:
        place, orientation = pybullet.getBasePositionAndOrientation(self._body, physicsClientId=self._client)
        velocity, spin = pybullet.getBaseVelocity(self._body, physicsClientId=self._client)
        return BodyState(np.array(place), np.array(velocity), tuple(orientation), np.array(spin), self._trim.copy())

    def step(self, target: Target, gusts: Gusts) -> None:
        """One step towards `target`, in the wind of this moment."""
        now = self.state()
        gap = target.place - now.position
        self._trim = np.clip(self._trim + _INTEGRAL * DT_S * gap, -_TRIM_MAX_M_S2, _TRIM_MAX_M_S2)
        wanted = _POSITION * gap + _VELOCITY * (target.velocity - now.velocity) + self._trim
        wanted = wanted + _FORWARD * target.acceleration
        thrust = _bounded(wanted + np.array((0.0, 0.0, GRAVITY_M_S2)))
        axes = np.array(pybullet.getMatrixFromQuaternion(now.orientation)).reshape(3, 3)
        up = axes[:, 2]
        push = MASS_KG * min(THRUST_MAX * GRAVITY_M_S2, max(0.0, float(thrust @ up)))
        through = gusts.next() - now.velocity
        force = push * up + DRAG_N_S2_M2 * float(np.linalg.norm(through)) * through
        self._apply(force, INERTIA_KG_M2 * _turning(axes, thrust, target.yaw, now.spin), now.position)
        self.effort_s += DT_S * (push / (MASS_KG * GRAVITY_M_S2)) ** 1.5

    def _apply(self, force: Floats, torque: Floats, position: Floats) -> None:
        client = self._client
        pybullet.applyExternalForce(
            self._body, -1, force.tolist(), position.tolist(), pybullet.WORLD_FRAME, physicsClientId=client
        )
        pybullet.applyExternalTorque(self._body, -1, torque.tolist(), pybullet.WORLD_FRAME, physicsClientId=client)
        pybullet.stepSimulation(physicsClientId=client)


def _bounded(wanted: Floats) -> Floats:
    """An acceleration of thrust, tilted no more than the drone may; it always pushes up."""
    up = min(THRUST_MAX * GRAVITY_M_S2, max(0.3 * GRAVITY_M_S2, float(wanted[2])))
    level = wanted[:2]
    most = up * math.tan(TILT_MAX_RAD)
    length = float(np.hypot(*level))
    if length > most:
        level = level * (most / length)
    return np.array((level[0], level[1], up))


def _turning(axes: Floats, thrust: Floats, yaw: float, spin: Floats) -> Floats:
    """(3,) rad/s2 in the world's axes: the body's up towards the thrust, its nose towards the yaw."""
    wanted_up = thrust / np.linalg.norm(thrust)
    lean = np.cross(axes[:, 2], wanted_up)
    off = math.remainder(yaw - math.atan2(axes[1, 0], axes[0, 0]), math.tau)
    turning = _ATTITUDE * (lean + np.array((0.0, 0.0, 0.6 * off))) - _RATE * spin
    most = float(np.linalg.norm(turning))
    return np.asarray(turning * min(1.0, _TURN_MAX_RAD_S2 / max(most, 1e-9)))
