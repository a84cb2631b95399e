"""A worker as its run sees it: started, given tasks one at a time, replaced when it breaks."""

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, Protocol

from pydantic import ValidationError

from contracts.base import Wire
from contracts.errors import first_problem
from evaluation.bench.worker import Job, Order
from evaluation.bench.worker_loop import LINE_LIMIT, Ready
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from mission.record import now

STOP_S = 30.0


class WorkerBroke(Exception):
    """The worker's process ended, or said something that is no answer; the message says which."""


class WorkerCantStart(Exception):
    """The worker could not start its services: no task would fare better."""


class FlyingWorker(Protocol):
    """What a run needs of a worker. `start` raises WorkerCantStart, `fly` raises WorkerBroke."""

    async def start(self) -> None: ...

    async def fly(self, order: Order) -> EpisodeRecord: ...

    async def stop(self) -> None: ...


class WorkerProcess:
    """A worker's process: `python -m MODULE`, one line in, one line out. `log`: where its standard error goes."""

    def __init__(self, module: str, job: Wire, log: Path) -> None:
        self._module = module
        self._job = job
        self._log = log
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Returns when its services are ready. Raises WorkerCantStart."""
        try:
            self._log.parent.mkdir(parents=True, exist_ok=True)
            with self._log.open("ab") as log:
                self._process = await asyncio.create_subprocess_exec(
                    *(sys.executable, "-m", self._module),
                    stdin=asyncio.subprocess.PIPE,
                    stdout=asyncio.subprocess.PIPE,
                    stderr=log,
                    limit=LINE_LIMIT,
                    # Ctrl-C reaches the run only, which then ends its workers in order
                    start_new_session=True,
                )
        except OSError as error:
            raise WorkerCantStart(f"a worker did not start ({error})") from None
        try:
            ready = Ready.model_validate_json(await self.ask(self._job))
        except (WorkerBroke, ValidationError) as error:
            await self.stop()
            raise WorkerCantStart(f"a worker did not start ({error}); its log is {self._log}") from None
        if ready.problem is not None:
            await self.stop()
            raise WorkerCantStart(ready.problem)

    async def ask(self, message: Wire) -> bytes:
        """The line that is answered. Raises WorkerBroke."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise WorkerBroke("it was not started")
        try:
            process.stdin.write(message.model_dump_json().encode() + b"\n")
            await process.stdin.drain()
            answer = await process.stdout.readline()
        except (ConnectionError, ValueError) as error:
            raise WorkerBroke(str(error)) from None
        if not answer.endswith(b"\n"):
            code = await process.wait()
            raise WorkerBroke(f"its process ended with {'signal' if code < 0 else 'code'} {abs(code)}")
        return answer

    async def stop(self) -> None:
        """Ends the worker and its services; a worker that does not end is killed, and its services follow it."""
        process = self._process
        self._process = None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        await ended(process, STOP_S)


async def ended(process: asyncio.subprocess.Process, within_s: float) -> None:
    """Waits for a process that was told to end; after that time it and its session are killed."""
    try:
        await asyncio.wait_for(process.wait(), within_s)
    except TimeoutError:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        await process.wait()


class FlyingProcess(WorkerProcess):
    """One worker process that flies. `log`: where its standard error goes."""

    def __init__(self, job: Job, log: Path) -> None:
        super().__init__("evaluation.bench.worker", job, log)

    async def fly(self, order: Order) -> EpisodeRecord:
        """Raises WorkerBroke."""
        task = order.task
        answer = await self.ask(order)
        try:
            record = EpisodeRecord.model_validate_json(answer)
        except ValidationError as error:
            raise WorkerBroke(f"it answered {task.id} with no result: {first_problem(error)}") from None
        if record.task != task.id:
            raise WorkerBroke(f"it answered {task.id} with a result of {record.task}")
        return record


async def run_workers(work: Callable[[int], Coroutine[Any, Any, None]], count: int) -> None:
    """`work(1)` to `work(count)` side by side. Where one fails, or this is cancelled, the others are ended as well, and
    waited for. Raises what the first of them raised."""
    running = [asyncio.create_task(work(number)) for number in range(1, count + 1)]
    try:
        await asyncio.gather(*running)
    finally:
        for one in running:
            one.cancel()
        await asyncio.gather(*running, return_exceptions=True)


def broken_episode(task: Task, started: str, wall_s: float, why: str) -> EpisodeRecord:
    """The record of an episode whose worker broke: a failure, not a gap."""
    error = f"the worker broke: {why}"
    return EpisodeRecord(
        task=task.id, reason="error", result=None, error=error, started=started or now(), wall_s=round(wall_s, 4)
    )
