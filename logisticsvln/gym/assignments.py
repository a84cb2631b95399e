"""What an episode is about: a request in a scene, from a task set, the samples, or a scene of one's own."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from contracts.geometry import Point3
from contracts.near import did_you_mean
from contracts.orchestrator import Sample
from contracts.scene import FreePlace, Scene
from evaluation.task_set.shortest import SECOND, goal_slot, ways
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import SHIPPED, BadTasks, load
from logisticsvln.scenes import read_scene
from orchestrator import sample_library

SAMPLES = "samples"
LONGEST_REQUEST = 4000
SHOWN = 10
"""Names of tasks that an error lists."""
LETTERS = frozenset(chr(code) for code in (*range(32, 127), *range(160, 592), 10, 9, *range(0x2010, 0x2027), 0x20AC))
"""What the customer's words may be made of: Latin letters, and what stands between them."""


class Assignment(NamedTuple):
    """`shortest_m`: the shortest way on the plan, where it was worked out already."""

    name: str
    request: str
    scene: Scene
    shortest_m: float | None = None


class Goal(NamedTuple):
    """By what an episode is measured: the middle of the customer's window, and the shortest way to a stop before it
    (metres on the plan; None where there is none)."""

    place: Point3
    shortest_m: float | None


def assignments_of(tasks: str | Sequence[Task | Sample]) -> tuple[Assignment, ...]:
    """Of the samples, a shipped set, a file of tasks, or tasks at hand. Raises BadTasks, ValueError."""
    if isinstance(tasks, str):
        if tasks != SAMPLES:
            tasks = _set_named(tasks)
        else:
            tasks = [sample_library.load(name) for name in sample_library.names()]
    if not tasks:
        raise ValueError("tasks: there are none; give at least one")
    return tuple(assignment_of(task) for task in tasks)


def _set_named(name: str) -> Sequence[Task]:
    """Raises BadTasks."""
    try:
        return load(name).tasks
    except BadTasks:
        if name in SHIPPED or Path(name).exists():
            raise
        raise BadTasks(
            f"there is no task set {name!r}{did_you_mean(name, (SAMPLES, *SHIPPED))}: name {SAMPLES}, one of "
            f"{', '.join(SHIPPED)}, or a file of tasks"
        ) from None


def assignment_of(task: Task | Sample) -> Assignment:
    """Raises ValueError for what is neither."""
    if isinstance(task, Task):
        return Assignment(task.id, task.request, task.scene, task.shortest_horizontal_m)
    if isinstance(task, Sample):
        return Assignment(task.name, task.request, task.scene)
    raise ValueError(f"tasks: give a Task or a Sample, not {type(task).__name__}")


def chosen_by(options: Mapping[str, Any], among: Sequence[Assignment]) -> Assignment | None:
    """What `reset`'s options name: `task` (a name of the set, a Task or a Sample), or a `scene` (or the file of one);
    with a `request` of one's own. None where they name nothing. Raises ValueError, BadScene among them."""
    if not isinstance(options, Mapping):
        raise ValueError(f"options: give a dictionary with task, scene or request, not {options!r}")
    unknown = sorted(set(options) - {"task", "scene", "request"})
    if unknown:
        raise ValueError(f"options: there is no {unknown[0]!r}; there are task, scene and request")
    task, scene, request = options.get("task"), options.get("scene"), options.get("request")
    if request is not None:
        _must_be_readable(request)
    if task is not None and scene is not None:
        raise ValueError("options: give a task or a scene, not both")
    if scene is not None:
        if not request:
            raise ValueError("options: a scene needs a request, the customer's words")
        scene = read_scene(scene) if isinstance(scene, str | Path) else scene
        if not isinstance(scene, Scene):
            raise ValueError(f"options: scene is a Scene or the file of one, not {type(scene).__name__}")
        return Assignment(scene.name, request, scene)
    if task is None:
        if request:
            raise ValueError("options: a request needs a task or a scene to be said in")
        return None
    if isinstance(task, str):
        named = next((one for one in among if one.name == task), None)
        if named is None:
            raise ValueError(f"options: there is no task {task!r}{_there(task, [one.name for one in among])}")
    else:
        named = assignment_of(task)
    return named._replace(request=request) if request else named


def _there(task: str, names: Sequence[str]) -> str:
    """The nearest, and those there are, as far as a line holds them."""
    shown = ", ".join(names[:SHOWN])
    if len(names) > SHOWN:
        shown += f" and {len(names) - SHOWN} more, up to {names[-1]}"
    return f"{did_you_mean(task, names)}; there {'is' if len(names) == 1 else 'are'} {shown}"


def _must_be_readable(request: object) -> None:
    """Raises ValueError for words that the space of observations has not."""
    if not isinstance(request, str) or len(request) > LONGEST_REQUEST:
        raise ValueError(f"options: request is a text of at most {LONGEST_REQUEST} letters")
    if foreign := sorted(set(request) - LETTERS):
        shown = "".join(foreign[:10])
        raise ValueError(f"options: request has letters that an observation can't have, Latin ones alone: {shown!r}")


def goal_of(assignment: Assignment) -> Goal | None:
    """None in a scene without a goal."""
    scene = assignment.scene
    thing = scene.goal_object()
    if thing is None:
        return None
    if isinstance(thing.place, FreePlace):
        return Goal(thing.place.position, assignment.shortest_m)
    x, y, z = goal_slot(scene).centre
    shortest_m = assignment.shortest_m
    if shortest_m is None:
        found = next(iter(ways(scene, SECOND)), None)
        shortest_m = None if found is None else found.horizontal_m
    return Goal(Point3(x=x, y=y, z=z), shortest_m)
