"""A whole run but for its services, to be killed: its worker makes results up from the task's name, so that a clean run
and one that was killed have to agree."""

import asyncio
import os
import signal
import threading
import zlib
from pathlib import Path
from typing import NamedTuple

from contracts.orchestrator import MissionSettings
from evaluation.bench.folder import RunFolder
from evaluation.bench.run import Run
from evaluation.bench.run_settings import RunSettings
from evaluation.bench.shard import Shard
from evaluation.bench.worker import Job, Order
from evaluation.metrics.episode import EpisodeRecord
from tests.evaluation.evaluation_kit import a_record, a_result, a_task, a_verdict

COUNT = 60
TASKS = [a_task(f"t-{n:02d}", facade=n % 4, corners=n % 4) for n in range(COUNT)]
SETTINGS = RunSettings(
    tasks="made up",
    checksum="0" * 64,
    count=COUNT,
    backend="oracle",
    mission=MissionSettings(),
    workers=1,
    versions={"python": "3"},
)


class Doom(NamedTuple):
    """When a session kills its own process: so long after so many flights have begun, whatever it does just then."""

    flights: int
    then_s: float


class InventiveWorker:
    """Takes some milliseconds a flight; three of four reach the right window."""

    def __init__(self, doom: Doom | None) -> None:
        self._doom = doom
        self._flights = 0

    async def start(self) -> None:
        """It needs nothing."""

    async def stop(self) -> None:
        """It holds nothing."""

    async def fly(self, order: Order) -> EpisodeRecord:
        if self._doom is not None and self._flights == self._doom.flights:
            threading.Timer(self._doom.then_s, os.kill, (os.getpid(), signal.SIGKILL)).start()
        self._flights += 1
        chance = zlib.crc32(order.task.id.encode())
        await asyncio.sleep(0.005 + chance % 20 / 1000)
        right = chance % 4 > 0
        result = a_result("delivered" if right else "wrong_window", a_verdict(right=right), path_m=20.0 + chance % 30)
        return a_record(order.task, result)


def fly_made_up(path: Path, workers: int, doom: Doom | None = None, shard: Shard | None = None) -> None:
    """A process's work: flies what the folder lacks."""
    job = Job(folder="", logs="", mission=MissionSettings(), backend="oracle")
    tasks = shard.share(TASKS) if shard is not None else TASKS
    with RunFolder(path, SETTINGS.model_copy(update={"shard": shard}), tasks) as folder:
        run = Run(folder, job, workers, new_worker=lambda job, log: InventiveWorker(doom))
        asyncio.run(run.fly())
        run.conclude()
