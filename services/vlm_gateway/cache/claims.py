"""Identical chats in several workers make one call: who claims it first in Redis makes it, the others wait for the
answer.

A claim is a key that expires by itself (`HELD_S`) unless its holder says that it is still at it; so a worker that dies
keeps the others waiting no longer than that. It is let go once the answer is written, or when there is none to keep:
then the next in line asks. A Redis that is down claims nothing: every worker asks for itself.
"""

import asyncio
import contextlib
import time
import uuid
from collections.abc import Awaitable, Callable
from typing import TypeVar

from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.cache.port import CacheDown
from services.vlm_gateway.cache.redis import RedisCache

T = TypeVar("T")
HELD_S = 3.0
LOOK_EVERY_S = 0.02
_HELD_MS = str(int(HELD_S * 1000)).encode()
_RELEASE = b"""for _, name in ipairs(KEYS) do
  if redis.call('GET', name) == ARGV[1] then redis.call('DEL', name) end
end
return 0"""


class Claims:
    """Of one worker, over the Redis that `answers` are in."""

    def __init__(self, redis: RedisCache, answers: GuardedCache) -> None:
        self._redis = redis
        self._answers = answers
        self._me = uuid.uuid4().hex.encode()
        self._held: dict[str, float] = {}
        self._released: set[str] = set()
        self._task: asyncio.Task[None] | None = None

    async def once(self, key: str, make: Callable[[], Awaitable[T]], read: Callable[[bytes], T | None]) -> T:
        """What `make` brings, or what another worker has got meanwhile and `read` understands."""
        while not await self._taken(key):
            await asyncio.sleep(LOOK_EVERY_S)
            if (value := await self._answers.get(key)) is not None and (found := read(value)) is not None:
                return found
        self._held[key] = time.monotonic()
        if self._task is None:
            self._task = asyncio.create_task(self._look_after())
        try:
            return await make()
        finally:
            del self._held[key]
            self._released.add(key)

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _taken(self, key: str) -> bool:
        """Whether the call is this worker's to make."""
        if self._answers.state != "ok":
            return True
        if key in self._released:
            self._released.remove(key)  # it is held by this worker still
            return True
        try:
            return await self._redis.do(b"SET", _name(key), self._me, b"NX", b"PX", _HELD_MS) is not None
        except CacheDown:
            return True

    async def _look_after(self) -> None:
        """Renew what is held for long, and let go of what is over, many at a time; until there is nothing."""
        try:
            while self._held or self._released:
                await asyncio.sleep(LOOK_EVERY_S)
                with contextlib.suppress(CacheDown):
                    await self._let_go()
                    await self._renew()
        finally:
            self._task = None

    async def _let_go(self) -> None:
        released, self._released = self._released, set()
        if released:
            with contextlib.suppress(TimeoutError):  # whoever waits looks for the answer first
                await asyncio.wait_for(self._answers.settled(), HELD_S / 6)
            names = list(map(_name, released))
            await self._redis.do(b"EVAL", _RELEASE, str(len(names)).encode(), *names, self._me)

    async def _renew(self) -> None:
        now = time.monotonic()
        for key, since in list(self._held.items()):
            if now - since > HELD_S / 3:
                self._held[key] = now
                await self._redis.do(b"PEXPIRE", _name(key), _HELD_MS)


def _name(key: str) -> bytes:
    return b"vlm_gateway:claim:" + key.encode()
