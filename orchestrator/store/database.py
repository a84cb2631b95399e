"""The database of the orchestrators: an SQLite file that one of them has for itself, or PostgreSQL for several."""

from collections.abc import Collection
from pathlib import Path
from typing import Any, Literal, TextIO, TypeVar

import sqlalchemy as sa
from sqlalchemy import event
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from orchestrator.store.tables import MIGRATIONS, metadata, schema_version
from service_kit.file_lock import HeldElsewhere, hold
from service_kit.settings import BadSetting

T = TypeVar("T")
BUSY_S = 30
POOL = 20
SQLITE_KEPT = 4
"""Connections that stay open; what more a burst needs is closed after it."""
RENEWED_AFTER_S = 60
"""A connection that is older is closed when it is to be used again, and another takes its place: one that is used now
and then would go on gathering statements and pages, for hours until it has met all there are."""
CACHE_KB = 256
"""Of each connection; it is of no use beyond a transaction, as every other connection's write empties it."""


class Database:
    """The deliveries' tables and those of the durable engine lie side by side. `engine` is everybody's; what is
    committed by it is on the disk. `bookkeeping` is for the durable engine's own notes: in SQLite a power cut may take
    the last of them, and nothing that was written before them. `shared`: other processes may use the database at the
    same time."""

    def __init__(self, url: str) -> None:
        """Opens the database and brings its tables to today's form. Raises BadSetting where it can't be opened,
        somebody else has the file, or it is of a newer version."""
        try:
            parsed = sa.make_url(url)
        except ArgumentError:
            raise BadSetting("DATABASE_URL: give postgresql://user:password@host/name or sqlite:///file") from None
        self.shared = parsed.get_backend_name() == "postgresql"
        self._lock: TextIO | None = None
        if self.shared:
            parsed = parsed.set(drivername="postgresql+psycopg")
            self.engine = sa.create_engine(parsed, pool_size=POOL, max_overflow=POOL, pool_pre_ping=True)
            self.bookkeeping = self.engine
        elif parsed.get_backend_name() == "sqlite" and parsed.database:
            self._lock = _alone(Path(parsed.database))
            self.engine = _sqlite_engine(parsed, "FULL")
            self.bookkeeping = _sqlite_engine(parsed, "NORMAL")
        else:
            raise BadSetting("DATABASE_URL: give postgresql://user:password@host/name or sqlite:///file")
        self.url = parsed
        try:
            self._migrate()
        except SQLAlchemyError as error:
            self.close()
            reason = str(getattr(error, "orig", error)).strip().splitlines()[0]
            raise BadSetting(f"DATABASE_URL: {parsed.render_as_string(hide_password=True)}: {reason}") from None

    def problem(self) -> str | None:
        """Why the database can't be used now; null when it can."""
        try:
            with self.engine.connect() as connection:
                connection.execute(sa.select(schema_version.c.version))
        except SQLAlchemyError:
            return "the database does not answer"
        return None

    def close(self) -> None:
        self.engine.dispose()
        self.bookkeeping.dispose()
        if self._lock is not None:
            self._lock.close()

    def _migrate(self) -> None:
        with self.engine.begin() as connection:
            if self.shared:  # one at a time; freed with the transaction
                connection.execute(sa.text("SELECT pg_advisory_xact_lock(7203114)"))
            else:
                connection.execute(sa.text("BEGIN IMMEDIATE"))
            schema_version.create(connection, checkfirst=True)
            found = connection.execute(sa.select(schema_version.c.version)).scalar() or 0
            if found > len(MIGRATIONS):
                raise BadSetting(
                    f"DATABASE_URL: the database is of version {found}, this program knows up to {len(MIGRATIONS)}: "
                    "run the newer program, or restore the backup made before the upgrade"
                )
            steps = (metadata.create_all,) if found == 0 else MIGRATIONS[found:]
            for step in steps:
                step(connection)
            connection.execute(schema_version.delete())
            connection.execute(schema_version.insert().values(version=len(MIGRATIONS)))


def padded(names: Collection[T]) -> list[T]:
    """The last of them repeated, up to a power of two, for `IN`: each length is a statement of its own, and every
    connection keeps the last hundred statements."""
    found = list(names)
    return found + found[-1:] * ((1 << (len(found) - 1).bit_length()) - len(found)) if found else found


def _alone(file: Path) -> TextIO:
    """A lock beside the file; the operating system frees it when the process ends."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        lock = file.with_name(file.name + ".lock").open("w", encoding="utf-8")
    except OSError as error:
        raise BadSetting(f"DATABASE_URL: {file}: {error.strerror}") from None
    try:
        hold(lock)
    except HeldElsewhere:
        lock.close()
        raise BadSetting(
            f"DATABASE_URL: another orchestrator uses {file}; end that one, or give several a PostgreSQL database"
        ) from None
    return lock


def _sqlite_engine(url: sa.URL, synchronous: Literal["FULL", "NORMAL"]) -> sa.Engine:
    """Writers take turns from the beginning of a transaction. With FULL each commit is synced to the disk; with NORMAL
    it is with the next one that is. Few connections stay open, none for long, and the one that was used last is used
    next: each one that is used comes to keep half a megabyte of pages and statements."""
    engine = sa.create_engine(
        url,
        pool_size=SQLITE_KEPT,
        max_overflow=2 * POOL - SQLITE_KEPT,
        pool_use_lifo=True,
        pool_recycle=RENEWED_AFTER_S,
    )

    def prepare(connection: Any, _: object) -> None:
        connection.isolation_level = "IMMEDIATE"
        pragmas = (
            f"busy_timeout={BUSY_S * 1000}",
            "journal_mode=WAL",
            f"synchronous={synchronous}",
            "foreign_keys=ON",
            f"cache_size=-{CACHE_KB}",
        )
        for pragma in pragmas:
            connection.execute(f"PRAGMA {pragma}")

    event.listen(engine, "connect", prepare)
    return engine
