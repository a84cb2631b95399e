"""A task set flown through a running orchestrator: which deliveries that takes, and the figures that come of them."""

import time
from collections.abc import Callable, Iterator
from typing import NamedTuple
from uuid import uuid4

from contracts.orchestrator import Delivery, DeliveryQuestion, MissionSettings
from evaluation.bench.task_settings import settings_of_task
from evaluation.metrics.episode import EpisodeRecord
from evaluation.metrics.summary import Summary, summarize
from evaluation.metrics.taxonomy import reason_of
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import BadTasks, load

OnRecord = Callable[[EpisodeRecord], None]


class BenchResult(NamedTuple):
    """The figures of a run, as `logisticsvln bench` prints them, and every task as it was flown."""

    summary: Summary
    records: tuple[EpisodeRecord, ...]


class Ordered(NamedTuple):
    """A task as a delivery: what is asked for, under which key."""

    task: Task
    question: DeliveryQuestion
    key: str


class RemoteBench:
    """Knows which deliveries there have to be, and collects what comes of them; it sends nothing itself."""

    def __init__(
        self,
        tasks: str,
        backend: str,
        settings: MissionSettings | None,
        limit: int | None,
        on_record: OnRecord | None,
    ) -> None:
        """Raises BadTasks."""
        if limit is not None and limit < 1:
            raise BadTasks(f"limit: {limit} tasks are none; give 1 or more, or leave it out for all")
        self._tasks = {task.id: task for task in load(tasks).tasks[:limit]}
        self._backend = backend
        self._settings = settings or MissionSettings()
        self._on_record = on_record
        self._run = uuid4().hex
        self._began = time.monotonic()
        self._task_of: dict[str, Task] = {}
        self._records: list[EpisodeRecord] = []

    def orders(self) -> Iterator[Ordered]:
        """One delivery a task; nobody answers questions."""
        for task in self._tasks.values():
            question = DeliveryQuestion(
                request=task.request,
                scene=task.scene,
                answer_within_s=0.0,
                settings=settings_of_task(self._settings, self._backend, task),
            )
            yield Ordered(task, question, f"{self._run}-{task.id}")

    def ordered(self, task: Task, delivery: Delivery) -> None:
        """The delivery that was made of a task."""
        self._task_of[delivery.id] = task

    def pending(self) -> list[str]:
        """The ids of all deliveries, in the order in which they were asked for."""
        return list(self._task_of)

    def done(self, delivery: Delivery) -> None:
        """A delivery has ended."""
        task, result = self._task_of[delivery.id], delivery.result
        reason = reason_of(task, result)
        if result is None:
            error: str | None = "the orchestrator has no result of it"
        else:
            error = result.message if reason == "error" else None
        record = EpisodeRecord(
            task=task.id,
            reason=reason,
            result=result,
            error=error,
            started=delivery.started or delivery.created,
            wall_s=result.timings_s.get("total", 0.0) if result else 0.0,
            render_s=result.timings_s.get("render", 0.0) if result else 0.0,
            model_s=sum(calls.seconds for calls in result.model_calls.values()) if result else 0.0,
        )
        self._records.append(record)
        if self._on_record is not None:
            self._on_record(record)

    def result(self) -> BenchResult:
        """The figures of what was flown."""
        wall_s = time.monotonic() - self._began
        return BenchResult(summarize(self._tasks, self._records, wall_s), tuple(self._records))
