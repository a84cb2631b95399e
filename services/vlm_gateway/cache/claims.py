"""Identical chats in several workers make one call: who claims it first in Redis makes it, the others wait for the
answer.

A claim is a key that expires by itself (`HELD_S`) unless its holder says that it is still at it; so a worker that dies
keeps the others waiting no longer than that. It is let go once the answer is written, or when there is none to keep:
then the next in line asks. A Redis that is down claims nothing: every worker asks for itself.
"""

import asyncio
import contextlib
import uuid
from collections.abc import Awaitable, Callable
from typing import TypeVar

from services.vlm_gateway.cache.guard import GuardedCache
from services.vlm_gateway.cache.port import CacheDown
from services.vlm_gateway.cache.redis import RedisCache

T = TypeVar("T")
HELD_S = 3.0
LOOK_EVERY_S = 0.02
_RELEASE = b"if redis.call('GET', KEYS[1]) == ARGV[1] then return redis.call('DEL', KEYS[1]) end return 0"


class Claims:
    """Of one worker, over the Redis that `answers` are in."""

    def __init__(self, redis: RedisCache, answers: GuardedCache) -> None:
        self._redis = redis
        self._answers = answers
        self._me = uuid.uuid4().hex.encode()
        self._holding: set[asyncio.Task[None]] = set()

    async def once(self, key: str, make: Callable[[], Awaitable[T]], read: Callable[[bytes], T | None]) -> T:
        """What `make` brings, or what another worker has got meanwhile and `read` understands."""
        while not await self._taken(key):
            await asyncio.sleep(LOOK_EVERY_S)
            if (value := await self._answers.get(key)) is not None and (found := read(value)) is not None:
                return found
        over = asyncio.Event()
        task = asyncio.create_task(self._hold(key, over))
        self._holding.add(task)
        task.add_done_callback(self._holding.discard)
        try:
            return await make()
        finally:
            over.set()

    async def close(self) -> None:
        for task in self._holding:
            task.cancel()
        await asyncio.gather(*self._holding, return_exceptions=True)

    async def _taken(self, key: str) -> bool:
        """Whether the call is this worker's to make."""
        if self._answers.state != "ok":
            return True
        held_ms = str(int(HELD_S * 1000)).encode()
        try:
            return await self._redis.do(b"SET", _name(key), self._me, b"NX", b"PX", held_ms) is not None
        except CacheDown:
            return True

    async def _hold(self, key: str, over: asyncio.Event) -> None:
        with contextlib.suppress(CacheDown):
            while not over.is_set():
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(over.wait(), HELD_S / 3)
                await self._redis.do(b"PEXPIRE", _name(key), str(int(HELD_S * 1000)).encode())
            with contextlib.suppress(TimeoutError):  # whoever waits looks for the answer first
                await asyncio.wait_for(self._answers.settled(), HELD_S / 3)
            await self._redis.do(b"EVAL", _RELEASE, b"1", _name(key), self._me)


def _name(key: str) -> bytes:
    return b"vlm_gateway:claim:" + key.encode()
