"""Where an export goes: a folder that is there as a whole, or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evaluation.export.episodes import CannotExport

_PART = ".part"


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder beside `out`, which becomes `out` where all went well, and is gone where it did not; what a process that
    was killed left of one is taken away. Raises CannotExport where `out` is there already, OSError."""
    if out.exists():
        raise CannotExport(f"{out} is there already; name another --out, or take it away first")
    part = out.with_name(out.name + _PART)
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        yield part
        part.rename(out)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
