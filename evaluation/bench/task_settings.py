"""The mission's settings for one task of a run."""

import zlib

from contracts.orchestrator import MissionSettings
from evaluation.task_set.task import Task


def settings_of_task(run: MissionSettings, backend: str, task: Task) -> MissionSettings:
    """The run's, with a seed of the task's own: the random policy would fly the same curve round every building."""
    seed = (run.seed + zlib.crc32(task.id.encode())) % 2**31
    return run.model_copy(update={"vision_model": backend, "seed": seed})
