"""The customer of a delivery over REST: answers lie in the database, posted at whichever orchestrator."""

import asyncio
import json

from contracts.orchestrator import OpenQuestion
from orchestrator.store.deliveries import DeliveryStore

LOOK_EVERY_S = 0.5


class StoredCustomer:
    """Waits for the answer to a question until the mission ends the waiting."""

    def __init__(self, store: DeliveryStore, delivery: str, patience_s: float) -> None:
        self._store = store
        self._delivery = delivery
        self._patience_s = patience_s

    @property
    def patience_s(self) -> float:
        return self._patience_s

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        while True:
            found = await asyncio.to_thread(self.given, number)
            if found is not None:
                return found
            await asyncio.sleep(LOOK_EVERY_S)

    def given(self, number: int) -> str | None:
        """The answer to question `number`, where there is one."""
        stored = self._store.get(self._delivery)
        answers: list[str] = [] if stored is None else json.loads(stored.answers)
        return answers[number - 1] if number <= len(answers) else None
