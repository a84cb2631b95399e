"""One worker of a machine: takes episodes from the queue of a database, and flies one at a time.

`python -m evaluation.bench.queue_worker` reads one line of standard input, a Post, and works until its input ends. It
says on standard output, a line each, what it has flown.
"""

import asyncio
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

from dbos import DBOS, DBOSConfig
from pydantic import ValidationError
from sqlalchemy.exc import SQLAlchemyError

from contracts.base import Wire
from evaluation.bench.queue_database import (
    APPLICATION,
    EPISODE,
    LOST_AFTER_S,
    QUEUE,
    BadDatabase,
    QueueDatabase,
    WorkerRoll,
    reason_of,
)
from evaluation.bench.run import MAX_BROKEN_IN_A_ROW, CannotRun
from evaluation.bench.worker import Job, Order
from evaluation.bench.worker_loop import LINE_LIMIT
from evaluation.bench.worker_pool import FlyingProcess, FlyingWorker, WorkerBroke, WorkerCantStart, broken_episode
from evaluation.metrics.episode import EpisodeRecord
from mission.record import now

BEATS = 6
"""So many signs of life in the time after which a worker counts as dead."""
MAX_DEATHS = 5
"""An episode during which so many workers died is taken for what killed them."""


class Post(Wire):
    """What a worker is told: the database, which program it is, and where its logs go. `poll_s`: the time between two
    looks at the queue."""

    database: str
    program: str
    logs: str
    lost_after_s: float = LOST_AFTER_S
    poll_s: float = 0.2


class QueueWorker:
    """One a process: the engine keeps its own in globals."""

    def __init__(
        self,
        post: Post,
        tell: Callable[[str], None],
        new_worker: Callable[[Job, Path], FlyingWorker] = FlyingProcess,
    ) -> None:
        """`tell` is given a sentence for every episode flown. Raises BadDatabase."""
        self.name = f"{os.uname().nodename[:40]}-{os.getpid()}-{uuid4().hex[:8]}"
        self._post = post
        self._tell = tell
        self._database = QueueDatabase(post.database)
        self._roll = WorkerRoll(self._database)
        self._pilot = Pilot(Path(post.logs), new_worker)
        self._one_at_a_time = asyncio.Lock()
        self._problem: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._leaving = False

    async def run(self) -> None:
        """Until it is cancelled; what is under way then is left for other workers. Raises CannotRun."""
        beating = asyncio.create_task(self._beat())
        try:
            await self._launch()
            await asyncio.wait({self._problem, beating}, return_when=asyncio.FIRST_COMPLETED)
            if self._problem.done():
                self._problem.result()
            beating.result()
        finally:
            self._leaving = True
            beating.cancel()
            await asyncio.shield(self._leave())

    async def _launch(self) -> None:
        config: DBOSConfig = {
            "name": APPLICATION,
            "system_database_engine": self._database.engine,
            "system_database_url": self._database.engine.url.render_as_string(hide_password=False),
            "executor_id": self.name,
            "application_version": self._post.program,
            "log_level": "ERROR",
            "console_log_level": "ERROR",
            "enable_otlp": False,
            "use_listen_notify": False,
            "notification_listener_polling_interval_sec": 0.1,
            "scheduler_polling_interval_sec": 3600.0,
        }
        DBOS(config=config)
        fly = self._fly

        @DBOS.workflow(name=EPISODE, max_recovery_attempts=MAX_DEATHS)
        async def episode(job: str, order: str) -> str:
            return await DBOS.run_step_async({"name": "fly"}, fly, job, order)

        await asyncio.to_thread(self._roll.beat, self.name, self._post.program)
        DBOS.launch()
        await DBOS.register_queue_async(QUEUE, worker_concurrency=1, polling_interval_sec=self._post.poll_s)

    async def _fly(self, job: str, order: str) -> str:
        """An episode's record, as JSON."""
        try:
            async with self._one_at_a_time:
                record = await self._pilot.fly(Job.model_validate_json(job), Order.model_validate_json(order))
            if not self._leaving:
                self._tell(f"{record.task}: {record.reason}, {record.wall_s:.1f} s")
                return record.model_dump_json()
        except CannotRun as error:
            if not self._problem.done():
                self._problem.set_exception(error)
        await asyncio.Event().wait()  # nothing may be recorded: the episode is another worker's
        raise AssertionError("nobody sets it")

    async def _beat(self) -> None:
        """Tells that it lives, and has dead workers' episodes queued again."""
        while True:
            await asyncio.sleep(self._post.lost_after_s / BEATS)
            try:
                await asyncio.to_thread(self._look_round)
            except SQLAlchemyError as error:
                self._tell(f"the database does not answer: {reason_of(error)}")

    def _look_round(self) -> None:
        program = self._post.program
        self._roll.beat(self.name, program)
        silent = self._roll.silent(program, self._post.lost_after_s)
        if silent:
            DBOS._recover_pending_workflows(silent)
            self._roll.forget(silent)

    async def _leave(self) -> None:
        await self._pilot.stop()
        await asyncio.to_thread(self._roll.leave, self.name)
        await asyncio.to_thread(DBOS.destroy, destroy_registry=True, workflow_completion_timeout_sec=0)
        self._database.close()  # the engine has taken the loop's threads along


class Pilot:
    """A worker's process, started anew for each run's job, and when it breaks."""

    def __init__(self, logs: Path, new_worker: Callable[[Job, Path], FlyingWorker]) -> None:
        self._logs = logs
        self._new_worker = new_worker
        self._job: Job | None = None
        self._worker: FlyingWorker | None = None
        self._broken = 0

    async def fly(self, job: Job, order: Order) -> EpisodeRecord:
        """Raises CannotRun where workers don't start, or break one after the other."""
        started, began = now(), time.perf_counter()
        worker = await self._ready(job)
        try:
            record = await worker.fly(order)
        except WorkerBroke as error:
            await self.stop()
            self._broken += 1
            if self._broken >= MAX_BROKEN_IN_A_ROW:
                raise CannotRun(f"{self._broken} workers broke in a row; the last: {error}") from None
            return broken_episode(order.task, started, time.perf_counter() - began, str(error))
        self._broken = 0
        return record

    async def _ready(self, job: Job) -> FlyingWorker:
        if self._worker is not None and self._job == job:
            return self._worker
        await self.stop()
        worker = self._new_worker(job.model_copy(update={"logs": str(self._logs)}), self._logs / "worker.log")
        try:
            await worker.start()
        except WorkerCantStart as error:
            raise CannotRun(str(error)) from None
        self._worker, self._job = worker, job
        return worker

    async def stop(self) -> None:
        worker, self._worker = self._worker, None
        if worker is not None:
            await worker.stop()


async def _work() -> None:
    reader = asyncio.StreamReader(limit=LINE_LIMIT)
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    worker = QueueWorker(Post.model_validate_json(await reader.readline()), _say)
    working, leaving = asyncio.create_task(worker.run()), asyncio.create_task(reader.read())
    await asyncio.wait({working, leaving}, return_when=asyncio.FIRST_COMPLETED)
    if not working.done():
        working.cancel()
        await asyncio.wait({working})
        return
    working.result()


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> int:
    """Returns the exit status: 1 where it can't work, whose reason is its last line on standard error."""
    try:
        asyncio.run(_work())
    except (BadDatabase, CannotRun, ValidationError, SQLAlchemyError) as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
