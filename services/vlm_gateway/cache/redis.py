"""Answers in Redis. Bounded waits and no retries inside: the guard in front decides what a failure costs."""

import asyncio
import random

from redis.asyncio import BlockingConnectionPool, Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import AuthenticationError, OutOfMemoryError, RedisError, ResponseError

from service_kit.settings import BadSetting, without_password
from services.vlm_gateway.cache.port import CacheDown, CacheFull

PREFIX = "vlm_gateway:1:"
CONNECTIONS = 16


class RedisCache:
    """`timeout_s` bounds every operation as a whole, connecting included. `ttl_s` 0 keeps answers for ever; their
    times are spread by up to a tenth, so that a recorded run does not expire in one moment. How much is held is
    bounded by the server's `maxmemory`."""

    def __init__(self, url: str, *, ttl_s: float, timeout_s: float = 0.05) -> None:
        """Raises BadSetting where `url` is not a Redis address."""
        self._ttl_s = ttl_s
        self._timeout_s = timeout_s
        self._place = without_password(url)
        try:
            # few connections and a wait for a free one: a burst of requests must not become a burst of handshakes
            pool = BlockingConnectionPool.from_url(
                url,
                max_connections=CONNECTIONS,
                timeout=timeout_s,
                socket_timeout=timeout_s,
                socket_connect_timeout=timeout_s,
                retry=Retry(NoBackoff(), 0),
            )
            self._redis = Redis.from_pool(pool)
        except ValueError as error:
            raise BadSetting(f"REDIS_URL={self._place}: {error}; give redis://host:6379/0") from None

    @property
    def place(self) -> str:
        return self._place

    async def get(self, key: str) -> bytes | None:
        try:
            async with asyncio.timeout(self._timeout_s):
                value = await self._redis.get(PREFIX + key)
        except (TimeoutError, RedisError, OSError) as error:
            raise self._down(error) from None
        return value.encode() if isinstance(value, str) else value

    async def put(self, key: str, value: bytes) -> None:
        expires_ms = int(self._ttl_s * 1000 * random.uniform(0.9, 1.0)) if self._ttl_s > 0 else None
        try:
            async with asyncio.timeout(self._timeout_s):
                await self._redis.set(PREFIX + key, value, px=expires_ms)
        except (TimeoutError, RedisError, OSError) as error:
            raise self._down(error) from None

    async def ping(self) -> None:
        try:
            async with asyncio.timeout(self._timeout_s):
                await self._redis.ping()
        except (TimeoutError, RedisError, OSError) as error:
            raise self._down(error) from None

    async def close(self) -> None:
        try:
            async with asyncio.timeout(1.0):
                await self._redis.aclose()
        except (TimeoutError, RedisError, OSError):
            return

    def _down(self, error: Exception) -> CacheDown:
        if isinstance(error, OutOfMemoryError):
            return CacheFull(f"{self._place} has no memory left")
        if isinstance(error, AuthenticationError):
            return CacheDown(f"{self._place} refuses the password")
        if isinstance(error, TimeoutError):
            return CacheDown(f"{self._place} does not answer within {self._timeout_s * 1000:g} ms")
        reason = str(error).split(" ", 1)[0] if isinstance(error, ResponseError) else type(error).__name__
        return CacheDown(f"{self._place} can't be used ({reason})")
