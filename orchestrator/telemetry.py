"""Where the drones of deliveries in the air are, as their vehicles tell it: asked when somebody looks."""

import asyncio
import json
import time
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from typing import NamedTuple

import zstandard

from contracts.overview import DroneSeen
from mission.ports import PortError
from orchestrator.hangar import Hangar
from orchestrator.newest import Newest
from orchestrator.store.deliveries import DeliveryStore, StoredDelivery

FRESH_S = 0.4
"""Whoever looks within that time is told the same."""
ASK_S = 2.0
MAX_KEPT = 2_000


class Silent(Exception):
    """The drone does not tell where it is; the message says why."""


class _Asked(NamedTuple):
    """A question to a vehicle, and when it was asked."""

    at: float
    task: asyncio.Task[DroneSeen]

    def stale(self) -> bool:
        """Its answer is told to nobody any more."""
        return self.task.done() and time.monotonic() > self.at + FRESH_S


class Telemetry:
    """One question to a vehicle serves everybody who looks."""

    def __init__(self, hangar: Hangar, store: DeliveryStore) -> None:
        self._hangar = hangar
        self._store = store
        self._names: Newest[tuple[str, int], str] = Newest(MAX_KEPT)
        self._asked: dict[str, _Asked] = {}

    async def of(self, delivery: str) -> DroneSeen | None:
        """The drone that flies the delivery; null where none does. Raises Silent where it does not tell."""
        stored = await asyncio.to_thread(self._store.get, delivery)
        if stored is None or stored.vehicle is None or stored.status == "done":
            return None
        self._forget_stale()
        asked = self._asked.get(delivery)
        if asked is None or asked.stale():
            name = self._name_of(stored)
            if name is None:
                return None
            task = asyncio.create_task(self._ask(stored.vehicle, name), name=f"drone of {delivery}")
            self._asked.pop(delivery, None)  # the latest comes last
            asked = self._asked[delivery] = _Asked(time.monotonic(), task)
        return await asyncio.shield(asked.task)

    def _forget_stale(self) -> None:
        """Of drones that have landed nobody asks any more."""
        while self._asked and next(iter(self._asked.values())).stale():
            del self._asked[next(iter(self._asked))]

    async def samples(self, delivery: str, every_s: float = 0.5) -> AsyncIterator[DroneSeen]:
        """Again and again, as long as the delivery flies or waits; a drone that does not tell is asked again."""
        while True:
            try:
                seen = await self.of(delivery)
            except Silent:
                seen = None
            if seen is not None:
                yield seen
            await asyncio.sleep(every_s)

    async def _ask(self, member: str, name: str) -> DroneSeen:
        try:
            state = await asyncio.wait_for(self._hangar.drone(member, name), ASK_S)
        except TimeoutError:
            raise Silent(f"{member} does not answer within {ASK_S:g} s") from None
        except PortError as error:
            raise Silent(str(error)) from None
        return DroneSeen(time=datetime.now(UTC), state=state)

    def _name_of(self, stored: StoredDelivery) -> str | None:
        """What the vehicle calls the drone of this flight; null before it is placed."""
        key = (stored.id, stored.flights)
        if key not in self._names:
            name = None if stored.state is None else json.loads(zstandard.decompress(stored.state)).get("vehicle")
            if name is None:
                return None
            self._names[key] = name
        return self._names[key]
