"""Where runs and workers on many machines meet: a PostgreSQL database with the engine's queue and a roll of workers.

The engine is DBOS Transact, as for deliveries: an episode is one workflow, which has one step, the flight.
"""

import hashlib
import json
import time
from collections.abc import Mapping, Sequence

import sqlalchemy as sa
from dbos import DBOS
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

APPLICATION = "logisticsvln-bench"
EPISODE = "episode"
QUEUE = "episodes"
LOST_AFTER_S = 30.0
"""A worker of which nothing was heard for so long is taken for dead."""

_metadata = sa.MetaData()
_workers = sa.Table(
    "bench_workers",
    _metadata,
    sa.Column("name", sa.String(80), primary_key=True),
    sa.Column("program", sa.String(80), nullable=False),
    # when it was heard of last, in seconds since 1970
    sa.Column("seen", sa.Float(53), nullable=False),
)


class BadDatabase(ValueError):
    """A database that can't be used; the message says why, without its password."""


def reason_of(error: SQLAlchemyError) -> str:
    """What the database says, in one line and without the statement."""
    return str(getattr(error, "orig", error)).strip().splitlines()[0]


def program_of(versions: Mapping[str, str]) -> str:
    """A short name of a program, by the versions of everything that may change a result: a run is flown by workers of
    the same one."""
    return hashlib.sha256(json.dumps(sorted(versions.items())).encode()).hexdigest()[:16]


class QueueDatabase:
    """A PostgreSQL database with the tables of today."""

    def __init__(self, url: str) -> None:
        """Raises BadDatabase."""
        try:
            parsed = sa.make_url(url)
        except ArgumentError:
            raise BadDatabase("give postgresql://user:password@host/name") from None
        if parsed.get_backend_name() != "postgresql":
            raise BadDatabase(
                f"{parsed.get_backend_name()} is a database of one machine; give postgresql://user:password@host/name"
            )
        parsed = parsed.set(drivername="postgresql+psycopg")
        self.engine = sa.create_engine(parsed, pool_pre_ping=True)
        try:
            with self.engine.begin() as connection:  # one program at a time makes tables
                connection.execute(sa.text("SELECT pg_advisory_xact_lock(7203115)"))
                _metadata.create_all(connection)
            DBOS.migrate(parsed.set(drivername="postgresql").render_as_string(hide_password=False))
        except SQLAlchemyError as error:
            self.close()
            raise BadDatabase(f"{parsed.render_as_string(hide_password=True)}: {reason_of(error)}") from None

    def close(self) -> None:
        self.engine.dispose()


class WorkerRoll:
    """The workers of a database. Machines that share it keep time within a second or two of each other."""

    def __init__(self, database: QueueDatabase) -> None:
        self._engine = database.engine

    def beat(self, name: str, program: str) -> None:
        """That worker lives."""
        told = {"program": program, "seen": time.time()}
        with self._engine.begin() as c:
            if c.execute(_workers.update().where(_workers.c.name == name).values(**told)).rowcount == 0:
                c.execute(_workers.insert().values(name=name, **told))

    def leave(self, name: str) -> None:
        """That worker ends: what it has begun may be flown by others at once."""
        with self._engine.begin() as c:
            c.execute(_workers.update().where(_workers.c.name == name).values(seen=0.0))

    def silent(self, program: str, for_s: float) -> list[str]:
        """Workers of that program of which nothing was heard for so long."""
        late = (_workers.c.program == program, _workers.c.seen < time.time() - for_s)
        with self._engine.connect() as c:
            return list(c.execute(sa.select(_workers.c.name).where(*late)).scalars())

    def forget(self, names: Sequence[str]) -> None:
        with self._engine.begin() as c:
            c.execute(_workers.delete().where(_workers.c.name.in_(names)))

    def count(self, program: str) -> int:
        """How many workers of that program live."""
        alive = (_workers.c.program == program, _workers.c.seen >= time.time() - LOST_AFTER_S)
        with self._engine.connect() as c:
            return int(c.execute(sa.select(sa.func.count()).select_from(_workers).where(*alive)).scalar_one())
