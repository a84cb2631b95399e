"""The customer of a task: knows the window that was meant, and answers what a mission asks about the request."""

from typing import Literal

from contracts.orchestrator import OpenQuestion
from evaluation.task_set.requests import with_article
from evaluation.task_set.task import Task

Asked = Literal["nobody", "task"]
"""Who answers a mission's questions in a run: nobody, so that a request that leaves something open ends there, or
whoever the task's request is from."""

PATIENCE_S = 60.0


class TaskCustomer:
    """Answers every question about the request alike: the floor, counted from 1 at street level, and the thing. Asked
    for something else at the window, there is nothing else to name. `asked` counts the questions."""

    patience_s = PATIENCE_S

    def __init__(self, task: Task) -> None:
        self._answer = f"Floor {task.floor}. At my window you see {with_article(task.object)}."
        self.asked = 0

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        self.asked = max(self.asked, number)
        return self._answer if question.topic == "request" else None
