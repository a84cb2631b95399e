"""What a run's folder claims, held against itself: tasks, results, reasons and tables. Nothing is flown."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from contracts.errors import first_problem
from evaluation.bench.folder import read_records, read_settings, read_tasks, read_wall_s
from evaluation.bench.run_settings import RunSettings
from evaluation.bench.table import row
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.summary import Summary, summarize
from evaluation.metrics.taxonomy import reason_of
from evaluation.task_set.absent import without_objects
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import SHIPPED, TaskSet, shipped

_OF_CLOCKS = {"wall_s", "render_s", "model_s", "extensions"}
"""Of a summary; and figures of packages that whoever checks may not have."""
_SHOWN = 3


class Submission(NamedTuple):
    """A run's folder, read."""

    folder: Path
    settings: RunSettings
    tasks: Mapping[str, Task]
    records: tuple[EpisodeRecord, ...]

    @property
    def summary(self) -> Summary:
        """Its figures, worked out anew."""
        return summarize(self.tasks, self.records, read_wall_s(self.folder))


class Finding(NamedTuple):
    """One thing that was looked at; `ok` is false where the folder does not hold what it claims."""

    about: str
    ok: bool
    said: str


def read_submission(folder: Path) -> Submission:
    """Raises evaluation.bench.folder.BadFolder where there is no run, or its files are damaged."""
    tasks = {task.id: task for task in read_tasks(folder).tasks}
    return Submission(folder, read_settings(folder), tasks, tuple(read_records(folder)))


def examine(run: Submission) -> list[Finding]:
    """Every claim of the folder that can be checked without flying."""
    looks: tuple[Callable[[Submission], Finding], ...] = (_task_set, _complete, _infrastructure, _reasons)
    found = [look(run) for look in looks]
    if all(finding.ok for finding in found):
        found += [_summary(run), _parquet(run)]
    return found


def _task_set(run: Submission) -> Finding:
    """The tasks are those of the set that the settings name."""
    name, checksum = run.settings.tasks, run.settings.checksum
    known = next((s for s in _shipped_sets() if s.checksum == checksum), None)
    if known is None:
        return Finding("task set", True, f"{name}, SHA-256 {checksum[:16]}: not a shipped set, so no row beside others")
    theirs = {task.id: task.content for task in known.tasks}
    foreign = [task.id for task in run.tasks.values() if theirs.get(task.id) != task.content]
    if foreign:
        return Finding("task set", False, f"{_some(foreign)} differ from {known.name}'s, whose checksum the run claims")
    part = len(run.tasks) < len(known.tasks)
    whole = f"{len(run.tasks)} of {len(known.tasks)} tasks (a row of the leaderboard has all)" if part else "all tasks"
    return Finding("task set", True, f"{known.name}, {whole}, SHA-256 {checksum[:16]}")


def _shipped_sets() -> list[TaskSet]:
    sets = [shipped(name) for name in SHIPPED]
    return [*sets, *map(without_objects, sets)]


def _complete(run: Submission) -> Finding:
    if run.settings.shard is not None:
        return Finding("complete", False, f"only shard {run.settings.shard}: put all together with `bench merge`")
    flown = {record.task for record in run.records}
    foreign = sorted(flown - run.tasks.keys())
    if foreign:
        return Finding("complete", False, f"results of tasks that the run has not got: {_some(foreign)}")
    missing = [name for name in run.tasks if name not in flown]
    if missing or len(run.tasks) != run.settings.count:
        lacks = f"; missing: {_some(missing)}" if missing else ""
        return Finding("complete", False, f"{len(flown)} of {run.settings.count} tasks are flown{lacks}")
    return Finding("complete", True, f"{len(flown)} results, one a task")


def _infrastructure(run: Submission) -> Finding:
    silent = [record.task for record in run.records if not record.judged]
    if silent:
        return Finding("infrastructure", False, f"{_some(silent)} say nothing of the model: fly the run to its end")
    return Finding("infrastructure", True, "no flight was lost to it")


def _reasons(run: Submission) -> Finding:
    """Success and every failure follow from the flight's result."""
    wrong = []
    for record in run.records:
        task = run.tasks.get(record.task)
        if task is not None and record.judged and record.error is None:
            judged = reason_of(task, record.result)
            if judged != record.reason:
                wrong.append(f"{record.task} claims {record.reason}, its result says {judged}")
    if wrong:
        return Finding("reasons", False, _some(wrong))
    return Finding("reasons", True, "each follows from its flight's result")


def _summary(run: Submission) -> Finding:
    path = run.folder / "summary.json"
    try:
        claimed = Summary.model_validate_json(path.read_bytes(), extra="ignore")
    except OSError as error:
        return Finding("summary.json", False, f"can't be read: {error.strerror}")
    except ValidationError as error:
        return Finding("summary.json", False, f"is no summary: {first_problem(error)}")
    there, here = (s.model_dump(mode="json", exclude=_OF_CLOCKS) for s in (claimed, run.summary))
    differ = [name for name in here if here[name] != there[name]]
    wrong = [f"{name} is {_short(here[name])}, it says {_short(there[name])}" for name in differ]
    if wrong:
        return Finding("summary.json", False, _some(wrong))
    return Finding("summary.json", True, "is what the results give")


def _parquet(run: Submission) -> Finding:
    path = run.folder / "results.parquet"
    if not path.is_file():
        return Finding("results.parquet", True, "is not there; results.jsonl holds the same")
    try:
        import pyarrow.parquet as pq

        claimed: list[dict[str, Any]] = pq.read_table(path).to_pylist()
    except (OSError, ValueError) as error:
        return Finding("results.parquet", False, f"can't be read: {error}")
    by_task = {told["task"]: told for told in claimed}
    wrong = [
        f"{record.task}: {name}"
        for record in run.records
        for name, value in row(run.tasks[record.task], record).items()
        if name in by_task.get(record.task, {}) and by_task[record.task][name] != value
    ]
    absent = [record.task for record in run.records if record.task not in by_task]
    if wrong or absent or len(claimed) != len(run.records):
        lacks = _some(wrong or absent or ["it has more rows"])
        return Finding("results.parquet", False, f"differs from results.jsonl: {lacks}")
    return Finding("results.parquet", True, "is what the results give")


def _some(names: list[str]) -> str:
    """The first few, and how many more."""
    more = len(names) - _SHOWN
    return ", ".join(names[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
