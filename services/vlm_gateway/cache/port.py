"""A cache of answers: bytes under a key for a bounded time. `tests/agreements/test_caches.py` is its contract."""

from typing import Protocol


class CacheDown(Exception):
    """The store can't be used right now; the message says why, without credentials."""


class CacheFull(CacheDown):
    """The store answers but takes nothing more; what it holds can still be read."""


class Cache(Protocol):
    """Answers by key. Every method raises CacheDown where the store can't be used, and is safe to call concurrently."""

    @property
    def place(self) -> str:
        """Where the answers are, fit to be shown (no credentials)."""

    async def get(self, key: str) -> bytes | None:
        """The value, or None where there is none or its time is over."""

    async def put(self, key: str, value: bytes) -> None:
        """Keep `value`; an older one is replaced. Raises CacheFull where there is no room."""

    async def ping(self) -> None:
        """Nothing, where the store answers."""

    async def close(self) -> None:
        """Let go of files and connections."""
