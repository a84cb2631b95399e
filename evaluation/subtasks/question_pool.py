"""A subtask's tasks, spread over workers; what is told does not depend on how many there are."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from pydantic import ValidationError

from contracts.errors import first_problem
from evaluation.bench.worker_pool import WorkerBroke, WorkerCantStart, WorkerProcess, run_workers
from evaluation.subtasks.run import Asked
from evaluation.subtasks.worker import AskJob, AskOrder
from evaluation.task_set.task import Task

TRIES = 2


class CannotAsk(Exception):
    """A question could not be put, or workers don't start or break; the message says why."""


class QuestionWorker(Protocol):
    """What is needed of a worker. `start` raises WorkerCantStart, `ask_about` raises WorkerBroke."""

    async def start(self) -> None: ...

    async def ask_about(self, task: Task) -> Asked: ...

    async def stop(self) -> None: ...


class QuestionProcess(WorkerProcess):
    """One worker process. `log`: where its standard error goes."""

    def __init__(self, job: AskJob, log: Path) -> None:
        super().__init__("evaluation.subtasks.worker", job, log)

    async def ask_about(self, task: Task) -> Asked:
        """Raises WorkerBroke."""
        try:
            return Asked.model_validate_json(await self.ask(AskOrder(task=task)))
        except ValidationError as error:
            raise WorkerBroke(f"it answered {task.id} with no answer: {first_problem(error)}") from None


async def ask_all(
    job: AskJob,
    tasks: Sequence[Task],
    workers: int,
    told: Callable[[int], None],
    new_worker: Callable[[AskJob, Path], QuestionWorker] = QuestionProcess,
) -> list[Asked]:
    """Every task once, the answers in the tasks' order; `told` hears how many are done. A task at which a worker breaks
    is tried once more by a fresh one: a figure over a part of the questions would be no figure. Raises CannotAsk."""
    pending = deque(tasks)
    answers: dict[str, Asked] = {}

    async def work(number: int) -> None:
        logs = Path(job.logs) / f"worker-{number}"
        worker = new_worker(job.model_copy(update={"logs": str(logs)}), logs / "worker.log")
        try:
            await worker.start()
            while pending:
                task = pending.popleft()
                asked = await _asked(worker, task)
                if asked.problem is not None:
                    raise CannotAsk(f"{task.id}: {asked.problem}")
                answers[task.id] = asked
                told(len(answers))
        except WorkerCantStart as error:
            raise CannotAsk(str(error)) from None
        finally:
            # not to be left half done by a second Ctrl-C: services would stay behind
            await asyncio.shield(worker.stop())

    await run_workers(work, min(workers, len(tasks)))
    return [answers[task.id] for task in tasks]


async def _asked(worker: QuestionWorker, task: Task) -> Asked:
    """Raises CannotAsk, WorkerCantStart."""
    for attempt in range(1, TRIES + 1):
        try:
            return await worker.ask_about(task)
        except WorkerBroke as error:
            await worker.stop()
            if attempt == TRIES:
                raise CannotAsk(f"workers broke {TRIES} times at {task.id}; the last: {error}") from None
            await worker.start()
    raise AssertionError("unreachable")
