"""A run's side of the queue: each pending episode is queued, and its record fetched once a worker has flown it."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any
from uuid import uuid4

from dbos import DBOSClient, EnqueueOptions
from pydantic import ValidationError
from sqlalchemy.exc import OperationalError, SQLAlchemyError

from contracts.errors import first_problem
from evaluation.bench.folder import RunFolder
from evaluation.bench.queue_database import APPLICATION, EPISODE, QUEUE, QueueDatabase, WorkerRoll
from evaluation.bench.run import Listener, Run, Standing
from evaluation.bench.worker import Job, Order
from evaluation.bench.worker_pool import WorkerBroke
from evaluation.metrics.episode import EpisodeRecord
from mission.record import write_whole

LOOK_EVERY_S = 0.5
BATCH = 50
NOBODY_EVERY_S = 30.0
OVER = ["SUCCESS", "ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"]


class EpisodeQueue:
    """The episodes of one run in the database. What is queued stays there when the run is killed; the same command with
    the same folder finds it again."""

    def __init__(self, database: QueueDatabase, folder: Path, program: str, tell: Callable[[str], None]) -> None:
        """`tell` is given a sentence where nobody flies. Raises OSError."""
        self._database = database
        self._program = program
        self._tell = tell
        self._prefix = f"{_run_id(folder)}."
        # without retries of its own, which would keep Ctrl-C waiting while the database is away
        self._client = DBOSClient(
            system_database_engine=database.engine,
            application_name=APPLICATION,
            lazy=True,
            retry_connection_errors=False,
        )
        self._roll = WorkerRoll(database)
        self._workers = 0
        self._waiting: dict[str, asyncio.Future[str]] = {}

    def run(self, folder: RunFolder, job: Job, listener: Listener) -> Run:
        """The run whose episodes are all queued at once."""

        def heard(standing: Standing) -> None:
            listener(standing._replace(workers=self._workers))

        return Run(folder, job, max(1, len(folder.pending)), heard, lambda job, _: QueuedWorker(self, job))

    async def serve(self, flying: Coroutine[Any, Any, None]) -> None:
        """Flies that run, and fetches meanwhile what was flown. Raises what either raises."""
        tasks = asyncio.create_task(flying), asyncio.create_task(self._watch())
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
            with contextlib.suppress(SQLAlchemyError):  # what is left is found again by the next session
                await asyncio.shield(self._clear())

    async def flown(self, job: Job, order: Order) -> EpisodeRecord:
        """The record of that episode. Raises WorkerBroke."""
        name = self._prefix + order.task.id
        options: EnqueueOptions = {
            "workflow_name": EPISODE,
            "queue_name": QUEUE,
            "workflow_id": name,
            "app_version": self._program,
        }
        self._waiting[name] = asyncio.get_running_loop().create_future()
        try:
            await self._client.enqueue_async(options, job.model_dump_json(), order.model_dump_json())
            return EpisodeRecord.model_validate_json(await self._waiting[name])
        except ValidationError as error:
            raise WorkerBroke(f"{order.task.id} was answered with no result: {first_problem(error)}") from None
        finally:
            del self._waiting[name]

    async def forget(self, order: Order) -> None:
        """That episode's record is in the run's folder."""
        await self._client.delete_workflow_async(self._prefix + order.task.id)

    async def _watch(self) -> None:
        said = -NOBODY_EVERY_S
        while True:
            with contextlib.suppress(OperationalError):  # a database that is away now is asked again
                await self._fetch()
                self._workers = await asyncio.to_thread(self._roll.count, self._program)
            now = time.monotonic()
            if self._workers == 0 and now - said >= NOBODY_EVERY_S:
                said = now
                self._tell(
                    "nobody flies: start `logisticsvln worker` of this version on this database "
                    f"(program {self._program})"
                )
            await asyncio.sleep(LOOK_EVERY_S)

    async def _clear(self) -> None:
        """Nobody waits for what is left: what is under way ends unrecorded."""
        left = await self._client.list_workflows_async(
            workflow_id_prefix=self._prefix, load_input=False, load_output=False
        )
        names = [workflow.workflow_id for workflow in left]
        if names:
            await self._client.cancel_workflows_async(names)
            await self._client.delete_workflows_async(names)

    async def _fetch(self) -> None:
        names = [name for name, future in self._waiting.items() if not future.done()]
        for k in range(0, len(names), BATCH):
            over = await self._client.list_workflows_async(
                workflow_ids=names[k : k + BATCH], status=OVER, load_input=False, load_output=True
            )
            for workflow in over:
                future = self._waiting.get(workflow.workflow_id)
                if future is None or future.done():
                    continue
                if workflow.status == "SUCCESS":
                    future.set_result(str(workflow.output))
                else:
                    future.set_exception(WorkerBroke(f"its workers ended with {workflow.status}: {workflow.error}"))


class QueuedWorker:
    """Flies nothing itself."""

    def __init__(self, queue: EpisodeQueue, job: Job) -> None:
        self._queue = queue
        self._job = job
        self._flown: Order | None = None

    async def start(self) -> None:
        """The workers' own business."""

    async def fly(self, order: Order) -> EpisodeRecord:
        """Raises WorkerBroke."""
        await self.stop()
        record = await self._queue.flown(self._job, order)
        self._flown = order
        return record

    async def stop(self) -> None:
        """Whoever had the last record has put it in its place."""
        flown, self._flown = self._flown, None
        if flown is not None:
            await self._queue.forget(flown)


def _run_id(folder: Path) -> str:
    """The run's name in the queue, the same in each of its sessions."""
    path = folder / "queue_id"
    if not path.exists():
        write_whole(path, uuid4().hex)
    return path.read_text(encoding="ascii").strip()
