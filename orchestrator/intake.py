"""Deliveries that come in, written in groups: one transaction takes all that came while the one before was under way,
so that a burst costs a few of them, and a post that comes alone waits for nobody."""

import asyncio
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from sqlalchemy.exc import DBAPIError, OperationalError

from orchestrator.store.deliveries import DeliveryStore, StoredDelivery

GROUP = 200
GIVES_WAY_S = 0.5
"""So long work that can wait gives way to deliveries that come in."""
QUIET_S = 0.05
"""So long after the last post the next one may belong to the same burst."""

Row = Mapping[str, object]


class _Waiting(NamedTuple):
    """A row that is to be written, and who waits for that."""

    row: Row
    stored: asyncio.Future[StoredDelivery | None]


class Intake:
    """Of one process."""

    def __init__(self, store: DeliveryStore) -> None:
        self._store = store
        self._waiting: list[_Waiting] = []
        self._writing: asyncio.Task[None] | None = None
        self._quiet_from = 0.0

    async def let_pass(self, within_s: float = GIVES_WAY_S) -> None:
        """Returns when nothing comes in just now, or after that time: for work that can wait."""
        for _ in range(round(within_s / QUIET_S)):
            writing = self._writing is not None and not self._writing.done()
            if not writing and time.monotonic() >= self._quiet_from:
                return
            await asyncio.sleep(QUIET_S)

    async def add(self, row: Row) -> StoredDelivery | None:
        """The new delivery, once it is on the disk, or the one that has its key already; null where its id is taken.
        Raises sqlalchemy.exc.DBAPIError."""
        waiting = _Waiting(row, asyncio.get_running_loop().create_future())
        self._waiting.append(waiting)
        self._quiet_from = time.monotonic() + QUIET_S
        if self._writing is None or self._writing.done():
            self._writing = asyncio.create_task(self._write(), name="intake")
        return await waiting.stored

    async def _write(self) -> None:
        while self._waiting:
            group, self._waiting = self._waiting[:GROUP], self._waiting[GROUP:]
            await self._write_group(group)

    async def _write_group(self, group: Sequence[_Waiting]) -> None:
        try:
            found = await asyncio.to_thread(self._store.add_all, [waiting.row for waiting in group])
        except Exception as error:
            if len(group) > 1 and isinstance(error, DBAPIError) and not isinstance(error, OperationalError):
                for waiting in group:  # one of them can't be stored; the others can
                    await self._write_group([waiting])
                return
            for waiting in group:
                if not waiting.stored.done():
                    waiting.stored.set_exception(error)
            return
        for waiting, stored in zip(group, found, strict=True):
            if not waiting.stored.done():  # its caller may have gone
                waiting.stored.set_result(stored)
