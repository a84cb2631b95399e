"""What a request of the customer's own is judged by: what stands at the window claimed, whatever the goal is."""

from collections.abc import Callable

from contracts.geometry import Pose
from contracts.scene import Scene, WindowPlace
from contracts.scene_layout import WindowSlot, goal_window
from contracts.sim import ClaimedWindow, Shown
from episode_kit.judge import Sight, Thing, nearest_window, stop_at_window
from episode_kit.kinematics import Vector

Names = Callable[[str, str], tuple[str, ...]]
"""All that people call a thing of a class and a colour."""


def claimed_window(
    scene: Scene, things: dict[str, Thing], sight: Sight, pose: Pose, target: Vector | None, names: Names
) -> ClaimedWindow | None:
    """Of a claim made at `pose` for the object believed to be at `target`; None in a scene without windows."""
    here: Vector = (pose.x, pose.y, pose.z)
    slot = nearest_window(scene, target or here)
    if slot is None:
        return None
    stop = stop_at_window(scene, slot, sight, here, None)
    goal = goal_window(scene)
    return ClaimedWindow(
        claimed=_shown(scene, slot, names),
        goal=None if goal is None else _shown(scene, goal, names, only=scene.goal),
        distance_m=stop.distance_m or 0.0,
        in_front=stop.in_front,
        line_of_sight=stop.line_of_sight,
        nearest_window=stop.nearest_window,
        aside_deg=stop.aside_deg,
    )


def _shown(scene: Scene, slot: WindowSlot, names: Names, only: str | None = None) -> Shown:
    """`only`: of the things there, the one of that id."""
    window = (slot.building, slot.facade, slot.floor, slot.column)
    there = [
        thing
        for thing in scene.objects
        if isinstance(place := thing.place, WindowPlace)
        and (place.building, place.facade, place.floor, place.column) == window
        and only in (None, thing.id)
    ]
    return Shown(floor=slot.floor, names=tuple(name for t in there for name in names(t.kind, t.colour))[:200])
