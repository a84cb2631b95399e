"""What an agent may do at each step, as a space of Gymnasium, and the move that it is to the simulator."""

import math
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from gymnasium import spaces

from contracts.geometry import Point3, Pose
from contracts.vehicle import Move

ActionSpace = Literal["discrete", "waypoint"]

DISCRETE = ("stop", "forward", "turn_left", "turn_right", "up", "down", "left", "right")
"""The discrete actions, by their numbers."""
FARTHEST_M, HIGHEST_M = 10.0, 5.0
SURE = 0.5
"""From which `stop` of a waypoint is meant."""


class Strides(NamedTuple):
    """How far one discrete action goes."""

    level_m: float = 2.0
    up_m: float = 1.0
    turn_deg: float = 15.0


class Actions(Protocol):
    """A space of actions; `move` is None for the one that ends the episode."""

    @property
    def space(self) -> spaces.Space[Any]: ...

    def move(self, action: Any, pose: Pose) -> Move | None:
        """Raises ValueError for an action that is not in the space."""
        ...


class DiscreteActions:
    """`DISCRETE`, one at a time."""

    def __init__(self, strides: Strides) -> None:
        self.space = spaces.Discrete(len(DISCRETE))
        self._strides = strides

    def move(self, action: Any, pose: Pose) -> Move | None:
        if not self.space.contains(action):
            names = ", ".join(DISCRETE)
            raise ValueError(f"an action is a number from 0 to {len(DISCRETE) - 1} ({names}), not {action!r}")
        name, stride = DISCRETE[int(action)], self._strides
        turn = math.radians(stride.turn_deg)
        match name:
            case "stop":
                return None
            case "turn_left":
                return moved(pose, turn=turn)
            case "turn_right":
                return moved(pose, turn=-turn)
            case "up":
                return moved(pose, up_m=stride.up_m)
            case "down":
                return moved(pose, up_m=-stride.up_m)
            case "forward":
                return moved(pose, forward_m=stride.level_m)
            case "left":
                return moved(pose, right_m=-stride.level_m)
            case _:
                return moved(pose, right_m=stride.level_m)


class WaypointActions:
    """Five numbers from -1 to 1 in the nose frame: forward and to the right (1 is `FARTHEST_M`), up (`HIGHEST_M`), how
    far to turn counter-clockwise when there (half a turn), and whether to stop (from `SURE` on; then the others do
    nothing)."""

    def __init__(self) -> None:
        self.space = spaces.Box(-1.0, 1.0, (5,), np.float32)

    def move(self, action: Any, pose: Pose) -> Move | None:
        numbers = np.asarray(action, np.float32)
        if not self.space.contains(numbers):
            raise ValueError(f"an action is five numbers from -1 to 1 (forward, right, up, turn, stop), not {action!r}")
        forward, right, up, turn, stop = (float(number) for number in numbers)
        if stop >= SURE:
            return None
        return moved(
            pose,
            forward_m=forward * FARTHEST_M,
            right_m=right * FARTHEST_M,
            up_m=up * HIGHEST_M,
            turn=turn * math.pi,
        )


def moved(pose: Pose, *, forward_m: float = 0.0, right_m: float = 0.0, up_m: float = 0.0, turn: float = 0.0) -> Move:
    """A straight leg in the nose frame, then a turn (radians, counter-clockwise); without a leg only the turn."""
    yaw = math.remainder(pose.yaw + turn, math.tau)
    if forward_m == right_m == up_m == 0.0:
        return Move(yaw=yaw)
    x = pose.x + forward_m * math.cos(pose.yaw) + right_m * math.sin(pose.yaw)
    y = pose.y + forward_m * math.sin(pose.yaw) - right_m * math.cos(pose.yaw)
    return Move(path=(Point3(x=x, y=y, z=pose.z + up_m),), yaw=yaw)


def actions_of(space: ActionSpace, strides: Strides) -> Actions:
    """Raises ValueError for a space that there is not."""
    if space == "discrete":
        return DiscreteActions(strides)
    if space == "waypoint":
        return WaypointActions()
    raise ValueError(f"action_space: there are 'discrete' and 'waypoint', not {space!r}")
