"""The mission's settings for one task of a run."""

import zlib

from contracts.orchestrator import MissionSettings
from evaluation.bench.sensor_faults import SensorFaults
from evaluation.task_set.task import Task


def settings_of_task(
    run: MissionSettings, backend: str, task: Task, faults: SensorFaults | None = None
) -> MissionSettings:
    """The run's, with a seed of the task's own: the random policy would fly the same curve round every building. Its
    sensors have the faults that are drawn for it, beside the run's."""
    seed = (run.seed + zlib.crc32(task.id.encode())) % 2**31
    drawn = run.faults if faults is None else (*run.faults, *faults.of(task.id))
    return run.model_copy(update={"vision_model": backend, "seed": seed, "faults": drawn})
