"""Who flies what: every task once, a broken worker costs its episode and no more, a hopeless run stops."""

import asyncio
import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from contracts.orchestrator import MissionSettings
from evaluation.bench.folder import RunFolder
from evaluation.bench.run import MAX_BROKEN_IN_A_ROW, CannotRun, Run, Standing
from evaluation.bench.worker import Job, Order, who_ended
from evaluation.bench.worker_pool import WorkerBroke
from evaluation.metrics.episode import EpisodeRecord
from launcher.processes import Child
from tests.evaluation.bench.test_run_folder import TASKS, record, settings
from tests.evaluation.scripted_worker import ScriptedWorkerBase

JOB = Job(folder="", logs="", mission=MissionSettings(), backend="oracle")


class ScriptedWorker(ScriptedWorkerBase):
    """Flies in no time; breaks at the tasks in `breaks`."""

    def __init__(self, flown: list[Order], breaks: set[str], starts: int = 100) -> None:
        super().__init__(starts)
        self._flown = flown
        self._breaks = breaks

    async def fly(self, order: Order) -> EpisodeRecord:
        assert self.running
        self._flown.append(order)
        await asyncio.sleep(0.001)
        if order.task.id in self._breaks:
            self.running = False
            raise WorkerBroke("its process ended with signal 9")
        return record(order.task)


def run_in(folder: RunFolder, new_worker: Callable[[], ScriptedWorker], workers: int, heard: list[Standing]) -> Run:
    return Run(folder, JOB, workers, heard.append, new_worker=lambda job, log: new_worker())


@pytest.mark.parametrize("workers", [1, 2, 9])
async def test_every_task_is_flown_once(tmp_path: Path, workers: int) -> None:
    flown: list[Order] = []
    heard: list[Standing] = []
    with RunFolder(tmp_path, settings(), TASKS) as folder:
        run = run_in(folder, lambda: ScriptedWorker(flown, set()), workers, heard)
        await run.fly()
        summary = run.conclude()
    assert sorted(o.task.id for o in flown) == [t.id for t in TASKS]
    assert (summary.tasks, summary.success.k) == (4, 4)
    assert (heard[-1].done, heard[-1].total, heard[-1].successes) == (4, 4, 4)
    assert (tmp_path / "summary.json").is_file()


async def test_the_order_names_what_comes_next(tmp_path: Path) -> None:
    flown: list[Order] = []
    with RunFolder(tmp_path, settings(), TASKS) as folder:
        await run_in(folder, lambda: ScriptedWorker(flown, set()), 1, []).fly()
    assert [o.upcoming.id if o.upcoming else None for o in flown] == ["t-2", "t-3", "t-4", None]


async def test_a_broken_workers_episode_is_a_failure_in_the_denominator_and_the_rest_is_flown(tmp_path: Path) -> None:
    flown: list[Order] = []
    with RunFolder(tmp_path, settings(), TASKS) as folder:
        run = run_in(folder, lambda: ScriptedWorker(flown, {"t-2"}), 1, [])
        await run.fly()
        summary = run.conclude()
    assert [o.task.id for o in flown] == ["t-1", "t-2", "t-3", "t-4"]
    assert (summary.success.k, summary.success.n) == (3, 4)
    assert summary.outcomes == {"success": 3, "error": 1}
    assert summary.errors == {"the worker broke: its process ended with signal 9": 1}


async def test_workers_that_break_one_after_the_other_end_the_run(tmp_path: Path) -> None:
    tasks = [TASKS[0].model_copy(update={"id": f"t-{n}"}) for n in range(20)]
    with RunFolder(tmp_path, settings(), tasks) as folder:
        run = run_in(folder, lambda: ScriptedWorker([], {t.id for t in tasks}), 1, [])
        with pytest.raises(CannotRun, match="in a row"):
            await run.fly()
        assert len(folder.records) == MAX_BROKEN_IN_A_ROW


async def test_a_worker_that_cannot_start_ends_the_run_and_costs_no_episode(tmp_path: Path) -> None:
    with RunFolder(tmp_path, settings(), TASKS) as folder:
        run = run_in(folder, lambda: ScriptedWorker([], set(), starts=0), 2, [])
        with pytest.raises(CannotRun, match="no port is free"):
            await run.fly()
        assert folder.records == {}


class LingeringService:
    """A group with a service that is over at the `after`th glance."""

    def __init__(self, after: int) -> None:
        self._left = after
        process = subprocess.Popen([sys.executable, "-c", ""])
        process.wait()
        self.child = Child("sim", 1, process, Path(os.devnull), io.BytesIO())

    def ended(self) -> Child | None:
        self._left -= 1
        return self.child if self._left < 0 else None


@pytest.mark.parametrize(("after", "patience_s", "found"), [(0, 0.0, True), (3, 5.0, True), (3, 0.0, False)])
async def test_a_service_that_fell_silent_is_given_the_moment_it_takes_to_be_gone(
    after: int, patience_s: float, found: bool
) -> None:
    group = LingeringService(after)
    assert (await who_ended(group, patience_s) is group.child) is found
