"""A subtask over several workers: every task once, the same figures whoever asked, and every end has its message."""

import asyncio
import json
from collections.abc import Iterable

import pytest

from contracts.llm_parser import ParseAnswer
from contracts.orchestrator import ModelCalls
from contracts.sim import TruthView
from evaluation.bench.worker_pool import WorkerBroke
from evaluation.subtasks import choice, floors, parse, recognition
from evaluation.subtasks.question_pool import TRIES, CannotAsk, ask_all
from evaluation.subtasks.run import Asked, Plan, scored
from evaluation.subtasks.worker import AskJob
from evaluation.task_set.task import Task
from tests.evaluation.evaluation_kit import a_task
from tests.evaluation.scripted_worker import ScriptedWorkerBase

JOB = AskJob(subtask="parse", plan=Plan("embedded"), logs="nowhere")
TASKS = [a_task(f"t-{n}") for n in range(7)]


class ScriptedQuestionWorker(ScriptedWorkerBase):
    """Answers in no time, later tasks sooner; breaks at the tasks in `breaks` as often as they say."""

    def __init__(self, asked: list[str], breaks: dict[str, int], problem: str | None = None, starts: int = 99) -> None:
        super().__init__(starts)
        self._asked = asked
        self._breaks = breaks
        self._problem = problem

    async def ask_about(self, task: Task) -> Asked:
        assert self.running
        self._asked.append(task.id)
        await asyncio.sleep(0.02 / (1 + len(self._asked)))
        if self._breaks.get(task.id, 0) > 0:
            self._breaks[task.id] -= 1
            raise WorkerBroke("its process ended with signal 9")
        right = parse.Parsed(task.style, task.floor, task.object, task.floor, task.object)
        return Asked(task=task.id, parsed=(right,), problem=self._problem, calls=ModelCalls(calls=1))


async def ask(workers: int, pool: list[ScriptedQuestionWorker], heard: list[int] | None = None) -> list[Asked]:
    fresh = iter(pool)
    told = heard.append if heard is not None else lambda _: None
    return await ask_all(JOB, TASKS, workers, told, new_worker=lambda job, log: next(fresh))


def some(
    n: int, asked: list[str], breaks: Iterable[tuple[str, int]] = (), **more: object
) -> list[ScriptedQuestionWorker]:
    shared = dict(breaks)
    return [ScriptedQuestionWorker(asked, shared, **more) for _ in range(n)]


@pytest.mark.parametrize("workers", [1, 3, 20])
async def test_every_task_is_asked_about_once_and_the_answers_keep_the_tasks_order(workers: int) -> None:
    asked: list[str] = []
    heard: list[int] = []
    pool = some(workers, asked)
    answers = await ask(workers, pool, heard)
    assert sorted(asked) == [t.id for t in TASKS]
    assert [a.task for a in answers] == [t.id for t in TASKS]
    assert heard == list(range(1, len(TASKS) + 1))
    assert not any(worker.running for worker in pool)


async def test_a_task_at_which_a_worker_breaks_is_tried_once_more() -> None:
    asked: list[str] = []
    answers = await ask(2, some(2, asked, [("t-2", TRIES - 1)]))
    assert asked.count("t-2") == TRIES
    assert len(answers) == len(TASKS)


async def test_what_cannot_be_asked_ends_it_with_the_reason_and_no_worker_running() -> None:
    for pool, said in (
        (some(2, [], [("t-2", TRIES)]), "broke 2 times at t-2"),
        (some(2, [], problem="sim: it is gone"), "sim: it is gone"),
        (some(2, [], starts=0), "no port is free"),
    ):
        with pytest.raises(CannotAsk, match=said):
            await ask(2, pool)
        assert not any(worker.running for worker in pool)


async def test_interrupted_it_stops_its_workers() -> None:
    pool = some(2, [])
    asking = asyncio.create_task(ask(2, pool))
    await asyncio.sleep(0.005)
    assert any(worker.running for worker in pool)
    asking.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asking
    assert not any(worker.running for worker in pool)


def test_answers_survive_the_pipe() -> None:
    view = TruthView(camera="front-right", objects=(), building_box=None, floors_visible=2, floor_rows=(0.25, 0.75))
    asked = Asked(
        task="t-1",
        parsed=(parse.Parsed("plain", 3, "red kite", None, "red kite"),),
        counts=(floors.Count(4, None, "villa"), floors.Count(4, 3, "villa")),
        looks=(
            recognition.JudgedLook("kite", "red", (view,), None),
            recognition.JudgedLook("kite", "red", (view,), ()),
        ),
        choices=(choice.Choice({"a": 3.5, "c": None}, "c"),),
        skipped=2,
        model="by hand",
    )
    again = Asked.model_validate_json(asked.model_dump_json())
    assert again == asked
    assert isinstance(again.looks[0].views[0], TruthView)
    assert AskJob.model_validate_json(JOB.model_dump_json()) == JOB


def test_figures_add_up_over_tasks_and_count_what_was_asked() -> None:
    answer = ParseAnswer(floor=3, object="green flower pot", model="by hand")
    right = parse.Parsed("plain", 3, "green flower pot", answer.floor, answer.object)
    wrong = right._replace(found_floor=2)
    asked = [
        Asked(task="t-1", parsed=(right,), model="by hand", calls=ModelCalls(calls=1, latencies_s=(0.5,))),
        Asked(task="t-2", parsed=(wrong,), skipped=1, calls=ModelCalls(calls=1, unreachable=1)),
    ]
    scores = scored("parse", Plan("embedded"), asked, 2.0)
    assert (scores.rates["both"].k, scores.rates["both"].n) == (1, 2)
    assert (scores.questions, scores.skipped, scores.model) == (2, 1, "by hand")
    assert (scores.model_calls.calls, scores.model_calls.unreachable) == (2, 1)
    assert json.loads(scores.model_dump_json())["wall_s"] == 2.0
