"""The formats by name, and the export itself: every flight that can be, and why each of the others can not."""

import importlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

from evaluation.export import coco
from evaluation.export.destination import new_folder
from evaluation.export.episodes import CannotExport, Found, with_trajectory
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from mission.trajectory import BadTrajectory

FormatName = Literal["lerobot", "rerun", "mcap", "coco"]


class EpisodeWriter(Protocol):
    """Writes one flight after the other into a folder. Every method may raise OSError."""

    def add(self, task: Task, record: EpisodeRecord) -> None:
        """Raises BadTrajectory where something of the flight is missing or damaged: nothing of it is written then.
        CannotExport where no flight of this run can be written so."""
        ...

    def finish(self) -> None:
        """Writes what is known only in the end."""
        ...

    def close(self) -> None:
        """Ends what is under way, finished or not."""
        ...


class _Format(NamedTuple):
    module: str
    writer: str
    extra: str | None
    """Which of the project's extras has what it needs beyond the usual ones."""


_FORMATS: dict[FormatName, _Format] = {
    "lerobot": _Format("evaluation.export.lerobot", "LeRobotWriter", "lerobot"),
    "rerun": _Format("evaluation.export.rerun_file", "RerunWriter", "rerun"),
    "mcap": _Format("evaluation.export.mcap_file", "McapWriter", "mcap"),
    "coco": _Format("evaluation.export.coco", "CocoWriter", None),
}


class Exported(NamedTuple):
    """How many flights were written; those that had nothing to export, and those that are damaged, with the reason."""

    episodes: int
    left_out: dict[str, str]
    damaged: dict[str, str]


def export(
    run: Path,
    out: Path,
    name: FormatName,
    *,
    only_successes: bool = False,
    limit: int | None = None,
    told: Callable[[int, int], None] = lambda done, of: None,
) -> Exported:
    """Writes `out`, a new folder, as a whole. `limit`: only the first flights; `told` hears how many of how many are
    done. Raises CannotExport, evaluation.bench.folder.BadFolder, OSError."""
    make = _writer(name)
    found = _found(run, name, only_successes)
    tasks = found.tasks[:limit]
    damaged: dict[str, str] = {}
    with new_folder(out) as folder, closing(make(folder, run)) as writer:
        for done, task in enumerate(tasks):
            told(done, len(tasks))
            try:
                writer.add(task, found.records[task.id])
            except BadTrajectory as error:
                damaged[task.id] = str(error)
        if len(damaged) == len(tasks):
            raise CannotExport(f"no flight of {run} is whole: {next(iter(damaged.values()))}")
        writer.finish()
    told(len(tasks), len(tasks))
    return Exported(len(tasks) - len(damaged), found.left_out, damaged)


def _found(run: Path, name: FormatName, only_successes: bool) -> Found:
    if name == "coco":
        return coco.with_pictures(run, only_successes=only_successes)
    return with_trajectory(run, only_successes=only_successes)


def _writer(name: FormatName) -> Callable[[Path, Path], EpisodeWriter]:
    """Raises CannotExport where a package is missing."""
    form = _FORMATS[name]
    try:
        module = importlib.import_module(form.module)
    except ModuleNotFoundError as error:
        raise CannotExport(
            f"the format {name} needs the package {error.name}: `.venv/bin/uv sync --extra all --extra {form.extra}`, "
            f"or pip install '.[{form.extra}]' in the repository's folder"
        ) from None
    make: Callable[[Path, Path], EpisodeWriter] = getattr(module, form.writer)
    return make
