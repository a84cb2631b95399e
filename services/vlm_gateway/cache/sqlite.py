"""Answers in one SQLite file: no server needed, safe to share between processes of one machine."""

import asyncio
import random
import sqlite3
import time
from collections.abc import AsyncIterator, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TypeVar

from service_kit.settings import BadSetting
from services.vlm_gateway.cache.port import CacheDown, CacheFull, Entry

T = TypeVar("T")
MEASURE_EVERY = 256

_SCHEMA = """
CREATE TABLE IF NOT EXISTS answers (
    key TEXT PRIMARY KEY, value BLOB NOT NULL, bytes INTEGER NOT NULL, used_at REAL NOT NULL, expires_at REAL
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS answers_used ON answers (used_at);
"""


class SqliteCache:
    """`max_bytes` bounds what is kept: the least recently used answers go first. `ttl_s` 0 keeps answers for ever."""

    def __init__(
        self, path: Path, *, ttl_s: float, max_bytes: int, clock: Callable[[], float] = time.time, busy_s: float = 1.0
    ) -> None:
        """Raises BadSetting where the file can't be opened or is none of ours."""
        self._path = path
        self._ttl_s = ttl_s
        self._max_bytes = max_bytes
        self._clock = clock
        self._touched: dict[str, float] = {}
        self._closed = False
        self._puts = 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # autocommit: each statement is its own transaction unless BEGIN says otherwise
            self._db = sqlite3.connect(path, timeout=busy_s, isolation_level=None, check_same_thread=False)
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("PRAGMA synchronous=NORMAL")
            self._db.executescript(_SCHEMA)
            self._held = self._measure()
        except (OSError, sqlite3.Error) as error:
            raise BadSetting(
                f"CACHE_PATH={path}: {error}; name a file in a folder that can be written, or set CACHE_MODE=off"
            ) from None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="answers")

    @property
    def place(self) -> str:
        return str(self._path)

    async def get(self, key: str) -> bytes | None:
        return await self._do(lambda: self._get(key))

    async def put(self, answers: Mapping[str, bytes]) -> None:
        await self._do(lambda: self._put(answers))

    async def entries(self) -> AsyncIterator[Entry]:
        after = ""
        while page := await self._do(partial(self._page, after)):
            for entry in page:
                yield entry
            after = page[-1].key

    async def ping(self) -> None:
        await self._do(lambda: self._db.execute("SELECT 1").fetchone())

    async def close(self) -> None:
        if self._closed:
            return
        await self._do(self._flush_and_close)
        self._closed = True
        self._thread.shutdown(wait=False)

    async def _do(self, work: Callable[[], T]) -> T:
        if self._closed:
            raise CacheDown(f"{self._path} is closed")
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, work)
        except sqlite3.Error as error:
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL:
                raise CacheFull(f"no room left for {self._path}") from None
            raise CacheDown(f"{self._path}: {error}") from None

    def _get(self, key: str) -> bytes | None:
        row = self._db.execute("SELECT value, expires_at FROM answers WHERE key = ?", (key,)).fetchone()
        now = self._clock()
        if row is None or (row[1] is not None and row[1] <= now):
            return None
        self._touched[key] = now  # written with the next put: reading stays reading
        if len(self._touched) > 10_000:
            self._write_touched()
        return row[0] if isinstance(row[0], bytes) else str(row[0]).encode()

    def _page(self, after: str) -> list[Entry]:
        rows = self._db.execute(
            "SELECT key, value FROM answers WHERE key > ? AND (expires_at IS NULL OR expires_at > ?) "
            "ORDER BY key LIMIT 256",
            (after, self._clock()),
        )
        return [Entry(key, bytes(value)) for key, value in rows]

    def _put(self, answers: Mapping[str, bytes]) -> None:
        now = self._clock()
        largest = max(map(len, answers.values()), default=0)
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._write_touched()
            for key, value in answers.items():
                if len(value) <= self._max_bytes:
                    expires = now + self._ttl_s * random.uniform(0.9, 1.0) if self._ttl_s > 0 else None
                    row = (key, value, len(value), now, expires)
                    self._db.execute("INSERT OR REPLACE INTO answers VALUES (?, ?, ?, ?, ?)", row)
                    self._make_room(now, len(value))
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        if largest > self._max_bytes:
            raise CacheFull(f"an answer of {largest} bytes is over the whole cache's {self._max_bytes}")

    def _make_room(self, now: float, added: int) -> None:
        self._puts += 1
        self._held += added
        if self._held <= self._max_bytes and self._puts % MEASURE_EVERY:
            return
        self._held = self._measure()  # replaced answers and other processes' puts are not in the running sum
        if self._held <= self._max_bytes:
            return
        self._db.execute("DELETE FROM answers WHERE expires_at <= ?", (now,))
        self._held = self._measure()
        # a tenth more than needed, so that a full cache does not sweep at every put
        goal = int(self._max_bytes * 0.9)
        for key, size in self._db.execute("SELECT key, bytes FROM answers ORDER BY used_at, key").fetchall():
            if self._held <= goal:
                break
            self._db.execute("DELETE FROM answers WHERE key = ?", (key,))
            self._held -= size

    def _measure(self) -> int:
        return int(self._db.execute("SELECT COALESCE(SUM(bytes), 0) FROM answers").fetchone()[0])

    def _write_touched(self) -> None:
        rows = [(at, key) for key, at in self._touched.items()]
        self._db.executemany("UPDATE answers SET used_at = ? WHERE key = ?", rows)
        self._touched.clear()

    def _flush_and_close(self) -> None:
        try:
            self._write_touched()
        finally:
            self._db.close()
