"""The folder of a run: it only grows, one line an episode, and can be taken up again after whatever happened.

settings.json    evaluation.bench.run_settings.RunSettings
tasks.jsonl.zst  the tasks of the run, whatever they were called
results.jsonl    one evaluation.metrics.episode.EpisodeRecord a line, synced to disk as it comes; the next session
                 drops those that say nothing because a model or a service was out of reach, and flies them again
clock.json       the wall time of all sessions so far
summary.json, results.parquet   of the results so far, written at the end of a session
episodes/ID/     the record of an episode, where pictures were asked for
logs/            what the services said
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from pydantic import ValidationError

from evaluation.bench.run_settings import RunSettings
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import BadTasks, TaskSet, packed, read
from mission.record import write_whole
from service_kit.file_lock import HeldElsewhere, hold

_MAY_DIFFER = {"tasks", "workers", "versions", "renderer", "model"}
"""What may change from one session of a run to the next without changing what is flown: the checksum tells which set it
is, whatever the file is called."""


class BadFolder(ValueError):
    """A folder that can't take this run; the message says why, and what to do."""


class RunFolder:
    """One run's folder, open for writing. Use as a context manager: a second process is kept out."""

    def __init__(self, path: Path, settings: RunSettings, tasks: Sequence[Task]) -> None:
        """Raises BadFolder where another run lives there, or one is under way."""
        self.path = path
        self.settings = settings
        self.tasks = {task.id: task for task in tasks}
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock: IO[bytes] = (path / "lock").open("ab")
        except OSError as error:
            raise BadFolder(f"{path} can't be written: {error.strerror}") from None
        try:
            hold(self._lock)
        except HeldElsewhere:
            self._lock.close()
            raise BadFolder(f"another process flies the run in {path}; wait for it, or choose another --out") from None
        try:
            self._take_up()
        except BaseException:
            self._lock.close()
            raise

    def _take_up(self) -> None:
        known = self.path / "settings.json"
        if known.exists():
            _same_run(read_settings(self.path), self.settings, self.path)
        elif (self.path / "results.jsonl").exists():
            raise BadFolder(f"{self.path} holds results without settings; choose another --out")
        else:
            part = self.path / "tasks.jsonl.zst.part"
            part.write_bytes(packed(list(self.tasks.values())))
            part.replace(self.path / "tasks.jsonl.zst")
            write_whole(known, self.settings.model_dump_json(indent=1))
        self.records = {r.task: r for r in _whole_lines(self.path / "results.jsonl", mend=True)}
        self._forget_infrastructure()
        foreign = next((name for name in self.records if name not in self.tasks), None)
        if foreign is not None:
            raise BadFolder(f"{self.path} holds a result of task {foreign}, which is not part of this run")
        # unbuffered: what a full disk did not take is not tried again when the file is closed
        self._results = (self.path / "results.jsonl").open("ab", buffering=0)
        self._wall_before_s = read_wall_s(self.path)

    def _forget_infrastructure(self) -> None:
        """Episodes of earlier sessions that say nothing, because a model or a service was out of reach, are pending."""
        judged = {name: record for name, record in self.records.items() if record.judged}
        if len(judged) < len(self.records):
            lines = [record.model_dump_json() + "\n" for record in judged.values()]
            write_whole(self.path / "results.jsonl", "".join(lines))
            self.records = judged

    @property
    def pending(self) -> list[Task]:
        """The tasks without a result, in the set's order."""
        return [task for name, task in self.tasks.items() if name not in self.records]

    def add(self, record: EpisodeRecord, session_s: float) -> None:
        """One result: on disk when this returns. `session_s`: wall time since this session began.

        Raises ValueError for a task that has a result."""
        if record.task in self.records:
            raise ValueError(f"task {record.task} has a result already")
        line = memoryview(record.model_dump_json().encode() + b"\n")
        while line:
            line = line[self._results.write(line) :]
        os.fsync(self._results.fileno())
        self.records[record.task] = record
        self.note_wall(session_s)

    def note_wall(self, session_s: float) -> float:
        """Writes down the wall time of all sessions, seconds, and returns it."""
        wall_s = self._wall_before_s + session_s
        part = self.path / "clock.json.part"
        part.write_text(json.dumps({"wall_s": round(wall_s, 3)}), encoding="utf-8")
        part.replace(self.path / "clock.json")
        return wall_s

    def note(self, renderer: str | None, model: dict[str, object]) -> None:
        """What only the services know: which renderer draws, which model answers."""
        self.settings = self.settings.model_copy(update={"renderer": renderer, "model": model})
        write_whole(self.path / "settings.json", self.settings.model_dump_json(indent=1))

    def in_order(self) -> list[EpisodeRecord]:
        """The results so far, in the set's order, whichever worker was first."""
        return [self.records[name] for name in self.tasks if name in self.records]

    def close(self) -> None:
        self._results.close()
        self._lock.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_settings(path: Path) -> RunSettings:
    """Raises BadFolder where the folder holds no run."""
    try:
        return RunSettings.read((path / "settings.json").read_text(encoding="utf-8"))
    except OSError:
        raise BadFolder(f"{path} holds no run: there is no settings.json in it") from None
    except ValueError:
        raise BadFolder(f"{path}/settings.json is not the settings of a run") from None


def read_tasks(path: Path) -> TaskSet:
    """The tasks of the run in a folder. Raises BadFolder."""
    try:
        return read((path / "tasks.jsonl.zst").read_bytes(), str(path))
    except OSError:
        raise BadFolder(f"{path} holds no run: there is no tasks.jsonl.zst in it") from None
    except BadTasks as error:
        raise BadFolder(str(error)) from None


def read_records(path: Path) -> list[EpisodeRecord]:
    """The results of the run in a folder, in the order of its tasks. Raises BadFolder."""
    order = {task.id: number for number, task in enumerate(read_tasks(path).tasks)}
    return sorted(_whole_lines(path / "results.jsonl", mend=False), key=lambda r: order.get(r.task, len(order)))


def read_wall_s(path: Path) -> float:
    """The wall time of all sessions, seconds; 0 where none was noted."""
    try:
        return float(json.loads((path / "clock.json").read_text(encoding="utf-8"))["wall_s"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0.0


def differing(one: RunSettings, other: RunSettings, apart_from: set[str]) -> list[str]:
    """The names of the settings in which two runs differ."""
    here, there = (s.model_dump(mode="json", exclude=apart_from) for s in (one, other))
    return sorted(name for name in here if here[name] != there[name])


def _same_run(there: RunSettings, wanted: RunSettings, path: Path) -> None:
    differ = differing(there, wanted, _MAY_DIFFER)
    if differ:
        raise BadFolder(
            f"{path} holds a run with other settings ({', '.join(differ)}); choose another --out, or repeat the "
            "command that began it"
        )


def _whole_lines(path: Path, *, mend: bool) -> list[EpisodeRecord]:
    """The results in a file. A last line that was cut off by a kill is dropped, with `mend` from the file as well.

    Raises BadFolder for a bad line elsewhere, or a task with two results."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return []
    records: dict[str, EpisodeRecord] = {}
    whole = data.rfind(b"\n") + 1
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        try:
            record = EpisodeRecord.model_validate_json(line, extra="ignore")  # of any version
        except ValidationError:
            raise BadFolder(f"{path}, line {number} is not a result") from None
        if record.task in records:
            raise BadFolder(f"{path}, line {number}: task {record.task} has two results")
        records[record.task] = record
    if mend and whole < len(data):
        with path.open("r+b") as file:
            file.truncate(whole)
            os.fsync(file.fileno())
    return list(records.values())
