"""The customer of a delivery over REST: a question lies here until its answer is posted."""

import asyncio
from collections.abc import Callable

from contracts.orchestrator import OpenQuestion


class Mailbox:
    """One delivery's customer. `question` is what is asked now; null where nothing is."""

    def __init__(self, patience_s: float, has_room: Callable[[], bool]) -> None:
        """`has_room`: may this delivery wait as well?"""
        self._patience_s = patience_s
        self._has_room = has_room
        self._answer: asyncio.Future[str] | None = None
        self.question: OpenQuestion | None = None

    @property
    def patience_s(self) -> float:
        return self._patience_s

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        """Waits for `give`; null at once where there is no room to wait."""
        if not self._has_room():
            return None
        self.question = question
        self._answer = asyncio.get_running_loop().create_future()
        try:
            return await self._answer
        finally:
            self.question = self._answer = None

    def give(self, text: str) -> bool:
        """Hands the answer to whoever waits for it; false where nothing is asked, or was answered already."""
        if self._answer is None or self._answer.done():
            return False
        self._answer.set_result(text)
        self.question = None
        return True
