"""Where the files of deliveries' records lie: in a folder, or in a bucket of an S3-compatible store."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Protocol

from mission.record import PICTURE_NAME, write_whole

PICTURES = "pictures/"
FILES = frozenset({"summary.png", "events.jsonl", "result.json", "question.json"})
"""Of a record, beside its pictures, for everybody who may look at the delivery."""
Files = Mapping[str, bytes]
"""Contents by the file's name in its record, such as `pictures/0004_front.jpg`."""


class RecordFiles(Protocol):
    """Of all deliveries. Every function may take a while, and raises OSError where the store does not answer."""

    def place(self, delivery: str) -> str:
        """Where the record lies, for people."""
        ...

    def problem(self) -> str | None:
        """Why no record could be written or read now; null when all is well."""
        ...

    def write(self, delivery: str, files: Files) -> None:
        """Each file is there whole or not at all; one that is there already is replaced."""
        ...

    def read(self, delivery: str, file: str) -> bytes | None:
        """Null where there is no such file."""
        ...

    def size(self, delivery: str) -> int:
        """What the record's files take, in bytes."""
        ...

    def delete(self, delivery: str) -> None:
        """All files of the record; one without any is none of trouble."""
        ...


class Shown(NamedTuple):
    """A file of a record for somebody who may look at the delivery."""

    name: str
    content: bytes


def shown_file(files: RecordFiles, delivery: str, name: str) -> Shown | None:
    """A file that may be shown, a picture by its bare name; null where there is none. Raises OSError."""
    if name not in FILES and not PICTURE_NAME.fullmatch(name):
        return None
    content = files.read(delivery, name if name in FILES else PICTURES + name)
    return None if content is None else Shown(name, content)


class FolderFiles:
    """A folder for each delivery, in `runs`."""

    def __init__(self, runs: Path) -> None:
        self.runs = runs

    def place(self, delivery: str) -> str:
        return str(self.runs / delivery)

    def problem(self) -> str | None:
        there = self.runs.is_dir()
        return None if there and os.access(self.runs, os.W_OK) else f"{self.runs} is no folder that can be written"

    def write(self, delivery: str, files: Files) -> None:
        folder = self.runs / delivery
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)
        for file, content in files.items():
            if file.startswith(PICTURES):  # many, and no event names one before it is whole
                (folder / file).write_bytes(content)
            else:
                write_whole(folder / file, content)

    def read(self, delivery: str, file: str) -> bytes | None:
        try:
            return (self.runs / delivery / file).read_bytes()
        except (FileNotFoundError, IsADirectoryError, NotADirectoryError):
            return None

    def size(self, delivery: str) -> int:
        return sum(file.stat().st_size for file in (self.runs / delivery).rglob("*") if file.is_file())

    def delete(self, delivery: str) -> None:
        shutil.rmtree(self.runs / delivery, ignore_errors=True)
