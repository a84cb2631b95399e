"""From where a task's pictures are taken: places and yaws, drawn from the task's seed and nothing else."""

import math
from typing import NamedTuple, Protocol

import numpy as np

from contracts.geometry import Pose
from contracts.scene import Scene
from contracts.scene_layout import facades, floor_outline, wall_height_m
from evaluation.scene_generator.footprints import distance_to_outline
from evaluation.task_set.shortest import goal_slot

CLEAR_M = 2.5
RING_M = (5.5, 10.5)
BEFORE_GOAL_M = (3.5, 24.0)
ASIDE_RAD = math.radians(65)
YAW_JITTER = 0.25
_DRAWS = 60


class Searched(Protocol):
    """A scene whose goal is looked for on one floor; a Task is one."""

    @property
    def scene(self) -> Scene: ...
    @property
    def floor(self) -> int: ...
    @property
    def floor_height_m(self) -> float: ...


class Stop(NamedTuple):
    """Metres and radians, ENU."""

    x: float
    y: float
    z: float
    yaw: float


def before_goal(
    task: Searched, count: int, rng: np.random.Generator, range_m: tuple[float, float] = BEFORE_GOAL_M
) -> list[Stop]:
    """Where the goal's window is in front: any distance and angle a mission meets it at, in any of the five views."""
    slot = goal_slot(task.scene)
    out = math.atan2(slot.normal[1], slot.normal[0])
    stops: list[Stop] = []
    for _ in range(_DRAWS * count):
        if len(stops) == count:
            break
        # as many near ones as far ones: the area grows with the distance, what a mission sees does not
        away, turn = float(rng.uniform(*range_m)), float(rng.uniform(-ASIDE_RAD, ASIDE_RAD))
        x, y = slot.centre[0] + away * math.cos(out + turn), slot.centre[1] + away * math.sin(out + turn)
        if not is_clear(task.scene, x, y):
            continue
        z = max(1.0, slot.centre[2] + float(rng.uniform(-1.2, 1.2)))
        seen_at = float(rng.uniform(-math.radians(130), math.radians(130)))
        stops.append(Stop(x, y, z, out + turn + math.pi + seen_at))
    return stops


def on_lap(task: Searched, count: int, rng: np.random.Generator) -> list[Stop]:
    """On the ring about the building at the goal's floor, the building on the right: a clockwise lap's stops."""
    building = task.scene.building(task.scene.target)
    walls = facades(building)
    outline = floor_outline(building, 1)
    stops: list[Stop] = []
    for _ in range(_DRAWS * count):
        if len(stops) == count:
            break
        wall = walls[int(rng.integers(len(walls)))]
        along, off = float(rng.uniform(-3, wall.length_m + 3)), float(rng.uniform(*RING_M))
        x, y = (wall.start[i] + wall.along[i] * along + wall.normal[i] * off for i in (0, 1))
        if not is_clear(task.scene, x, y) or distance_to_outline((x, y), outline) > RING_M[1]:
            continue
        facing = math.atan2(-wall.normal[1], -wall.normal[0])
        z = max(1.0, (task.floor - 0.5) * task.floor_height_m + float(rng.uniform(-0.6, 0.6)))
        stops.append(Stop(x, y, z, facing + math.pi / 2 + float(rng.uniform(-YAW_JITTER, YAW_JITTER))))
    return stops


def before_start(task: Searched, count: int, rng: np.random.Generator) -> list[Stop]:
    """Squarely before the starting facade where the drone stands, at the middles of the bands of eq. 3, then anywhere
    up the wall."""
    start = task.scene.start
    building = task.scene.building(task.scene.target)
    off = distance_to_outline((start.position.x, start.position.y), floor_outline(building, 1))
    top = wall_height_m(building)
    bands = [off * (2 * k + 1) for k in range(max(1, math.ceil(top / (2 * off))))]
    heights = list(rng.permutation(bands)[:count])
    heights += [float(rng.uniform(1.2, max(1.3, top))) for _ in range(count - len(heights))]
    return [Stop(start.position.x, start.position.y, float(z), start.yaw) for z in heights]


def is_clear(scene: Scene, x: float, y: float) -> bool:
    """At least `CLEAR_M` from every building's walls on the plan."""
    return all(distance_to_outline((x, y), tuple((p.x, p.y) for p in b.footprint)) >= CLEAR_M for b in scene.buildings)


def reached(stop: Stop, pose: Pose) -> bool:
    """The drone got there."""
    return math.dist((stop.x, stop.y, stop.z), (pose.x, pose.y, pose.z)) < 0.1
