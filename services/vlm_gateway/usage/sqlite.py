"""Usage in one SQLite file: no server needed, safe to share between the workers of one machine."""

import asyncio
import sqlite3
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from service_kit.settings import BadSetting
from services.vlm_gateway.usage.port import (
    HOLD_S,
    Account,
    Answer,
    Batch,
    Cost,
    Held,
    Page,
    Row,
    State,
    UsageDown,
    Used,
    Wish,
    room,
)

T = TypeVar("T")
_SCHEMA = """
CREATE TABLE IF NOT EXISTS used (
    owner TEXT, period TEXT, model TEXT, calls INTEGER NOT NULL, prompt INTEGER NOT NULL, completion INTEGER NOT NULL,
    nano_usd INTEGER NOT NULL, PRIMARY KEY (owner, period, model)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS batches (worker TEXT PRIMARY KEY, number INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS held (
    owner TEXT, period TEXT, worker TEXT, tokens INTEGER NOT NULL, nano_usd INTEGER NOT NULL, until REAL NOT NULL,
    PRIMARY KEY (owner, period, worker)
) WITHOUT ROWID;
"""
_ADD = """INSERT INTO used VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE SET calls = calls + excluded.calls,
prompt = prompt + excluded.prompt, completion = completion + excluded.completion,
nano_usd = nano_usd + excluded.nano_usd"""
_BATCH = """INSERT INTO batches VALUES (?, ?) ON CONFLICT DO UPDATE SET number = excluded.number
WHERE number < excluded.number"""
_HOLD = "INSERT OR REPLACE INTO held VALUES (?, ?, ?, ?, ?, ?)"
_SPENT = (
    "SELECT COALESCE(SUM(prompt + completion), 0), COALESCE(SUM(nano_usd), 0) FROM used WHERE owner = ? AND period = ?"
)
_READ = "SELECT model, calls, prompt, completion, nano_usd FROM used WHERE owner = ? AND period = ? ORDER BY model"
_HELD = """SELECT COALESCE(SUM(tokens), 0), COALESCE(SUM(nano_usd), 0) FROM held
WHERE owner = ? AND period = ? AND until > ? AND worker LIKE ?"""


class SqliteUsage:
    """`path` None keeps it in memory. `worker` tells this process apart from the others that use the same file."""

    def __init__(
        self, path: Path | None, worker: str, *, clock: Callable[[], float] = time.time, busy_s: float = 2.0
    ) -> None:
        """Raises BadSetting where the file can't be opened or is none of ours."""
        self._path = path
        self._worker = worker
        self._clock = clock
        self._closed = False
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(
                path or ":memory:", timeout=busy_s, isolation_level=None, check_same_thread=False
            )
            if path is not None:
                self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("PRAGMA synchronous=NORMAL")
            self._db.executescript(_SCHEMA)
        except (OSError, sqlite3.Error) as error:
            raise BadSetting(f"USAGE_PATH={path}: {error}; name a file in a folder that can be written") from None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="usage")

    @property
    def place(self) -> str:
        return str(self._path or "memory")

    async def update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
        return await self._do(lambda: self._update(batch, held, wishes))

    async def read(self, accounts: Sequence[Account]) -> Page:
        return await self._do(lambda: self._read(accounts))

    async def close(self) -> None:
        if not self._closed:
            await self._do(self._db.close)
            self._closed = True
            self._thread.shutdown(wait=False)

    async def _do(self, work: Callable[[], T]) -> T:
        if self._closed:
            raise UsageDown(f"{self.place} is closed")
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, work)
        except sqlite3.Error as error:
            raise UsageDown(f"{self.place}: {error}") from None

    def _update(self, batch: Batch, held: Sequence[Held], wishes: Sequence[Wish]) -> Answer:
        now = self._clock()
        self._db.execute("BEGIN IMMEDIATE")
        try:
            if batch.charges and self._db.execute(_BATCH, (self._worker, batch.number)).rowcount:
                self._db.executemany(_ADD, [(*one.account, one.model, *one.used) for one in batch.charges])
            self._db.executemany(_HOLD, [self._row(one.account, one.cost, now) for one in held])
            states, granted, refused = [], list[Cost](), None
            for at, wish in enumerate(wishes):
                state = self._state(wish.account, now)
                states.append(state)
                grant = room(wish, state.spent, state.held)
                if grant is None:
                    refused = at if refused is None else refused
                else:
                    granted.append(grant)
            if refused is None:
                pairs = list(zip(wishes, states, granted, strict=True))
                states = [
                    State(state.spent, state.mine.plus(grant), state.held.plus(grant)) for _, state, grant in pairs
                ]
                rows = [self._row(wish.account, state.mine, now) for wish, state in zip(wishes, states, strict=True)]
                self._db.executemany(_HOLD, rows)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        return Answer(tuple(states), refused)

    def _row(self, account: Account, cost: Cost, now: float) -> tuple[object, ...]:
        return (*account, self._worker, *cost, now + HOLD_S)

    def _state(self, account: Account, now: float) -> State:
        spent = Cost(*self._db.execute(_SPENT, account).fetchone())
        mine, everybody = (
            Cost(*self._db.execute(_HELD, (*account, now, worker)).fetchone()) for worker in (self._worker, "%")
        )
        return State(spent, mine, everybody)

    def _read(self, accounts: Sequence[Account]) -> Page:
        rows: list[Row] = []
        held: dict[Account, Cost] = {}
        for account in accounts:
            found = self._db.execute(_READ, account)
            rows += [Row(account, model, Used(*counts)) for model, *counts in found]
            held[account] = self._state(account, self._clock()).held
        return Page(tuple(rows), held)
