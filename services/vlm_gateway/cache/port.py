"""A cache of answers: bytes under a key for a bounded time. `tests/agreements/test_caches.py` is its contract."""

from collections.abc import AsyncIterator, Mapping
from typing import NamedTuple, Protocol


class Entry(NamedTuple):
    """One answer with the key it is kept under."""

    key: str
    value: bytes


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

    async def put(self, answers: Mapping[str, bytes]) -> None:
        """Keep these values by their keys; older ones are replaced. Raises CacheFull where one had no
        room."""

    def entries(self) -> AsyncIterator[Entry]:
        """All answers whose time is not over; of those that come and go meanwhile, some."""

    async def ping(self) -> None:
        """Nothing, where the store answers."""

    async def close(self) -> None:
        """Let go of files and connections."""
