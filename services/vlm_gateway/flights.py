"""Identical questions at the same time share one call."""

import asyncio
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

from service_kit.running_loop import running_loop

T = TypeVar("T")


class Landed(NamedTuple, Generic[T]):
    """What came back; `shared` is true for all but the caller who started the flight."""

    value: T
    shared: bool


class _Flight(Generic[T]):
    __slots__ = ("passengers", "task")

    def __init__(self, task: asyncio.Task[T]) -> None:
        self.passengers: set[asyncio.Future[T]] = set()
        self.task = task


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

    async def share(self, key: str, start: Callable[[], Coroutine[Any, Any, T]]) -> Landed[T]:
        """The result of `start()`, or of the call under way for the same key. Raises what that call raises."""
        flight = self._live.get(key)
        shared = flight is not None
        loop = running_loop()
        if flight is None:
            flight = self._live[key] = _Flight(loop.create_task(start()))
            flight.task.add_done_callback(partial(self._landed, key, flight))
        passenger: asyncio.Future[T] = loop.create_future()
        flight.passengers.add(passenger)
        try:
            return Landed(await passenger, shared)
        finally:
            flight.passengers.discard(passenger)
            if not flight.passengers and not flight.task.done():
                self._live.pop(key, None)  # newcomers must not board a flight that is being cancelled
                flight.task.cancel()

    def _landed(self, key: str, flight: _Flight[T], task: "asyncio.Task[T]") -> None:
        if self._live.get(key) is flight:
            del self._live[key]
        error = None if task.cancelled() else task.exception()
        for passenger in flight.passengers:
            if passenger.done():
                continue  # left in this very moment
            if task.cancelled():
                passenger.cancel()
            elif error is not None:
                passenger.set_exception(error)
            else:
                passenger.set_result(task.result())
