"""Success by what kind of task it was."""

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple, get_args

from contracts.scene import BuildingKind
from contracts.sensor_profiles import DEFAULT_SENSORS
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.proportion import Proportion, share
from evaluation.scene_generator.scene_plan import Difficulty
from evaluation.task_set.mixture import StartName
from evaluation.task_set.task import Category, Task

FLOOR_GROUPS = ((1, 3), (4, 6), (7, 12), (13, None))
MOST_ACROSS = 2
"""Buildings that one side of a street holds in the task sets."""


def breakdown(
    tasks: Mapping[str, Task],
    records: Sequence[EpisodeRecord],
    group: Callable[[Task], str],
    order: Sequence[str] = (),
) -> dict[str, Proportion]:
    """Success in each group that occurs: those of `order` first, the rest by name; empty without records."""
    groups: dict[str, list[bool]] = {}
    for record in records:
        groups.setdefault(group(tasks[record.task]), []).append(record.success)
    names = [name for name in order if name in groups] + sorted(set(groups) - set(order))
    return {name: share(groups[name]) for name in names}


def floor_group(task: Task) -> str:
    """The floor asked for, in groups that floors up to the twenties fill: 1-3, 4-6, 7-12, 13 and up."""
    return next(_span(low, high) for low, high in FLOOR_GROUPS if high is None or task.floor <= high)


def _span(low: int, high: int | None) -> str:
    return f"{low}-{high}" if high is not None else f"{low}+"


def neighbours_group(task: Task) -> str:
    """What stands beside the target building: nothing, a row across the street, or buildings all round (more than one
    street's side holds)."""
    others = len(task.scene.buildings) - 1
    return "none" if others < 1 else "street" if others <= MOST_ACROSS else "ring"


class Grouping(NamedTuple):
    """How tasks fall into groups; `order` of those that have one."""

    of: Callable[[Task], str]
    order: tuple[str, ...] = ()


def sensors_group(task: Task) -> str:
    """The profile that the scene names; a run may have chosen another one for all."""
    return task.scene.sensors or DEFAULT_SENSORS


def light_group(task: Task) -> str:
    """Night, dusk, or day."""
    return task.scene.light.sky if task.scene.light.sky in ("night", "dusk") else "day"


def weather_group(task: Task) -> str:
    """Fog, rain, wind, or several of them; calm and dry is `fair`."""
    air = task.scene.air
    windy = air.wind.speed_m_s > 0.0 or air.wind.gusts_m_s > 0.0
    named = (("fog", air.visibility_m is not None), ("rain", air.rain_mm_h > 0.0), ("wind", windy))
    return "+".join(name for name, is_so in named if is_so) or "fair"


GroupingName = Literal[
    "difficulty", "building", "footprint", "neighbours", "category", "floor", "sensors", "light", "weather", "start"
]
GROUPINGS: Mapping[GroupingName, Grouping] = {
    "difficulty": Grouping(lambda task: task.difficulty, get_args(Difficulty)),
    "building": Grouping(lambda task: task.building_kind, get_args(BuildingKind)),
    "footprint": Grouping(lambda task: task.footprint),
    "neighbours": Grouping(neighbours_group, ("none", "street", "ring")),
    "category": Grouping(lambda task: task.category, get_args(Category)),
    "floor": Grouping(floor_group, tuple(_span(low, high) for low, high in FLOOR_GROUPS)),
    "sensors": Grouping(sensors_group),
    "light": Grouping(light_group, ("day", "dusk", "night")),
    "weather": Grouping(weather_group, ("fair",)),
    "start": Grouping(lambda task: task.start or "usual", get_args(StartName)),
}
"""All that a summary breaks success down by."""
