"""Deliveries as lists show them: without their questions, states and events, which take a hundred times the room."""

import json
import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

import sqlalchemy as sa

from contracts.orchestrator import DeliveryStatus, OutcomeName
from orchestrator.store.database import padded
from orchestrator.store.tables import deliveries, events

REMEMBERED = 100
"""By so many earlier deliveries it is told how long one takes."""


@dataclass(frozen=True)
class Chosen:
    """Which deliveries: of that status or outcome, taken at or after `since` (seconds since 1970), with `text` in
    request or id, older than the one `before`."""

    limit: int
    status: DeliveryStatus | None = None
    outcome: OutcomeName | None = None
    text: str | None = None
    before: str | None = None
    since: float | None = None


class StoredLine(NamedTuple):
    """As in StoredDelivery; `result` is JSON."""

    id: str
    status: DeliveryStatus
    phase: str
    request: str
    scene: str | None
    created: float
    started: float | None
    ended: float | None
    priority: int
    vehicle: str | None
    flights: int
    open_question: str | None
    result: str | None


def _newest_first(query: "sa.Select[Any]", before: str | None, limit: int) -> "sa.Select[Any]":
    """A page of a query over deliveries: so many of those that are older than the delivery `before`."""
    c = deliveries.c
    if before is not None:
        last = sa.select(c.created).where(c.id == before).scalar_subquery()
        query = query.where(sa.or_(c.created < last, sa.and_(c.created == last, c.id < before)))
    return query.order_by(c.created.desc(), c.id.desc()).limit(limit)


class LineStore:
    """Over the deliveries of one database."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine

    def lines(self, chosen: Chosen) -> list[StoredLine]:
        """The newest first."""
        c = deliveries.c
        query = sa.select(*(c[name] for name in StoredLine._fields))
        if chosen.status is not None:
            query = query.where(c.status == chosen.status)
        if chosen.outcome is not None:
            query = query.where(c.result.startswith(f'{{"outcome":"{chosen.outcome}"', autoescape=True))
        if chosen.since is not None:
            query = query.where(c.created >= chosen.since)
        if chosen.text:
            contains = (column.icontains(chosen.text, autoescape=True) for column in (c.request, c.id))
            query = query.where(sa.or_(*contains))
        with self._engine.connect() as connection:
            rows = connection.execute(_newest_first(query, chosen.before, chosen.limit))
            return [StoredLine(*row) for row in rows]

    def counts(self) -> dict[DeliveryStatus, int]:
        """Deliveries by status."""
        found: dict[DeliveryStatus, int] = {"waiting": 0, "flying": 0, "needs_answer": 0, "done": 0}
        by_status = sa.select(deliveries.c.status, sa.func.count()).group_by(deliveries.c.status)
        with self._engine.connect() as connection:
            found.update({row[0]: int(row[1]) for row in connection.execute(by_status)})
        return found

    def requests(self, names: Collection[str]) -> dict[str, str]:
        """The customer's words of those deliveries."""
        query = sa.select(deliveries.c.id, deliveries.c.request).where(deliveries.c.id.in_(padded(names)))
        with self._engine.connect() as connection:
            return {row[0]: row[1] for row in connection.execute(query)}

    def ahead_of(self, name: str) -> int:
        """How many waiting deliveries are flown before this one."""
        c, own = deliveries.c, deliveries.alias()
        sooner = sa.or_(c.priority > own.c.priority, sa.and_(c.priority == own.c.priority, c.created < own.c.created))
        count = sa.select(sa.func.count()).select_from(deliveries, own)
        with self._engine.connect() as connection:
            where = (own.c.id == name, c.status == "waiting", c.id != own.c.id, sooner)
            return int(connection.execute(count.where(*where)).scalar_one())

    def flight_times(self) -> list[float]:
        """How long the last flights of this week took that ended at a window, seconds."""
        c = deliveries.c
        stopped = sa.or_(*(c.result.startswith(f'{{"outcome":"{o}"') for o in ("delivered", "stopped_not_judged")))
        recent = (c.started.is_not(None), c.ended > time.time() - 7 * 86_400.0)
        query = sa.select(c.ended - c.started).where(stopped, *recent).order_by(c.ended.desc()).limit(REMEMBERED)
        with self._engine.connect() as connection:
            return [float(value) for value in connection.execute(query).scalars()]

    def held_up(self, name: str) -> bool:
        """Is a machine waited for? Nothing else is told until it is back."""
        c = events.c
        query = sa.select(c.event).where(c.delivery == name).order_by(c.number.desc()).limit(1)
        with self._engine.connect() as connection:
            text = connection.execute(query).scalar_one_or_none()
        event = {} if text is None else json.loads(text)
        return event.get("kind") == "outage" and not event["data"]["over"]

    def last_picture(self, name: str) -> str | None:
        """The file of the last picture that the front camera took, marked where it saw the thing; null without any."""
        c = events.c
        query = sa.select(c.event).where(c.delivery == name).order_by(c.number.desc())
        with self._engine.connect() as connection:
            for text in connection.execute(query).scalars():
                files: list[str] = json.loads(text)["pictures"]
                for short in ("sighting", "view"):
                    if (found := next((f for f in files if f.endswith(f"_{short}.jpg")), None)) is not None:
                        return found
        return None
