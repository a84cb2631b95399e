"""Prometheus' page of a service that is several processes: each writes its own every second, and shows the sum of all.

What a worker counted before it was replaced stays in the sum, so that counters never go down.
"""

import asyncio
import os
import time
from collections.abc import Callable
from pathlib import Path

EVERY_S = 1.0


class MetricsPages:
    """The pages of all workers, in `folder`. `own` makes this worker's. Gauges named in `shared` show the same in every
    worker: they are not added up."""

    def __init__(self, folder: Path, number: int, own: Callable[[], str], shared: frozenset[str] = frozenset()) -> None:
        self._folder = folder
        self._path = folder / f"{number}.prom"
        self._own = own
        self._shared = shared
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """In the loop that serves. What this worker's predecessor counted is kept."""
        if self._path.exists():
            self._path.rename(self._folder / f"gone-{time.time_ns()}.prom")
        self._task = asyncio.create_task(self._publish())

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    def merged(self) -> str:
        """The sum of what all have written, this worker's as it is now."""
        pages = [(self._own(), False)]
        for path in sorted(self._folder.glob("*.prom")):
            if path != self._path:
                pages.append((path.read_text(encoding="utf-8"), path.name.startswith("gone-")))
        return merged(pages, self._shared)

    async def _publish(self) -> None:
        while True:
            new = self._path.with_suffix(".new")
            new.write_text(self._own(), encoding="utf-8")
            os.replace(new, self._path)
            await asyncio.sleep(EVERY_S)


def merged(pages: list[tuple[str, bool]], shared: frozenset[str]) -> str:
    """Pages in Prometheus' text format, and whether their worker is gone: of such the gauges are left out."""
    heads: dict[str, list[str]] = {}
    kinds: dict[str, str] = {}
    samples: dict[str, dict[str, float]] = {}
    for page, gone in pages:
        family = ""
        for line in page.splitlines():
            if line.startswith("# "):
                _, what, family, told = (*line.split(" ", 3), "")[:4]
                if what == "TYPE":
                    kinds[family] = told
                lines = heads.setdefault(family, [])
                if line not in lines:
                    lines.append(line)
            elif line:
                series, _, value = line.rpartition(" ")
                if gone and kinds.get(family) == "gauge":
                    continue
                numbers = samples.setdefault(family, {})
                before = numbers.get(series, 0.0)
                same = family in shared
                numbers[series] = max(before, float(value)) if same else before + float(value)
    lines = []
    for family, head in heads.items():
        lines += head + [f"{series} {value!r}" for series, value in samples.get(family, {}).items()]
    return "\n".join(lines) + "\n"
