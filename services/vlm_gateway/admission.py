"""Bounded concurrency with a bounded, fair queue in front of one model.

Callers wait in a line of their key's own, and the lines are served in turn (round robin): one key's flood costs another
no more than one place. Where the queue is full, a key that waits for less than the longest line gets in, and the newest
of that line is refused instead.
"""

import asyncio
from collections import OrderedDict, deque
from types import TracebackType
from typing import Protocol, Self

from service_kit.running_loop import running_loop
from services.vlm_gateway.errors import ModelOverloaded
from services.vlm_gateway.keys import asking


class Places(Protocol):
    """The places at one model."""

    @property
    def taken(self) -> int: ...
    def take(self) -> bool:
        """Whether there was one free; it is taken then."""
        ...

    def give_back(self) -> None: ...

    @property
    def waiting_elsewhere(self) -> int:
        """How many wait for them in other processes."""
        ...

    def waits(self, count: int) -> None:
        """So many wait for them in this one."""
        ...


class OwnPlaces:
    """Those of a model that only this process asks."""

    waiting_elsewhere = 0

    def __init__(self, concurrency: int) -> None:
        self._concurrency = concurrency
        self.taken = 0

    def take(self) -> bool:
        if self.taken >= self._concurrency:
            return False
        self.taken += 1
        return True

    def give_back(self) -> None:
        self.taken -= 1

    def waits(self, count: int) -> None:
        pass


class Admission:
    """`async with admission:` holds one of `concurrency` places; at most `queue` callers wait.

    Raises ModelOverloaded at once where the queue is full.
    """

    def __init__(self, model: str, concurrency: int, queue: int, places: Places | None = None) -> None:
        self._model = model
        self._places = places or OwnPlaces(concurrency)
        self._queue = queue
        self._waiting = 0
        self._lines: OrderedDict[str, deque[asyncio.Future[None]]] = OrderedDict()

    @property
    def running(self) -> int:
        return self._places.taken

    @property
    def waiting(self) -> int:
        return self._waiting

    async def __aenter__(self) -> Self:
        await self.enter()
        return self

    def entered(self) -> bool:
        """Whether there was a place free and nobody in front; it is taken then."""
        return not self._waiting and self._places.take()

    async def enter(self, deadline: float | None = None) -> None:
        """Take a place; `leave` gives it back. Raises TimeoutError where none was free until `deadline` (of the event
        loop's clock)."""
        if self.entered():
            return
        if deadline is None:
            await self._queue_up()
        else:
            async with asyncio.timeout_at(deadline):
                await self._queue_up()

    async def _queue_up(self) -> None:
        caller = asking.get().name
        if self._waiting + self._places.waiting_elsewhere >= self._queue:
            self._make_room(caller)
        turn: asyncio.Future[None] = running_loop().create_future()
        self._lines.setdefault(caller, deque()).append(turn)
        self._waiting += 1
        self._places.waits(self._waiting)
        self.serve()  # a place may have been given back elsewhere before anybody knew that one is wanted here
        try:
            await turn
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled() and turn.exception() is None:
                self.leave()  # the place was already handed over: pass it on
            else:
                self._remove(caller, turn)
            raise

    def _make_room(self, caller: str) -> None:
        """Refuse somebody: the newcomer, or the newest of a longer line than its own. Raises ModelOverloaded."""
        longest = max(self._lines, key=lambda name: len(self._lines[name]), default=caller)
        if len(self._lines.get(longest, ())) <= len(self._lines.get(caller, ())) + 1:
            raise self._overloaded()
        loser = self._lines[longest][-1]
        self._remove(longest, loser)
        if not loser.done():
            loser.set_exception(self._overloaded())

    def _overloaded(self) -> ModelOverloaded:
        return ModelOverloaded(
            f"model {self._model!r} answers {self.running} questions and {self._waiting} more wait; "
            "ask again later, or raise its concurrency or queue",
            details={"model": self._model, "running": self.running, "waiting": self._waiting},
        )

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.leave()

    def leave(self) -> None:
        """Give the place back, and hand it to whose turn it is."""
        self._places.give_back()
        if self._waiting:
            self.serve()

    def serve(self) -> None:
        """Hand out places that have become free."""
        while self._waiting and self._places.take():
            turn = self._next()
            if turn is None:
                self._places.give_back()
                return
            turn.set_result(None)

    def _next(self) -> asyncio.Future[None] | None:
        """The first of the next line; that line then goes behind the others."""
        while self._lines:
            caller, line = next(iter(self._lines.items()))
            turn = line[0]
            self._remove(caller, turn)
            if caller in self._lines:
                self._lines.move_to_end(caller)
            if not turn.done():
                return turn
        return None

    def _remove(self, caller: str, turn: asyncio.Future[None]) -> None:
        line = self._lines.get(caller)
        if line is None or turn not in line:
            return  # whoever left meanwhile has been passed over
        line.remove(turn)
        self._waiting -= 1
        self._places.waits(self._waiting)
        if not line:
            del self._lines[caller]
