"""Identical questions at the same time share one call."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")


class Landed(NamedTuple, Generic[T]):
    """What came back; `shared` is true for all but the caller who started the flight."""

    value: T
    shared: bool


@dataclass
class _Flight(Generic[T]):
    task: "asyncio.Task[T]"
    passengers: int = 0


class Flights(Generic[T]):
    """Calls by key. A caller who goes away leaves the others alone; when the last one goes, the call is cancelled."""

    def __init__(self) -> None:
        self._live: dict[str, _Flight[T]] = {}

    @property
    def live(self) -> int:
        return len(self._live)

    def flies(self, key: str) -> bool:
        """Whether a call for this key is under way."""
        return key in self._live

    async def share(self, key: str, start: Callable[[], Awaitable[T]]) -> Landed[T]:
        """The result of `start()`, or of the call under way for the same key. Raises what that call raises."""
        flight = self._live.get(key)
        shared = flight is not None
        if flight is None:
            flight = _Flight(asyncio.ensure_future(_run(start)))
            self._live[key] = flight
            flight.task.add_done_callback(lambda task: self._landed(key, task))
        flight.passengers += 1
        try:
            return Landed(await asyncio.shield(flight.task), shared)
        finally:
            flight.passengers -= 1
            if flight.passengers == 0 and not flight.task.done():
                self._live.pop(key, None)  # newcomers must not board a flight that is being cancelled
                flight.task.cancel()

    def _landed(self, key: str, task: "asyncio.Task[T]") -> None:
        flight = self._live.get(key)
        if flight is not None and flight.task is task:
            del self._live[key]
        if not task.cancelled():
            task.exception()  # read, so that a flight whose passengers all left is not reported as forgotten


async def _run(start: Callable[[], Awaitable[T]]) -> T:
    return await start()
