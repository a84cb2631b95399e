"""What goes on beside the deliveries' turns: due turns are queued, deadlines kept, dead processes' deliveries taken
over."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable

from orchestrator.carrier import Carrier
from orchestrator.engine import Engine
from orchestrator.intake import Intake
from orchestrator.store.deliveries import DeliveryStore, Ending
from orchestrator.store.executors import ExecutorStore

log = logging.getLogger("orchestrator.keeper")

QUEUE_EVERY_S = 0.5
BATCH = 20
END_EVERY_S = 1.0
BEATS = 5
"""So many signs of life in the time after which a process counts as dead."""
FORGET_EVERY_S = 30.0


class Keeper:
    """The tasks of one process, from `start` to `close`."""

    def __init__(
        self,
        store: DeliveryStore,
        executors: ExecutorStore,
        engine: Engine,
        intake: Intake,
        carrier: Carrier,
        executor: str,
        *,
        alone: bool,
        lost_after_s: float,
    ) -> None:
        """`alone`: nobody else can use the database, so that whoever is not this process is dead. A process that has
        not been heard of for `lost_after_s` is as good as dead: what it still does is refused."""
        self._store = store
        self._executors = executors
        self._engine = engine
        self._intake = intake
        self._carrier = carrier
        self._executor = executor
        self._alone = alone
        self._lost_after_s = lost_after_s
        self._nudged = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        await asyncio.to_thread(self._executors.beat, self._executor)
        for work, seconds in (
            (self._queue_due, 0.0),
            (self._end, END_EVERY_S),
            (self._beat, self._lost_after_s / BEATS),
            (self._take_over, self._lost_after_s / BEATS),
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
        await self._intake.let_pass()
        turns = await asyncio.to_thread(self._store.due, BATCH)
        if turns:
            await self._engine.queue(turns)
            return
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._nudged.wait(), QUEUE_EVERY_S)
        self._nudged.clear()

    async def end(self, name: str, reason: Ending) -> None:
        """The delivery is to end, whichever process carries it on."""
        await asyncio.to_thread(self._store.end, name, reason)
        self._carrier.end_soon(name, reason)
        self.nudge()

    async def _end(self) -> None:
        for name in await asyncio.to_thread(self._store.overdue):
            await self.end(name, "deadline_passed")
        for name, reason in await asyncio.to_thread(self._store.to_be_ended, self._executor):
            self._carrier.end_soon(name, reason)

    async def _beat(self) -> None:
        await asyncio.to_thread(self._executors.beat, self._executor)

    async def _take_over(self) -> None:
        known = await asyncio.to_thread(self._executors.all)
        late = time.time() - self._lost_after_s
        dead = [name for name, seen in known.items() if name != self._executor and (self._alone or seen < late)]
        if not dead:
            return
        await self._engine.take_over(dead)
        for stored in await asyncio.to_thread(self._store.carried_by, dead):
            if not await self._engine.has(stored):
                await asyncio.to_thread(self._store.queue_again, stored)
        for name in dead:
            await asyncio.to_thread(self._executors.leave, name)
