"""Sets of tasks: the shipped one, whose checksum is verified, and files of one's own.

A file holds one Task a line, as JSON, plain or under zstd. The checksum is of the lines, unpacked.
"""

import hashlib
import io
from collections.abc import Sequence
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import NamedTuple

import zstandard
from pydantic import ValidationError

from contracts.errors import first_problem
from evaluation.task_set.task import Task

SHIPPED = ("vld-300", "vld-real")
MAX_BYTES = 256 * 1024 * 1024
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_LEVEL = 19


class BadTasks(ValueError):
    """A task set that can't be used; the message says what is wrong with it and what would be right."""


class TaskSet(NamedTuple):
    """`name` says where it came from; `checksum` is the SHA-256 of its lines."""

    name: str
    checksum: str
    tasks: tuple[Task, ...]

    def task(self, task_id: str) -> Task:
        """Raises BadTasks, naming ids that there are."""
        for task in self.tasks:
            if task.id == task_id:
                return task
        first, last = self.tasks[0].id, self.tasks[-1].id
        raise BadTasks(f"{self.name} has no task {task_id!r}; its {len(self.tasks)} tasks run from {first} to {last}")


def shipped_set_of(task_id: str) -> str:
    """The shipped set whose name a task's begins with, else the first."""
    return next((name for name in SHIPPED if task_id.startswith(f"{name}-")), SHIPPED[0])


def load(name: str) -> TaskSet:
    """A shipped set by its name, or a file by its path. Raises BadTasks."""
    if name in SHIPPED:
        return shipped(name)
    path = Path(name)
    if not path.is_file():
        raise BadTasks(f"there is no task set {name!r}: name one of {', '.join(SHIPPED)}, or a file of tasks")
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BadTasks(f"{path} is larger than {MAX_BYTES} bytes: that is no task set")
        return read(path.read_bytes(), str(path))
    except OSError as error:
        raise BadTasks(f"{path}: {error.strerror}") from None


def shipped(name: str, folder: Traversable | None = None) -> TaskSet:
    """A set of the package, or of another `folder`. Raises BadTasks where its data is not what was shipped."""
    folder = folder or files("evaluation.task_set").joinpath("data")
    try:
        data = folder.joinpath(f"{name}.jsonl.zst").read_bytes()
        promised = folder.joinpath(f"{name}.sha256").read_text(encoding="ascii").split()[0]
    except (OSError, IndexError, UnicodeDecodeError):
        raise BadTasks(f"the data of {name} can't be read: reinstall the package") from None
    found = hashlib.sha256(_unpacked(data, name)).hexdigest()
    if found != promised:
        raise BadTasks(
            f"the data of {name} was changed: its SHA-256 is {found[:16]}..., {promised[:16]}... was shipped; "
            "reinstall the package, or write your own set into a file of your own"
        )
    return read(data, name)


def read(data: bytes, name: str) -> TaskSet:
    """The set in a file's bytes. Raises BadTasks."""
    lines = _unpacked(data, name)
    tasks: list[Task] = []
    seen: set[str] = set()
    for number, line in enumerate(lines.splitlines(), start=1):
        if not line.strip():
            continue
        try:
            task = Task.model_validate_json(line)
        except ValidationError as error:
            raise BadTasks(f"{name}, line {number}: {first_problem(error)}") from None
        if task.id in seen:
            raise BadTasks(f"{name}, line {number}: there are two tasks {task.id}")
        seen.add(task.id)
        tasks.append(task)
    if not tasks:
        raise BadTasks(f"{name} holds no task")
    return TaskSet(name, hashlib.sha256(lines).hexdigest(), tuple(tasks))


def packed(tasks: Sequence[Task]) -> bytes:
    """The file of a set. The scenes of one building are much alike, so it packs to a few per cent."""
    return zstandard.ZstdCompressor(level=_LEVEL, write_checksum=True).compress(lines_of(tasks))


def lines_of(tasks: Sequence[Task]) -> bytes:
    """The lines whose checksum names a set."""
    return "".join(task.model_dump_json() + "\n" for task in tasks).encode()


def _unpacked(data: bytes, name: str) -> bytes:
    if not data.startswith(_ZSTD_MAGIC):
        return data
    try:
        with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)) as reader:
            lines = reader.read(MAX_BYTES + 1)
    except zstandard.ZstdError as error:
        raise BadTasks(f"{name} is not a whole zstd file: {error}") from None
    if len(lines) > MAX_BYTES:
        raise BadTasks(f"{name} unpacks to more than {MAX_BYTES} bytes: that is no task set")
    return lines
