"""Was the parcel brought? The right window, within 3 m of its centre, nearer to it than to any other, within 60 degrees
of its normal, in clear sight, and never a collision.

Pure: what lies on a line of sight is asked of a `Sight`, which the physics world is.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from contracts.geometry import Pose
from contracts.scene import Scene, WindowPlace
from contracts.scene_layout import WindowSlot, window_of, window_slots
from contracts.sim import Verdict
from episode_kit.kinematics import Vector

ON_THE_OBJECT_M = 0.75
"""A claimed place this near to the goal object's middle means the object, whatever window it hangs closer to."""
_BEFORE_THE_PANE_M = 0.03
_AS_NEAR_M = 1e-6


class Hit(NamedTuple):
    """What a ray or the drone met: the id of the part (0: the ground or the world's edge) and its name."""

    part: int
    name: str


class Sight(Protocol):
    """Says what lies between two places."""

    def first_hits(self, start: Vector, ends: Sequence[Vector]) -> list[Hit | None]: ...


class Thing(NamedTuple):
    """An object as it is built: the id of its part and the middle of its bounding box."""

    part: int
    middle: Vector


class Stop(NamedTuple):
    """How the drone stands to a window: the fields of `contracts.sim.Verdict` of these names."""

    distance_m: float | None
    in_front: bool
    line_of_sight: bool
    nearest_window: bool | None
    aside_deg: float | None


_NOWHERE = Stop(None, False, False, None, None)
"""In a scene without windows."""


def judge(
    scene: Scene, things: dict[str, Thing], sight: Sight, pose: Pose, collided: bool, target: Vector | None, steps: int
) -> Verdict:
    """Judges a claim made at `pose` for the object believed to be at `target` (null: judged by the stop alone).

    things: every object of the scene by its id. For a goal on the ground the object itself takes the window's place:
    there is no other window to be nearer to, and no normal.
    """
    here: Vector = (pose.x, pose.y, pose.z)
    claimed = target or here
    goal = scene.goal_object()
    if goal is None:
        slot = nearest_window(scene, claimed)
        stop = _NOWHERE if slot is None else stop_at_window(scene, slot, sight, here, None)
        return _verdict(stop, None, collided, steps)
    thing = things[goal.id]
    if isinstance(goal.place, WindowPlace):
        slot = window_of(scene, goal.place)
        right = nearest_window(scene, claimed) == slot or math.dist(claimed, thing.middle) <= ON_THE_OBJECT_M
        return _verdict(stop_at_window(scene, slot, sight, here, thing), right, collided, steps)
    nearest = min(things, key=lambda name: math.dist(things[name].middle, claimed))
    seen = _free(sight, here, [thing.middle], thing.part)[0]
    stop = Stop(math.dist(here, thing.middle), True, seen, None, None)
    return _verdict(stop, nearest == goal.id, collided, steps)


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


def nearer_window(scene: Scene, slot: WindowSlot, point: Vector) -> bool:
    """Whether the centre of any other window of the scene is nearer to a place than this one's."""
    own_m = math.dist(point, slot.centre)
    return any(
        math.dist(point, other.centre) < own_m - _AS_NEAR_M
        for building in scene.buildings
        for other in window_slots(building)
        if other != slot
    )


def stop_at_window(scene: Scene, slot: WindowSlot, sight: Sight, here: Vector, thing: Thing | None) -> Stop:
    distance_m = math.dist(here, slot.centre)
    out = (here[0] - slot.centre[0]) * slot.normal[0] + (here[1] - slot.centre[1]) * slot.normal[1]
    aside_deg = math.degrees(math.acos(max(-1.0, min(1.0, out / distance_m)))) if distance_m else 0.0
    seen = out > 0.0 and _sees(slot, sight, here, thing)
    return Stop(distance_m, out > 0.0, seen, not nearer_window(scene, slot, here), aside_deg)


def _verdict(stop: Stop, right: bool | None, collided: bool, steps: int) -> Verdict:
    """`right`: null where nobody knows which window is meant."""
    found = Verdict(
        judged=right is not None,
        delivered=False,
        right_window=right,
        collided=collided,
        steps=steps,
        **stop._asdict(),
    )
    return found.model_copy(update={"delivered": right is True and found.stops_well()})


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
