"""The shards of a run put together: one folder as a run in one process would have left it."""

import fcntl
import json
import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

from evaluation.bench.folder import BadFolder, differing, read_records, read_settings, read_tasks, read_wall_s
from evaluation.bench.run_settings import RunSettings
from evaluation.bench.shard import Shard
from evaluation.bench.table import write_figures
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.summary import Summary
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import packed
from mission.record import write_whole

_MAY_DIFFER = {"tasks", "workers", "shard"}
"""What may differ from shard to shard: the name of the set's file (the checksum tells which set it is), and how many
flew it."""


class Part(NamedTuple):
    """One shard as its folder has it. `wall_s`: wall time of its sessions, seconds."""

    folder: Path
    shard: Shard
    settings: RunSettings
    tasks: Sequence[Task]
    records: Sequence[EpisodeRecord]
    wall_s: float


def merge(folders: Sequence[Path], out: Path, *, unfinished: bool = False) -> Summary:
    """Writes the run of these shards into `out`, which is new, and returns its figures; `unfinished`: also of shards
    that were not flown to their end. The workers of all shards count as the run's, and its time is that of the shard
    that took longest.

    Raises BadFolder where the shards are not those of one run, or not all of it; OSError."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadFolder(f"{out} is there already; choose another --out")
    parts = [_part(folder) for folder in folders]
    _all_there_once(parts)
    for part in parts[1:]:
        _of_one_run(parts[0], part)
    for part in parts:
        _whole_share(part, unfinished=unfinished)
    parts.sort(key=lambda part: part.shard.number)
    return _written(parts, out)


def _part(folder: Path) -> Part:
    with _at_rest(folder):
        settings = read_settings(folder)
        if settings.shard is None:
            raise BadFolder(f"{folder} is no shard but a run of its own (it was flown without --shard)")
        return Part(
            folder, settings.shard, settings, read_tasks(folder).tasks, read_records(folder), read_wall_s(folder)
        )


@contextmanager
def _at_rest(folder: Path) -> Iterator[None]:
    """Raises BadFolder while a process flies the run in the folder."""
    try:
        lock = (folder / "lock").open("rb")
    except OSError:  # a copy needs no lock, and what is no run is told by whoever reads it
        yield
        return
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            raise BadFolder(f"another process flies the run in {folder}; wait for it") from None
        yield


def _all_there_once(parts: Sequence[Part]) -> None:
    of = parts[0].shard.of
    stranger = next((part for part in parts if part.shard.of != of), None)
    if stranger is not None:
        raise BadFolder(
            f"{parts[0].folder} is shard {parts[0].shard} and {stranger.folder} shard {stranger.shard}: they are not "
            "of one run"
        )
    found: defaultdict[int, list[Path]] = defaultdict(list)
    for part in parts:
        found[part.shard.number].append(part.folder)
    for number, folders in sorted(found.items()):
        if len(folders) > 1:
            raise BadFolder(f"shard {number}/{of} is given twice: {folders[0]} and {folders[1]}")
    missing = [f"{number}/{of}" for number in range(1, of + 1) if number not in found]
    if missing:
        some = ", ".join(missing[:10]) + (f" and {len(missing) - 10} more" if len(missing) > 10 else "")
        raise BadFolder(f"missing of {of} shards: {some}; name their folders too")


def _of_one_run(first: Part, other: Part) -> None:
    """Raises BadFolder where they were not flown alike."""
    names = differing(first.settings, other.settings, _MAY_DIFFER | {"versions"})
    # nothing flown, nothing drawn
    if None in (first.settings.renderer, other.settings.renderer):
        names = [name for name in names if name != "renderer"]
    here, there = first.settings.versions, other.settings.versions
    names += [f"versions: {name}" for name in sorted(here.keys() | there.keys()) if here.get(name) != there.get(name)]
    if names:
        raise BadFolder(
            f"{first.folder} and {other.folder} are not shards of one run: they differ in {', '.join(names)}"
        )


def _whole_share(part: Part, *, unfinished: bool) -> None:
    """Raises BadFolder where the folder has not the tasks of its share or, unless `unfinished`, not all results."""
    tasks = {task.id for task in part.tasks}
    share = len(part.shard.share(range(part.settings.count)))
    foreign = next((record.task for record in part.records if record.task not in tasks), None)
    if len(tasks) != share or foreign is not None:
        found = f"a result of task {foreign}" if foreign is not None else f"{len(tasks)} tasks"
        raise BadFolder(
            f"{part.folder} is damaged: shard {part.shard} of {part.settings.count} tasks has {share}, and there "
            f"is {found}"
        )
    judged = sum(record.judged for record in part.records)
    if judged < share and not unfinished:
        raise BadFolder(
            f"{part.folder} is not finished: shard {part.shard} has {judged} of {share} results; the command that "
            "began it goes on, or merge what is there with --unfinished"
        )


def _written(parts: Sequence[Part], out: Path) -> Summary:
    """`parts` in the order of their numbers."""
    count, of = parts[0].settings.count, len(parts)
    tasks = {task.id: task for task in (parts[at % of].tasks[at // of] for at in range(count))}
    if len(tasks) < count:
        raise BadFolder(f"{parts[0].folder} and the others have tasks in common: they are not shards of one run")
    known = {record.task: record for part in parts for record in part.records}
    records = [known[name] for name in tasks if name in known]
    settings = parts[0].settings.model_copy(
        update={
            "shard": None,
            "workers": sum(part.settings.workers for part in parts),
            "renderer": next((part.settings.renderer for part in parts if part.settings.renderer is not None), None),
        }
    )
    wall_s = max(part.wall_s for part in parts)
    made = out.with_name(f"{out.name}.{uuid4().hex[:8]}.part")
    made.mkdir(parents=True)
    try:
        write_whole(made / "settings.json", settings.model_dump_json(indent=1))
        (made / "tasks.jsonl.zst").write_bytes(packed(list(tasks.values())))
        write_whole(made / "results.jsonl", "".join(record.model_dump_json() + "\n" for record in records))
        write_whole(made / "clock.json", json.dumps({"wall_s": round(wall_s, 3)}))
        for part in parts:
            _copy_pictures(part, made)
        summary = write_figures(made, tasks, records, wall_s)
        made.replace(out)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise
    return summary


def _copy_pictures(part: Part, made: Path) -> None:
    for record in part.records:
        kept = part.folder / "episodes" / record.task
        if record.folder is not None and kept.is_dir():
            shutil.copytree(kept, made / "episodes" / record.task)
