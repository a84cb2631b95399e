"""Why an episode failed: one reason each, from what the mission recorded and what the task knows.

The first that holds, in this order:

error           the episode broke: no result, or one with outcome `failed` or `cancelled`
collision       the drone touched something
unreachable     a model or a service did not answer, could not be started, refused our token, or there is no such model;
                says nothing about how good anything is, and is left out of every rate
success         the delivery is the design's success; where the object is not there at all, it was not found; where the
                request fits two windows, that was said of both
parse           floor or object were not what the customer asked for, or were not found in the request
unreadable      a model answered, but too often with something that says nothing; or it never learnt to see the thing
floor           the height found is more than 7 m off the window's, or none was found; or the search ended without a
                sighting, on a height more than half a floor off
wrong_object    the claimed window is not the customer's
blocked         the object was found and the way to a stop that counts was not: not free, or the right window claimed
                from too far, from aside or without a clear sight; or the way up to the floor was not free
missed_object   while exploring, the drone stood where the window is in plain view, and went on
lost_building   at its last stop the drone was nearer to another building than to the target's, or over 25 m from it
timeout         the exploration steps ended at the building, but before the window came in view

"In plain view": within 15 m, at most 60 degrees from straight before the window, inside one of the five pictures, and
no building's walls between, on the plan. The object may still be hidden by a tree or a railing: for that, open the
pictures.
"""

import math
from collections.abc import Sequence

from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult, Phase
from contracts.scene import Building, Scene
from contracts.scene_layout import floor_outline, goal_window, wall_height_m
from evaluation.metrics.collisions import collided
from evaluation.metrics.episode import Reason
from evaluation.metrics.floor_localization import floor_failed
from evaluation.metrics.success import stops_well
from evaluation.scene_generator.footprints import distance_to_outline
from evaluation.task_set.task import Task

PLAIN_VIEW_M = 15.0
PLAIN_VIEW_RAD = math.radians(60.0)
LOST_M = 25.0
SEARCHING: tuple[Phase, ...] = ("explore", "approach")
VIEWS_REACH_RAD = math.radians(135.0)
_BEFORE_THE_WALL_M = 0.3

Xy = tuple[float, float]


def reason_of(task: Task, result: DeliveryResult | None) -> Reason:
    """The episode's reason by the table above; `result` is null where the episode itself broke."""
    if result is None or result.outcome in ("failed", "cancelled", "deadline_passed"):
        return "error"
    if collided(result):
        return "collision"
    if result.outcome in ("model_unreachable", "service_unreachable", "vehicle_lost"):
        return "unreachable"
    if _ends_as_it_should(task, result):
        return "success"
    if result.outcome == "request_unreadable":
        return "unreadable"
    if not understood(task, result):
        return "parse"
    if result.outcome in ("answer_unreadable", "object_unknown"):
        return "unreadable"
    return _reason_of_the_flight(task, result)


def understood(task: Task, result: DeliveryResult) -> bool:
    """The parser gave exactly the floor and the object asked for; case, blanks and hyphens don't count."""
    return result.floor == task.floor and result.object is not None and plain(result.object) == plain(task.object)


def plain(phrase: str) -> str:
    """A phrase without what does not tell objects apart: case, blanks, hyphens, full stops."""
    return "".join(c for c in phrase.casefold() if c.isalnum())


def in_plain_view(task: Task, pose: Pose) -> bool:
    """The task's window, seen from a pose with five cameras; see the module's table."""
    target = (task.target.x, task.target.y)
    dx, dy = target[0] - pose.x, target[1] - pose.y
    level_m = math.hypot(dx, dy)
    up_m = abs(task.target.z - pose.z)
    if math.hypot(level_m, up_m) > PLAIN_VIEW_M or up_m > level_m:
        return False
    if abs(math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau)) > VIEWS_REACH_RAD:
        return False
    normal = _normal(task)
    end = target
    if normal is not None:
        out_m = -(dx * normal[0] + dy * normal[1])
        if out_m < level_m * math.cos(PLAIN_VIEW_RAD):
            return False
        end = (target[0] + normal[0] * _BEFORE_THE_WALL_M, target[1] + normal[1] * _BEFORE_THE_WALL_M)
    walls = (b for b in task.scene.buildings if wall_height_m(b) > min(pose.z, task.target.z))
    return not any(_crosses((pose.x, pose.y), end, _plan(b)) for b in walls)


def strayed(scene: Scene, pose: Pose) -> bool:
    """Nearer to another building than to the target's, or more than 25 m from its walls."""
    here = (pose.x, pose.y)
    own_m = distance_to_outline(here, _plan(scene.building(scene.target)))
    others = (distance_to_outline(here, _plan(b)) for b in scene.buildings if b.id != scene.target)
    return own_m > LOST_M or min(others, default=math.inf) < own_m


def _ends_as_it_should(task: Task, result: DeliveryResult) -> bool:
    if task.ambiguous:
        return result.outcome == "request_incomplete" and result.verdict is None and understood(task, result)
    if task.absent:
        return result.outcome == "object_not_found" and result.verdict is None
    return stops_well(result)


def _reason_of_the_flight(task: Task, result: DeliveryResult) -> Reason:
    if result.outcome == "blocked" and result.final_height_m is None:
        return "blocked"
    if floor_failed(task, result):
        return "floor"
    if result.verdict is not None:
        return "blocked" if result.verdict.right_window and not (task.absent or task.ambiguous) else "wrong_object"
    if result.outcome == "blocked":
        return "blocked"
    if floor_failed(task, result, task.floor_height_m / 2):
        return "floor"
    stops = [stop.pose for stop in result.stops if stop.phase in SEARCHING]
    if any(in_plain_view(task, pose) for pose in stops):
        return "missed_object"
    if stops and strayed(task.scene, stops[-1]):
        return "lost_building"
    return "timeout"


def _normal(task: Task) -> Xy | None:
    """Out of the goal's facade; null for a goal that stands free."""
    slot = goal_window(task.scene)
    return None if slot is None else slot.normal


def _plan(building: Building) -> tuple[Xy, ...]:
    return floor_outline(building, 1)


def _crosses(a: Xy, b: Xy, outline: Sequence[Xy]) -> bool:
    return any(_meet(a, b, outline[i], outline[(i + 1) % len(outline)]) for i in range(len(outline)))


def _meet(a: Xy, b: Xy, c: Xy, d: Xy) -> bool:
    """Two segments cross in their interiors."""
    return _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0


def _side(a: Xy, b: Xy, p: Xy) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
