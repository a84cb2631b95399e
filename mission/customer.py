"""The customer, as a mission sees them: somebody who may answer a question."""

from collections.abc import Sequence
from typing import Protocol

from contracts.orchestrator import OpenQuestion

DEFAULT_PATIENCE_S = 600.0
"""How long an answer is waited for unless the deployment or the delivery says otherwise."""


class Customer(Protocol):
    """Whoever answers. The mission itself ends the waiting after `patience_s`, by cancelling `answer`."""

    @property
    def patience_s(self) -> float: ...

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        """What the customer says to question `number` (1, 2, ...) of the mission; null where nobody will say anything.
        The same number again is the same question, asked by a step that is done again."""
        ...


class AnsweredBeforehand:
    """Answers that were given with the request, in the order of the questions; what is asked beyond them goes to
    `then`, or to nobody."""

    def __init__(self, answers: Sequence[str], then: Customer | None = None) -> None:
        self._answers = tuple(answers)
        self._then = then

    @property
    def patience_s(self) -> float:
        return self._then.patience_s if self._then is not None else DEFAULT_PATIENCE_S

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        if number <= len(self._answers):
            return self._answers[number - 1]
        return await self._then.answer(number, question) if self._then is not None else None
