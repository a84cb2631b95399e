"""Was the parcel brought? The design's success: the right window, within 3 m of its centre, in front of it, in clear
sight, and never a collision.

Pure: what lies on a line of sight is asked of a `Sight`, which the physics world is.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from contracts.geometry import Pose
from contracts.scene import Scene, SceneObject, WindowPlace
from contracts.scene_layout import WindowSlot, window_slot, window_slots
from contracts.sim import SUCCESS_RADIUS_M
from services.sim.kinematics import Vector
from services.sim.world import Hit

ON_THE_OBJECT_M = 0.75
"""A claimed place this near to the goal object's middle means the object, whatever window it hangs closer to."""
_BEFORE_THE_PANE_M = 0.03


class Sight(Protocol):
    """Says what lies between two places."""

    def first_hits(self, start: Vector, ends: Sequence[Vector]) -> list[Hit | None]: ...


class Thing(NamedTuple):
    """An object as it is built: the id of its part and the middle of its bounding box."""

    part: int
    middle: Vector


class Judgement(NamedTuple):
    """The fields of `contracts.sim.Verdict` that are found out here."""

    judged: bool
    delivered: bool
    right_window: bool | None
    distance_m: float | None
    in_front: bool
    line_of_sight: bool


def judge(
    scene: Scene, things: dict[str, Thing], sight: Sight, pose: Pose, collided: bool, target: Vector | None
) -> Judgement:
    """Judges a claim made at `pose` for the object believed to be at `target` (null: judged by the stop alone).

    things: every object of the scene by its id. For a goal on the ground the object itself takes the window's place.
    """
    here: Vector = (pose.x, pose.y, pose.z)
    claimed = target or here
    goal = next((o for o in scene.objects if o.id == scene.goal), None)
    if goal is None:
        slot = nearest_window(scene, claimed)
        if slot is None:
            return Judgement(False, False, None, None, False, False)
        return _at_window(slot, sight, here, collided, None, None)
    thing = things[goal.id]
    if isinstance(goal.place, WindowPlace):
        slot = window_of(scene, goal.place)
        right = nearest_window(scene, claimed) == slot or math.dist(claimed, thing.middle) <= ON_THE_OBJECT_M
        return _at_window(slot, sight, here, collided, thing, right)
    nearest = min(things, key=lambda name: math.dist(things[name].middle, claimed))
    distance_m = math.dist(here, thing.middle)
    seen = _free(sight, here, [thing.middle], thing.part)[0]
    right = nearest == goal.id
    delivered = right and distance_m <= SUCCESS_RADIUS_M and seen and not collided
    return Judgement(True, delivered, right, distance_m, True, seen)


def window_of(scene: Scene, place: WindowPlace) -> WindowSlot:
    """Raises ValueError where the building has no such window."""
    return window_slot(scene.building(place.building), place.facade, place.floor, place.column)


def goal_window(scene: Scene) -> WindowSlot | None:
    """The customer's window, if the scene has a goal that stands at one."""
    goal: SceneObject | None = next((o for o in scene.objects if o.id == scene.goal), None)
    if goal is None or not isinstance(goal.place, WindowPlace):
        return None
    return window_of(scene, goal.place)


def nearest_window(scene: Scene, point: Vector) -> WindowSlot | None:
    """The window that a place belongs to: the one whose piece of wall, from floor to floor and from half-way to the
    left to half-way to the right neighbour, is nearest; between equals, the one whose centre is.

    By its piece of wall and not by its centre, because a thing on a balcony's floor is nearer to the centre of
    the window below.
    """
    best: tuple[float, float] | None = None
    found = None
    for building in scene.buildings:
        half_width = building.windows.pitch_m / 2
        half_height = building.floor_height_m / 2
        for slot in window_slots(building):
            dx, dy, dz = (p - c for p, c in zip(point, slot.centre, strict=True))
            aside = max(0.0, abs(dx * slot.along[0] + dy * slot.along[1]) - half_width)
            out = dx * slot.normal[0] + dy * slot.normal[1]
            above = max(0.0, abs(point[2] - (slot.floor - 0.5) * building.floor_height_m) - half_height)
            key = (round(math.hypot(aside, out, above), 6), math.hypot(dx, dy, dz))
            if best is None or key < best:
                best, found = key, slot
    return found


def _at_window(
    slot: WindowSlot, sight: Sight, here: Vector, collided: bool, thing: Thing | None, right: bool | None
) -> Judgement:
    distance_m = math.dist(here, slot.centre)
    out = (here[0] - slot.centre[0]) * slot.normal[0] + (here[1] - slot.centre[1]) * slot.normal[1]
    in_front = out > 0.0
    seen = in_front and _sees(slot, sight, here, thing)
    delivered = right is not False and distance_m <= SUCCESS_RADIUS_M and in_front and seen and not collided
    return Judgement(right is not None, delivered, right, distance_m, in_front, seen)


def _sees(slot: WindowSlot, sight: Sight, here: Vector, thing: Thing | None) -> bool:
    """Clear sight: of the goal object's middle, or of most of nine points in the middle half of the opening. Nine,
    so that the bar of a railing that happens to lie on one line does not hide a window."""
    points: list[Vector] = []
    for u in (-0.25, 0.0, 0.25):
        for v in (-0.25, 0.0, 0.25):
            x, y = (
                slot.centre[i] + slot.along[i] * u * slot.width_m + slot.normal[i] * _BEFORE_THE_PANE_M for i in (0, 1)
            )
            points.append((x, y, slot.centre[2] + v * slot.height_m))
    free = _free(sight, here, points, thing.part if thing else None)
    return sum(free) > len(free) / 2 or (thing is not None and _free(sight, here, [thing.middle], thing.part)[0])


def _free(sight: Sight, here: Vector, points: Sequence[Vector], own_part: int | None) -> list[bool]:
    return [hit is None or hit.part == own_part for hit in sight.first_hits(here, points)]
