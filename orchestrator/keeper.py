"""What goes on beside the deliveries' turns: due turns are queued, deadlines kept, dead processes' deliveries taken
over."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable

from orchestrator.carrier import Carrier
from orchestrator.engine import Engine
from orchestrator.store.deliveries import DeliveryStore
from orchestrator.store.executors import ExecutorStore

log = logging.getLogger("orchestrator.keeper")

QUEUE_EVERY_S = 0.5
BATCH = 50
END_EVERY_S = 0.5
BEAT_EVERY_S = 2.0
DEAD_AFTER_S = 10.0
"""A process that has not been heard of for so long is dead, or as good as: what it still does is refused."""
FORGET_EVERY_S = 30.0


class Keeper:
    """The tasks of one process, from `start` to `close`."""

    def __init__(
        self,
        store: DeliveryStore,
        executors: ExecutorStore,
        engine: Engine,
        carrier: Carrier,
        executor: str,
        *,
        alone: bool,
    ) -> None:
        """`alone`: nobody else can use the database, so that whoever is not this process is dead."""
        self._store = store
        self._executors = executors
        self._engine = engine
        self._carrier = carrier
        self._executor = executor
        self._alone = alone
        self._nudged = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        await asyncio.to_thread(self._executors.beat, self._executor)
        for work, seconds in (
            (self._queue_due, 0.0),
            (self._end, END_EVERY_S),
            (self._beat, BEAT_EVERY_S),
            (self._take_over, BEAT_EVERY_S),
            (self._engine.forget_finished, FORGET_EVERY_S),
        ):
            self.every(seconds, work)

    def every(self, seconds: float, work: Callable[[], Awaitable[object]]) -> None:
        """Does that work again and again; trouble with it is logged, and it is tried again."""
        self._tasks.append(asyncio.create_task(self._again(seconds, work), name=getattr(work, "__name__", "work")))

    def nudge(self) -> None:
        """Something may be due."""
        self._nudged.set()

    async def close(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        with contextlib.suppress(Exception):
            await asyncio.to_thread(self._executors.retire, self._executor)

    async def _again(self, seconds: float, work: Callable[[], Awaitable[object]]) -> None:
        while True:
            try:
                await work()
            except Exception as error:
                log.error("%s: %s", getattr(work, "__name__", "work"), error)
                await asyncio.sleep(1.0)
            await asyncio.sleep(seconds)

    async def _queue_due(self) -> None:
        turns = await asyncio.to_thread(self._store.due, BATCH)
        if turns:
            await self._engine.queue(turns)
            await asyncio.to_thread(self._store.queued, [(turn.id, turn.turn) for turn in turns])
            return
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._nudged.wait(), QUEUE_EVERY_S)
        self._nudged.clear()

    async def _end(self) -> None:
        for name in await asyncio.to_thread(self._store.overdue):
            await asyncio.to_thread(self._store.end, name, "deadline_passed")
            self.nudge()
        for name, reason in await asyncio.to_thread(self._store.to_be_ended, self._executor):
            self._carrier.end_soon(name, reason)

    async def _beat(self) -> None:
        await asyncio.to_thread(self._executors.beat, self._executor)

    async def _take_over(self) -> None:
        known = await asyncio.to_thread(self._executors.all)
        late = time.time() - DEAD_AFTER_S
        dead = [name for name, seen in known.items() if name != self._executor and (self._alone or seen < late)]
        if not dead:
            return
        await self._engine.take_over(dead)
        for stored in await asyncio.to_thread(self._store.carried_by, dead):
            if not await self._engine.has(stored):
                await asyncio.to_thread(self._store.queue_again, stored)
        for name in dead:
            await asyncio.to_thread(self._executors.leave, name)
