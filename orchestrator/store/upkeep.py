"""What is done with deliveries beside carrying them on: told to somebody, and thrown away."""

import time
from collections.abc import Sequence
from typing import NamedTuple

import sqlalchemy as sa

from contracts.orchestrator import DeliveryStatus
from orchestrator.store.database import padded
from orchestrator.store.tables import deliveries, events

TOLD_WITHIN_S = 86_400.0
"""A change that is older is told to nobody any more."""


class Untold(NamedTuple):
    """A delivery as it stands; `told` is the status that was told last."""

    id: str
    status: DeliveryStatus
    told: DeliveryStatus
    version: int


class UpkeepStore:
    """Over the deliveries of one database. Every function is one transaction."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine

    def untold(self, limit: int) -> list[Untold]:
        """Those whose status nobody has been told yet."""
        c = deliveries.c
        recent = sa.or_(c.ended.is_(None), c.ended > time.time() - TOLD_WITHIN_S)
        chosen = sa.select(*(c[name] for name in Untold._fields)).where(c.status != c.told, recent)
        with self._engine.connect() as connection:
            return [Untold(*row) for row in connection.execute(chosen.order_by(c.created).limit(limit))]

    def told(self, untold: Sequence[Untold]) -> None:
        """The engine will tell these, as they stood."""
        with self._engine.begin() as connection:
            for one in untold:
                connection.execute(deliveries.update().where(deliveries.c.id == one.id).values(told=one.status))

    def outdated(self, before: float, limit: int) -> list[str]:
        """Deliveries that ended before that, the oldest first."""
        c = deliveries.c
        over = (c.status == "done", sa.func.coalesce(c.ended, c.created) < before)
        with self._engine.connect() as connection:
            return list(connection.execute(sa.select(c.id).where(*over).order_by(c.created).limit(limit)).scalars())

    def too_much(self, max_bytes: int, limit: int) -> list[str]:
        """The oldest finished deliveries that have to go for the records to take no more than that."""
        c = deliveries.c
        with self._engine.connect() as connection:
            left = int(connection.execute(sa.select(sa.func.sum(c.record_bytes))).scalar() or 0) - max_bytes
            found: list[str] = []
            done = sa.select(c.id, c.record_bytes).where(c.status == "done", c.record_bytes > 0).order_by(c.created)
            for name, size in connection.execute(done.limit(limit)):
                if left <= 0:
                    break
                found.append(name)
                left -= size
        return found

    def delete(self, names: Sequence[str]) -> None:
        with self._engine.begin() as connection:
            connection.execute(events.delete().where(events.c.delivery.in_(padded(names))))
            connection.execute(deliveries.delete().where(deliveries.c.id.in_(padded(names))))
