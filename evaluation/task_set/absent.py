"""Tasks whose object is not there: what a search does that has nothing to find.

The scene loses its goal, the request still asks for it. The right end is `object_not_found`, after all of the facade
on that floor was looked at.
"""

from collections.abc import Iterable

from evaluation.task_set.task import Task
from evaluation.task_set.task_files import TaskSet, lines_of, read

SUFFIX = "-absent"


def without_object(task: Task) -> Task:
    """The same delivery in the same street, the object taken away. A task that is so already stays as it is."""
    scene = task.scene
    if scene.goal is None:
        return task
    name = task.id + SUFFIX
    objects = tuple(thing for thing in scene.objects if thing.id != scene.goal)
    bare = scene.model_copy(update={"name": name, "objects": objects, "goal": None})
    return task.model_copy(update={"id": name, "scene": bare})


def without_objects(tasks: TaskSet) -> TaskSet:
    """A set of such tasks, with a checksum of its own."""
    return read(lines_of(_bare(tasks.tasks)), f"{tasks.name}, absent")


def _bare(tasks: Iterable[Task]) -> list[Task]:
    return [without_object(task) for task in tasks]
