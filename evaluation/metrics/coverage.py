"""How much of the wanted floor a search has really seen, by the truth; and what it says of it itself.

A window counts as seen when a stop of the search stood within 12 m of it, less than 65 degrees from straight before
it, had it in one of the five pictures, and no building's walls between, on the plan.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult
from contracts.scene_layout import floor_outline, window_slots
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.ideal_lap import IN_VIEW_DEG, IN_VIEW_M
from evaluation.metrics.proportion import Proportion, share
from evaluation.task_set.task import Task
from navigation.shortest_path import VisibilityGraph

Xy = tuple[float, float]

_VIEWS_REACH_RAD = math.radians(135.0)
_BEFORE_THE_WALL_M = 0.05


class Absence(NamedTuple):
    """Of the tasks whose object is not there: how many ended as not found without a claim, how many claimed something,
    the windows of the floor that were seen (k of n, all tasks together), and the mean of the shares of the facade that
    the searches say they inspected, None where none says it."""

    ended: Proportion
    claimed: Proportion
    windows: Proportion
    said: float | None


def absence(tasks: Mapping[str, Task], records: Sequence[EpisodeRecord]) -> Absence | None:
    """None where no task of the records lacks its object."""
    bare = [record for record in records if tasks[record.task].absent]
    if not bare:
        return None
    results = [record.result for record in bare]
    said = [r.inspected_share for r in results if r is not None and r.inspected_share is not None]
    return Absence(
        share(record.success for record in bare),
        share(result is not None and result.verdict is not None for result in results),
        share(seen for record in bare for seen in windows_seen(tasks[record.task], record)),
        float(np.mean(said)) if said else None,
    )


def windows_seen(task: Task, record: EpisodeRecord) -> list[bool]:
    """For each window of the target building on the task's floor: did a stop of the search see it?"""
    building = task.scene.building(task.scene.target)
    slots = [slot for slot in window_slots(building) if slot.floor == task.floor]
    stops = _looks(record.result) if record.result is not None else []
    if not stops or not slots:
        return [False] * len(slots)
    others = [floor_outline(b, 1) for b in task.scene.buildings if b.id != building.id]
    sight = VisibilityGraph([floor_outline(building, task.floor), *others], 0.0)
    places = np.array([(p.x, p.y) for p in stops])
    windows = [(slot.centre[:2], slot.normal) for slot in slots]
    return in_view(windows, places, np.array([p.yaw for p in stops]), sight)


def _looks(result: DeliveryResult) -> list[Pose]:
    """Where the search looked round: its own stops, and the last one before them where its first look was taken there
    (a place at which several things are asked is one stop, of the phase that asked first)."""
    own = [i for i, stop in enumerate(result.stops) if stop.phase == "explore"]
    first = own[0] if own else len(result.stops)
    if result.exploration_steps > len(own) and first > 0:
        own.insert(0, first - 1)
    return [result.stops[i].pose for i in own]


def in_view(
    windows: Sequence[tuple[Xy, Xy]], places: NDArray[np.float64], yaws: NDArray[np.float64], sight: VisibilityGraph
) -> list[bool]:
    """For each window (its middle and the unit vector out of its wall, ENU): was it in view from one of the places
    (N, 2) with the nose at `yaws` (N,)? `sight` is of the walls, without clearance."""
    found = []
    for middle, normal in windows:
        pane = np.array(middle) + _BEFORE_THE_WALL_M * np.array(normal)
        gap = places - pane
        away = np.hypot(gap[:, 0], gap[:, 1])
        bearing = np.arctan2(-gap[:, 1], -gap[:, 0]) - yaws
        turned = np.abs(np.mod(bearing + math.pi, math.tau) - math.pi)
        good = (away <= IN_VIEW_M) & (gap @ np.array(normal) > away * math.cos(math.radians(IN_VIEW_DEG)))
        at = np.flatnonzero(good & (turned <= _VIEWS_REACH_RAD))
        found.append(bool(sight.clear_legs(places[at], np.broadcast_to(pane, (len(at), 2))).any()))
    return found
