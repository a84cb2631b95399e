"""A submission flown again with the answers that it recorded: each flight has to come to what it claims."""

from collections.abc import Callable, Coroutine, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

from evaluation.bench.folder import RunFolder
from evaluation.bench.run import Run, Standing
from evaluation.bench.worker import Job
from evaluation.bench.worker_pool import FlyingProcess, FlyingWorker
from evaluation.metrics.episode import EpisodeRecord
from evaluation.submission.claims import Submission
from evaluation.submission.outcomes import differing
from evaluation.task_set.task import Task

Ending = Literal["same", "differs", "not replayed"]


class Replayed(NamedTuple):
    """One task flown again; `said`: in what it differs, or why it could not be flown with the recorded answers."""

    task: str
    ending: Ending
    said: str = ""


Again: TypeAlias = Coroutine[Any, Any, list[Replayed]]
"""Awaited, it flies. Raises evaluation.bench.run.CannotRun, OSError."""


def fly_again(
    run: Submission,
    tasks: Sequence[Task],
    place: Path,
    gateway: Mapping[str, str],
    environment: Mapping[str, str],
    workers: int,
    told: Callable[[Standing], None] | None = None,
    new_worker: Callable[[Job, Path], FlyingWorker] = FlyingProcess,
) -> Again:
    """The tasks' flights, to be made into a run's folder at `place`. The gateway answers as `gateway` says: from a
    recording, or asked anew of what gives the same again."""
    settings = run.settings.model_copy(update={"count": len(tasks), "workers": workers, "shard": None})
    job = Job(
        folder=str(place.absolute()),
        logs="",
        mission=settings.mission,
        backend=settings.backend,
        environment=dict(environment),
        gateway=dict(gateway),
    )

    async def fly() -> list[Replayed]:
        with RunFolder(place, settings, tasks) as folder:
            await Run(folder, job, workers, told, new_worker).fly()
            again = dict(folder.records)
        claimed = {record.task: record for record in run.records}
        return [_compared(claimed[task.id], again.get(task.id)) for task in tasks]

    return fly()


def _compared(claimed: EpisodeRecord, again: EpisodeRecord | None) -> Replayed:
    if again is None:
        return Replayed(claimed.task, "not replayed", "it was not flown")
    if not again.judged:
        said = again.error or (again.result.message if again.result is not None else "no reason is known")
        return Replayed(claimed.task, "not replayed", said)
    different = differing(claimed, again)
    if not different:
        return Replayed(claimed.task, "same")
    name, how = min(different.items(), key=lambda item: (item[0] not in ("reason", "outcome", "steps"), item[0]))
    more = f", and {len(different) - 1} more" if len(different) > 1 else ""
    return Replayed(claimed.task, "differs", f"{name}: {how}{more}")
