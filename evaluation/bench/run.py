"""A run: its pending tasks, spread over workers, each result written as it comes, a summary at the end."""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from evaluation.bench.folder import RunFolder
from evaluation.bench.table import write_figures
from evaluation.bench.worker import Job, Order
from evaluation.bench.worker_pool import (
    FlyingProcess,
    FlyingWorker,
    WorkerBroke,
    WorkerCantStart,
    broken_episode,
    run_workers,
)
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.summary import Summary
from evaluation.task_set.task import Task
from mission.record import now

MAX_BROKEN_IN_A_ROW = 5


class Standing(NamedTuple):
    """How far a run has come. `flown` counts this session's episodes, `done` all, `infrastructure` those of them that
    say nothing; times in seconds."""

    total: int
    done: int
    successes: int
    infrastructure: int
    flown: int
    session_s: float
    last: EpisodeRecord | None
    workers: int


Listener = Callable[[Standing], None]


class CannotRun(Exception):
    """The run can't go on: workers don't start, or break one after the other; the message says what they said."""


class Run:
    """Flies what is pending in a folder. Cancelling `fly` ends the workers; what was flown stays."""

    def __init__(
        self,
        folder: RunFolder,
        job: Job,
        workers: int,
        listener: Listener | None = None,
        new_worker: Callable[[Job, Path], FlyingWorker] = FlyingProcess,
    ) -> None:
        """`new_worker` makes a worker from its job and the file for its log."""
        self._new_worker = new_worker
        self._folder = folder
        self._job = job
        self._workers = workers
        self._listener = listener
        self._pending: deque[Task] = deque(folder.pending)
        self._began = time.perf_counter()
        self._flown = 0
        self._broken = 0

    async def fly(self) -> None:
        """Raises CannotRun."""
        self._began = time.perf_counter()
        self._tell(None)
        try:
            await run_workers(self._work, min(self._workers, len(self._pending)))
        finally:
            self._folder.note_wall(self._session_s)

    def conclude(self) -> Summary:
        """Writes summary.json and results.parquet of what is there."""
        records = self._folder.in_order()
        wall_s = self._folder.note_wall(self._session_s)
        return write_figures(self._folder.path, self._folder.tasks, records, wall_s)

    @property
    def _session_s(self) -> float:
        return time.perf_counter() - self._began

    async def _work(self, number: int) -> None:
        logs = Path(self._folder.path) / "logs" / f"worker-{number}"
        worker = self._new_worker(self._job.model_copy(update={"logs": str(logs)}), logs / "worker.log")
        try:
            await self._start(worker)
            task = self._next()
            while task is not None:
                upcoming = self._next()
                started, began = now(), time.perf_counter()
                try:
                    record = await worker.fly(Order(task=task, upcoming=upcoming))
                except WorkerBroke as error:
                    self._add(broken_episode(task, started, time.perf_counter() - began, str(error)))
                    await worker.stop()
                    self._broken += 1
                    if self._broken >= MAX_BROKEN_IN_A_ROW:
                        raise CannotRun(f"{self._broken} workers broke in a row; the last: {error}") from None
                    await self._start(worker)
                else:
                    self._broken = 0
                    self._add(record)
                task = upcoming
        finally:
            # not to be left half done by a second Ctrl-C: services would stay behind
            await asyncio.shield(worker.stop())

    def _next(self) -> Task | None:
        return self._pending.popleft() if self._pending else None

    async def _start(self, worker: FlyingWorker) -> None:
        try:
            await worker.start()
        except WorkerCantStart as error:
            raise CannotRun(str(error)) from None

    def _add(self, record: EpisodeRecord) -> None:
        self._folder.add(record, self._session_s)
        self._flown += 1
        if self._folder.settings.renderer is None and record.result is not None and record.result.renderer is not None:
            self._folder.note(record.result.renderer, self._folder.settings.model)
        self._tell(record)

    def _tell(self, last: EpisodeRecord | None) -> None:
        if self._listener is None:
            return
        records = self._folder.records
        with contextlib.suppress(OSError):  # a terminal that went away is no reason to stop
            self._listener(
                Standing(
                    total=len(self._folder.tasks),
                    done=len(records),
                    successes=sum(r.success for r in records.values()),
                    infrastructure=sum(not r.judged for r in records.values()),
                    flown=self._flown,
                    session_s=self._session_s,
                    last=last,
                    workers=self._workers,
                )
            )
