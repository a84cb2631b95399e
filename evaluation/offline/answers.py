"""Who answered what: a file of answers for each who was asked, which only grows and is taken up again."""

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from pydantic import ValidationError

from contracts.base import ModelName
from contracts.vlm_gateway import Answer, ChooseDirectionQuestion, FindObjectQuestion
from evaluation.offline.questions import Asked, Given, NoQuestions, RecordedQuestion, given
from mission.ports import ModelUnreachable, Vision


class AnswerFile:
    """The answers of one model or person in `folder`, by question. Use as a context manager."""

    def __init__(self, folder: Path, who: str) -> None:
        """Raises OSError, NoQuestions where the file is damaged elsewhere than in a last line that was cut off."""
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{who.replace('/', '~')}.jsonl"
        self.given: dict[str, Given] = {}
        self.trouble: str | None = None
        """Why the first question that got no answer got none."""
        data = self.path.read_bytes() if self.path.exists() else b""
        whole = data.rfind(b"\n") + 1
        for number, line in enumerate(data[:whole].splitlines(), start=1):
            try:
                one = Given.model_validate_json(line)
            except ValidationError:
                raise NoQuestions(f"{self.path}, line {number} is no answer; take the file away") from None
            self.given[one.question] = one
        self._file = self.path.open("ab")
        self._file.truncate(whole)

    def add(self, answer: Given) -> None:
        """On disk when this returns, but for one that says nothing. Raises OSError."""
        self.given[answer.question] = answer
        if answer.outcome != "unreachable":
            self._file.write(answer.model_dump_json().encode() + b"\n")
            self._file.flush()

    def pending(self, questions: Sequence[RecordedQuestion]) -> list[RecordedQuestion]:
        return [question for question in questions if question.id not in self.given]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


async def ask_all(
    vision: Vision,
    model: ModelName,
    questions: Sequence[RecordedQuestion],
    answers: AnswerFile,
    at_once: int,
    told: Callable[[], None] = lambda: None,
) -> None:
    """Asks the model what it has not been asked yet, so many questions at once; `told` hears of each. Raises PortError
    where the gateway itself fails or there is no such model, NoQuestions where a picture is missing, OSError."""
    pending = iter(answers.pending(questions))

    async def work() -> None:
        for question in pending:
            try:
                said = given(question.id, await _put(vision, question.asked(model)))
            except ModelUnreachable as error:
                said = Given(question=question.id, outcome="unreachable")
                answers.trouble = answers.trouble or str(error)
            answers.add(said)
            told()

    async with asyncio.TaskGroup() as group:
        for _ in range(at_once):
            group.create_task(work())


async def _put(vision: Vision, asked: Asked) -> Answer:
    if isinstance(asked, FindObjectQuestion):
        return await vision.find_object(asked)
    if isinstance(asked, ChooseDirectionQuestion):
        return await vision.choose_direction(asked)
    return await vision.floor_count(asked)
