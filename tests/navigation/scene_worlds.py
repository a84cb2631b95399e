"""Tasks of the task set as ray-cast worlds: the plans, balconies and neighbours of a scene, without a renderer.

Walls are upright and notched where the windows lie behind them; roofs and eaves are left out, railings are solid
plates, trees are poles as wide as their crowns.
"""

import numpy as np

from contracts.scene_layout import Facade, WindowSlot, facades, floor_outline, wall_height_m, window_slots
from evaluation.metrics.ideal_lap import laps_of
from evaluation.task_set.shortest import goal_slot
from evaluation.task_set.task import Task as SetTask
from navigation.camera import Pose
from navigation.shortest_path import VisibilityGraph
from tests.navigation.explorer_worlds import ROUTE_CLEARANCE_M, Task
from tests.navigation.raycast_world import Prism, rectangle
from tests.navigation.raycast_world import World as RaycastWorld

Xy = tuple[float, float]
RAIL_M = 1.03
_SLAB_M = 0.2
_PLATE_M = 0.06
_HEIGHT_OFF_M = 0.4


def from_scene(task: SetTask) -> Task:
    """The task as the study flies it, at the height of its floor's windows give or take what a mission is off by."""
    scene = task.scene
    target = scene.building(scene.target)
    slot = goal_slot(scene)
    height = slot.centre[2] + float(np.random.default_rng(task.seed).uniform(-_HEIGHT_OFF_M, _HEIGHT_OFF_M))
    plan = floor_outline(target, slot.floor)
    others = [b for b in scene.buildings if b.id != target.id]
    blocks = [floor_outline(b, 1) for b in others]
    prisms = [Prism(block, -1.0, wall_height_m(b)) for b, block in zip(others, blocks, strict=True)]
    slots = [s for s in window_slots(target) if s.floor == slot.floor]
    walls = {wall.number: wall for wall in facades(target, slot.floor)}
    prisms.append(Prism(_notched(list(walls.values()), slots, target.windows.reveal_m), -1.0, wall_height_m(target)))
    width = min(target.windows.width_m + 1.1, target.windows.pitch_m - 0.1)
    for s in slots:
        prisms += _balcony(s, walls[s.facade], (slot.floor - 1) * target.floor_height_m, width)
    for tree in scene.ground.trees:
        if tree.height_m > height - 1.0:
            wide = 2.0 * tree.crown_m
            prisms.append(Prism(rectangle(tree.position.x, tree.position.y, wide, wide), -1.0, tree.height_m))
    start = scene.start.position
    pose = Pose(start.x, start.y, height, scene.start.yaw)
    lap = laps_of(scene)
    return Task(
        task.id,
        task.footprint,
        "street" if others else "none",
        RaycastWorld(prisms),
        plan,
        pose,
        slot.centre[:2],
        slot.normal,
        task.shortest_horizontal_m,
        (lap.counterclockwise_m, lap.clockwise_m),
        VisibilityGraph([plan, *blocks], ROUTE_CLEARANCE_M),
        tuple((s.centre[:2], s.normal) for s in slots),
        VisibilityGraph([plan, *blocks], 0.0),
    )


def _notched(walls: list[Facade], slots: list[WindowSlot], deep_m: float) -> tuple[Xy, ...]:
    """The outline of the walls with a notch as deep as the reveal for every window."""
    corners: list[Xy] = []
    for wall in walls:
        corners.append(wall.start)
        for slot in sorted((s for s in slots if s.facade == wall.number), key=lambda s: s.column):
            for aside, deep in ((-0.5, 0.0), (-0.5, deep_m), (0.5, deep_m), (0.5, 0.0)):
                a = aside * slot.width_m
                x = slot.centre[0] + a * wall.along[0] - deep * wall.normal[0]
                corners.append((x, slot.centre[1] + a * wall.along[1] - deep * wall.normal[1]))
    return tuple(corners)


def _balcony(slot: WindowSlot, wall: Facade, floor_z: float, width_m: float) -> list[Prism]:
    if slot.balcony is None:
        return []
    deep, half = slot.balcony.depth_m, width_m / 2

    def plate(a0: float, a1: float, o0: float, o1: float, low: float, high: float) -> Prism:
        corners = ((a0, o0), (a0, o1), (a1, o1), (a1, o0))
        outline = tuple(
            (
                slot.centre[0] + a * wall.along[0] + o * wall.normal[0],
                slot.centre[1] + a * wall.along[1] + o * wall.normal[1],
            )
            for a, o in corners
        )
        return Prism(outline[::-1], floor_z + low, floor_z + high)

    return [
        plate(-half, half, 0.0, deep, -_SLAB_M, 0.0),
        plate(-half, half, deep - _PLATE_M, deep, 0.0, RAIL_M),
        plate(-half, -half + _PLATE_M, 0.0, deep, 0.0, RAIL_M),
        plate(half - _PLATE_M, half, 0.0, deep, 0.0, RAIL_M),
    ]
