"""What stands between a request and the cache: a store that is down, slow or full never fails a request.

Reads wait for the store, bounded; after one failure the breaker opens and further reads don't ask at all, while a
probe in the background finds out when the store is back. Writes never make a request wait: they are handed to a
background writer, and until they are through the value is read from memory.
"""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping
from itertools import islice
from typing import Literal

from services.vlm_gateway.breaker import Breaker
from services.vlm_gateway.cache.port import Cache, CacheDown, CacheFull

log = logging.getLogger(__name__)

Mode = Literal["on", "off", "replay"]
PROBE_EVERY_S = 0.5
MAX_PENDING = 512
WRITTEN_TOGETHER = 64
GATHER_S = 0.005
"""Writes wait so long for others: together they cost the store and this process less."""
MAX_VALUE_BYTES = 1024 * 1024

Failed = Callable[[str, str], None]
"""Told of every failure: the operation and its kind (`down`, `full`, `dropped`)."""


class GuardedCache:
    """`start` before use, `close` after. In replay mode nothing is written and a store that is down is an error."""

    def __init__(self, cache: Cache, mode: Mode, failed: Failed, *, probe_every_s: float = PROBE_EVERY_S) -> None:
        self._cache = cache
        self.mode = mode
        self._failed = failed
        self._probe_every_s = probe_every_s
        self._breaker = Breaker(failures=1, pause_s=probe_every_s)
        self._pending: dict[str, bytes] = {}
        self._work = asyncio.Event()
        self._idle = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def place(self) -> str:
        return self._cache.place

    @property
    def state(self) -> Literal["ok", "down"]:
        return "ok" if self._breaker.state == "closed" else "down"

    async def start(self) -> None:
        self._idle.set()
        self._tasks = [asyncio.create_task(self._write()), asyncio.create_task(self._probe())]

    async def close(self) -> None:
        """Writes what is pending, waiting for at most a second, and lets go of the store."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(1.0):
                await self._idle.wait()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        with contextlib.suppress(CacheDown):
            await self._cache.close()

    async def get(self, key: str) -> bytes | None:
        """The value or None; None as well where the store can't be used, except in replay mode: raises CacheDown."""
        if (value := self._pending.get(key)) is not None:
            return value
        if self._breaker.state != "closed":
            if self.mode == "replay":
                raise CacheDown(f"{self.place} does not answer")
            return None
        try:
            return await self._cache.get(key)
        except CacheDown as error:
            self._down("get", error)
            if self.mode == "replay":
                raise
            return None

    def put(self, key: str, value: bytes) -> None:
        """Hand over for writing; dropped where too much waits already."""
        if self.mode != "on":
            return
        if len(value) > MAX_VALUE_BYTES or len(self._pending) >= MAX_PENDING or self._breaker.state != "closed":
            self._failed("put", "dropped")
            return
        self._pending[key] = value
        self._idle.clear()
        self._work.set()

    async def settled(self) -> None:
        """Returns when nothing is left to be written."""
        await self._idle.wait()

    async def problem(self) -> str | None:
        """What is wrong with the store, asked now; None when it answers."""
        try:
            await self._cache.ping()
        except CacheDown as error:
            self._down("ping", error)
            return str(error)
        self._breaker.success()
        return None

    async def _write(self) -> None:
        while True:
            await self._work.wait()
            await asyncio.sleep(GATHER_S)
            self._work.clear()
            while self._pending:
                batch = dict(islice(self._pending.items(), WRITTEN_TOGETHER))
                await self._write_together(batch)
                for key, value in batch.items():
                    if self._pending.get(key) is value:
                        del self._pending[key]
            self._idle.set()

    async def _write_together(self, answers: Mapping[str, bytes]) -> None:
        if self._breaker.state != "closed":
            for _ in answers:
                self._failed("put", "dropped")
            return
        try:
            await self._cache.put(answers)
        except CacheFull as error:
            self._failed("put", "full")
            log.debug("answer not kept: %s", error)
        except CacheDown as error:
            self._down("put", error)

    async def _probe(self) -> None:
        while True:
            await asyncio.sleep(self._probe_every_s)
            if self._breaker.state == "closed":
                continue
            try:
                await self._cache.ping()
            except CacheDown:
                self._breaker.failure()
            else:
                self._breaker.success()
                log.warning("the cache at %s answers again", self.place)

    def _down(self, operation: str, error: CacheDown) -> None:
        self._failed(operation, "down")
        if self._breaker.state == "closed":
            log.warning("the cache can't be used, going on without it: %s", error)
        self._breaker.failure()
