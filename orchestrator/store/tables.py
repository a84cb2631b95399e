"""The tables of the deliveries, and the steps by which an older database becomes one of today.

Times are seconds since 1970, UTC. The engine's own tables lie in the same database and are the engine's business.
"""

from collections.abc import Callable
from typing import Any

import sqlalchemy as sa

metadata = sa.MetaData()

deliveries = sa.Table(
    "deliveries",
    metadata,
    sa.Column("id", sa.String(80), primary_key=True),
    sa.Column("question", sa.Text, nullable=False),
    sa.Column("request", sa.Text, nullable=False),
    sa.Column("scene", sa.Text),
    sa.Column("idempotency_key", sa.String(200), unique=True),
    sa.Column("priority", sa.Integer, nullable=False),
    sa.Column("not_before", sa.Float(53)),
    sa.Column("deadline", sa.Float(53)),
    sa.Column("created", sa.Float(53), nullable=False),
    sa.Column("begun", sa.Float(53)),
    sa.Column("started", sa.Float(53)),
    sa.Column("ended", sa.Float(53)),
    sa.Column("status", sa.String(20), nullable=False),
    sa.Column("phase", sa.String(20), nullable=False),
    sa.Column("open_question", sa.Text),
    sa.Column("answers", sa.Text, nullable=False, default="[]"),
    sa.Column("answered", sa.Integer, nullable=False, default=0),
    sa.Column("result", sa.Text),
    sa.Column("state", sa.LargeBinary),
    sa.Column("events", sa.Integer, nullable=False, default=0),
    # raised at every change, so that whoever changes an older one is refused
    sa.Column("version", sa.Integer, nullable=False, default=0),
    # the queue of the next turn, its number, when it is due; null once the engine has it
    sa.Column("lane", sa.String(20), nullable=False),
    sa.Column("turn", sa.Integer, nullable=False, default=1),
    sa.Column("due", sa.Float(53)),
    # the process that carries it on now
    sa.Column("executor", sa.String(80)),
    # why it is to end before its time
    sa.Column("ending", sa.String(20)),
    sa.Column("vehicle", sa.String(80)),
    sa.Column("flights", sa.Integer, nullable=False, default=0),
    # the status of which the webhook has been told
    sa.Column("told", sa.String(20), nullable=False, default="waiting"),
    # what the finished record takes on the disk
    sa.Column("record_bytes", sa.BigInteger, nullable=False, default=0),
    sa.Index("deliveries_created", "created"),
    sa.Index("deliveries_status", "status", "created"),
    sa.Index("deliveries_due", "due"),
    sa.Index("deliveries_deadline", "deadline"),
    sa.Index("deliveries_executor", "executor"),
)
_UNTOLD = deliveries.c.status != deliveries.c.told
sa.Index("deliveries_untold", deliveries.c.created, sqlite_where=_UNTOLD, postgresql_where=_UNTOLD)
_ended = sa.Index("deliveries_ended", deliveries.c.ended)

events = sa.Table(
    "delivery_events",
    metadata,
    sa.Column("delivery", sa.ForeignKey("deliveries.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("number", sa.Integer, primary_key=True),
    sa.Column("event", sa.Text, nullable=False),
)

vehicles = sa.Table(
    "vehicles",
    metadata,
    sa.Column("name", sa.String(80), primary_key=True),
    sa.Column("kind", sa.String(20), nullable=False),
    # how many drones it flies at a time
    sa.Column("room", sa.Integer, nullable=False),
    # when it answered last; `problem`: why it is lost
    sa.Column("seen", sa.Float(53)),
    sa.Column("problem", sa.Text),
    sa.Column("state", sa.Text),
    sa.Column("capabilities", sa.Text),
)

executors = sa.Table(
    "executors",
    metadata,
    sa.Column("id", sa.String(80), primary_key=True),
    sa.Column("seen", sa.Float(53), nullable=False),
)

schema_version = sa.Table("deliveries_schema", metadata, sa.Column("version", sa.Integer, primary_key=True))

Migration = Callable[[sa.Connection], Any]
MIGRATIONS: tuple[Migration, ...] = (
    lambda connection: metadata.create_all(connection),
    lambda connection: _ended.create(connection, checkfirst=True),
)
"""Step n leads from version n-1 to n; the first makes all tables as they are today, and serves a new database alone."""
