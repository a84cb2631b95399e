"""Waiting for a delivery to change, whichever process changes it."""

import asyncio
import contextlib

from orchestrator.store.deliveries import DeliveryStore

LOOK_EVERY_S = 0.25


class Watch:
    """One look at the database serves everybody who waits in this process."""

    def __init__(self, store: DeliveryStore) -> None:
        self._store = store
        self._waiting: dict[str, tuple[int, asyncio.Event]] = {}
        self._looking: asyncio.Task[None] | None = None

    async def changed(self, name: str, version: int, within_s: float | None = None) -> None:
        """Returns once the delivery is of another version than this, or after that time."""
        known, event = self._waiting.get(name, (version, None))
        if event is None or known != version:
            if event is not None:
                event.set()
            event = asyncio.Event()
            self._waiting[name] = (version, event)
        if self._looking is None or self._looking.done():
            self._looking = asyncio.create_task(self._look(), name="watch")
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(event.wait(), within_s)

    def note(self, name: str) -> None:
        """It has just been changed by this process."""
        if name in self._waiting:
            self._waiting.pop(name)[1].set()

    async def _look(self) -> None:
        while self._waiting:
            await asyncio.sleep(LOOK_EVERY_S)
            names = list(self._waiting)
            with contextlib.suppress(Exception):  # a database that is away now is asked again
                found = await asyncio.to_thread(self._store.versions, names)
                for name in names:
                    waited = self._waiting.get(name)
                    if waited is not None and found.get(name) != waited[0]:
                        self.note(name)

    async def close(self) -> None:
        for name in list(self._waiting):
            self.note(name)
        if self._looking is not None:
            self._looking.cancel()
