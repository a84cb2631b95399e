"""Deliveries in the database: taken, queued, carried on, ended. Every function is one transaction.

A delivery is carried on in turns. A turn is one workflow of the engine: it takes the delivery on as far as it comes
without waiting for a customer or a vehicle, and leaves the next turn with the time it is `due`. Two guards keep two
processes from carrying the same delivery on: the turn's number, and a version that every change must know.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import IntegrityError

from contracts.orchestrator import DeliveryStatus, Phase
from orchestrator.store.database import padded
from orchestrator.store.tables import deliveries, events

Lane = Literal["request", "simulator", "vehicle", "prompt"]
"""The queues: requests to be read, deliveries to be flown by each kind of vehicle, and those that only have to be
ended."""
Ending = Literal["cancelled", "deadline_passed"]


class Superseded(Exception):
    """Somebody else has carried the delivery on meanwhile: nothing was changed."""


@dataclass(frozen=True)
class StoredDelivery:
    """A row of `deliveries`; texts are JSON where they are messages."""

    id: str
    question: str
    request: str
    scene: str | None
    idempotency_key: str | None
    priority: int
    not_before: float | None
    deadline: float | None
    created: float
    begun: float | None
    started: float | None
    ended: float | None
    status: DeliveryStatus
    phase: Phase
    open_question: str | None
    answers: str
    answered: int
    result: str | None
    state: bytes | None
    events: int
    version: int
    lane: Lane
    turn: int
    due: float | None
    executor: str | None
    ending: Ending | None
    vehicle: str | None
    flights: int
    told: str
    record_bytes: int


class Following(NamedTuple):
    """The next turn: its queue, and when it is due, at the latest where it waits for the answer to question number
    `question` (1, 2, ...)."""

    lane: Lane
    due: float
    question: int | None = None


def mark_queued(c: sa.Connection, turns: Sequence[StoredDelivery]) -> None:
    """The engine has the turns of these deliveries, as they stood; to be written with the engine's own rows."""
    same = (deliveries.c.id == sa.bindparam("of"), deliveries.c.turn == sa.bindparam("number"))
    given = [{"of": stored.id, "number": stored.turn} for stored in turns]
    c.execute(deliveries.update().where(*same).values(due=None), given)


def stored_delivery(row: sa.Row[Any]) -> StoredDelivery:
    """A row of the table."""
    return StoredDelivery(**row._mapping)


_INSERT: Mapping[str, Callable[[sa.Table], Any]] = {"sqlite": sqlite.insert, "postgresql": postgresql.insert}


def _tell(c: sa.Connection, name: str, told: Sequence[tuple[int, str]]) -> None:
    if told:
        c.execute(events.insert(), [{"delivery": name, "number": number, "event": text} for number, text in told])


class DeliveryStore:
    """The deliveries of one database."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine

    def add(self, values: Mapping[str, object], told: Sequence[tuple[int, str]] = ()) -> bool:
        """A new delivery, with its events where it has any; false where its id or its key is there already."""
        try:
            with self._engine.begin() as c:
                c.execute(deliveries.insert().values(**values))
                _tell(c, str(values["id"]), told)
        except IntegrityError:
            return False
        return True

    def add_all(self, rows: Sequence[Mapping[str, object]]) -> list[StoredDelivery | None]:
        """New deliveries, whose rows have the same columns. In the place of one whose key is there already comes the
        delivery that has it; null stands for one whose id is taken."""
        first: dict[object, Mapping[str, object]] = {}
        for row in rows:
            first.setdefault(row["id"], row)
        with self._engine.begin() as c:
            insert = _INSERT[c.dialect.name](deliveries).on_conflict_do_nothing().returning(*deliveries.c)
            added = {row.id: stored_delivery(row) for row in c.execute(insert, list(first.values()))}
            keys = [key for row in rows if row["id"] not in added and (key := row["idempotency_key"]) is not None]
            chosen = sa.select(deliveries).where(deliveries.c.idempotency_key.in_(padded(keys)))
            known = {row.idempotency_key: stored_delivery(row) for row in (c.execute(chosen) if keys else ())}
        found: list[StoredDelivery | None] = []
        for row in rows:
            new = added.get(row["id"]) if first[row["id"]] is row else None
            found.append(new or known.get(row["idempotency_key"]))
        return found

    def get(self, name: str) -> StoredDelivery | None:
        with self._engine.connect() as c:
            row = c.execute(sa.select(deliveries).where(deliveries.c.id == name)).first()
        return None if row is None else stored_delivery(row)

    def of_key(self, key: str) -> StoredDelivery | None:
        with self._engine.connect() as c:
            row = c.execute(sa.select(deliveries).where(deliveries.c.idempotency_key == key)).first()
        return None if row is None else stored_delivery(row)

    def known(self, names: Sequence[str]) -> set[str]:
        """Those of these that there are."""
        found: set[str] = set()
        with self._engine.connect() as c:
            for k in range(0, len(names), 512):
                chosen = sa.select(deliveries.c.id).where(deliveries.c.id.in_(padded(names[k : k + 512])))
                found.update(c.execute(chosen).scalars())
        return found

    def waiting(self) -> int:
        with self._engine.connect() as c:
            where = deliveries.c.status.in_(("waiting", "needs_answer"))
            return int(c.execute(sa.select(sa.func.count()).select_from(deliveries).where(where)).scalar_one())

    def due(self, limit: int) -> list[StoredDelivery]:
        """Turns that the engine should have, the most urgent first."""
        with self._engine.connect() as c:
            chosen = sa.select(deliveries).where(deliveries.c.due <= time.time())
            order = (deliveries.c.priority.desc(), deliveries.c.created)
            return [stored_delivery(row) for row in c.execute(chosen.order_by(*order).limit(limit))]

    def take_up(self, name: str, turn: int, executor: str) -> StoredDelivery | None:
        """The delivery for whoever carries it on from now; null where that turn is over."""
        with self._engine.begin() as c:
            mine = (deliveries.c.id == name, deliveries.c.turn == turn, deliveries.c.status != "done")
            changes = {"executor": executor, "version": deliveries.c.version + 1, "due": None}
            begun = sa.func.coalesce(deliveries.c.begun, time.time())
            row = c.execute(
                deliveries.update().where(*mine).values(**changes, begun=begun).returning(*deliveries.c)
            ).first()
        return None if row is None else stored_delivery(row)

    def commit(
        self, name: str, version: int, changes: Mapping[str, object], new_events: Sequence[tuple[int, str]] = ()
    ) -> int:
        """One step's changes and events, all or nothing; the new version. Raises Superseded."""
        with self._engine.begin() as c:
            same = (deliveries.c.id == name, deliveries.c.version == version)
            told = {"events": new_events[-1][0]} if new_events else {}
            done = c.execute(deliveries.update().where(*same).values(**changes, **told, version=version + 1))
            if done.rowcount != 1:
                raise Superseded(name)
            _tell(c, name, new_events)
        return version + 1

    def park(
        self,
        name: str,
        version: int,
        changes: Mapping[str, object],
        new_events: Sequence[tuple[int, str]],
        following: Following,
    ) -> int:
        """As `commit`, for the last step of a turn: nobody carries the delivery on until its next turn. One that is to
        end is due at once."""
        ending = deliveries.c.ending.is_not(None)
        wait: sa.ColumnElement[float] | float = following.due
        if following.question is not None:
            answered = deliveries.c.answered >= following.question
            wait = sa.case((answered, time.time()), else_=following.due)
        parked = {
            "executor": None,
            "turn": deliveries.c.turn + 1,
            "lane": sa.case((ending, "prompt"), else_=following.lane),
            "due": sa.case((ending, time.time()), else_=wait),
        }
        return self.commit(name, version, {**changes, **parked}, new_events)

    def queue_again(self, stored: StoredDelivery) -> None:
        """A new turn for a delivery whose turn the engine has lost; nothing where it has changed meanwhile."""
        with self._engine.begin() as c:
            same = (deliveries.c.id == stored.id, deliveries.c.version == stored.version)
            changes = {"turn": stored.turn + 1, "due": time.time(), "executor": None, "version": stored.version + 1}
            c.execute(deliveries.update().where(*same).values(**changes))

    def end(self, name: str, reason: Ending) -> None:
        """The delivery is to end: at once where nobody carries it on, else whoever does is told. The first reason
        stands."""
        with self._engine.begin() as c:
            open_ = (deliveries.c.id == name, deliveries.c.status != "done", deliveries.c.ending.is_(None))
            c.execute(deliveries.update().where(*open_).values(ending=reason))
            idle = (deliveries.c.id == name, deliveries.c.status != "done", deliveries.c.executor.is_(None))
            c.execute(
                deliveries.update().where(*idle).values(lane="prompt", turn=deliveries.c.turn + 1, due=time.time())
            )

    def overdue(self) -> list[str]:
        """Deliveries whose deadline has passed and that nobody has told yet."""
        with self._engine.connect() as c:
            late = (deliveries.c.deadline <= time.time(), deliveries.c.status != "done", deliveries.c.ending.is_(None))
            return list(c.execute(sa.select(deliveries.c.id).where(*late).limit(1000)).scalars())

    def to_be_ended(self, executor: str) -> list[tuple[str, Ending]]:
        """Those that this executor carries on and that are to end."""
        with self._engine.connect() as c:
            mine = (deliveries.c.executor == executor, deliveries.c.ending.is_not(None))
            return [(row[0], row[1]) for row in c.execute(sa.select(deliveries.c.id, deliveries.c.ending).where(*mine))]

    def answer(self, name: str, question: str, answers: Sequence[str]) -> bool:
        """The customer's answers, the newest last, where that question is still open; the delivery goes on. On the
        ground nobody carries it on, and its next turn is due; in the air whoever does will find the answer."""
        idle = deliveries.c.executor.is_(None)
        with self._engine.begin() as c:
            asked = (deliveries.c.id == name, deliveries.c.open_question == question, deliveries.c.ending.is_(None))
            done = c.execute(
                deliveries.update()
                .where(*asked)
                .values(
                    answers=json.dumps(answers),
                    answered=len(answers),
                    open_question=None,
                    status=sa.case((deliveries.c.vehicle.is_(None), "waiting"), else_="flying"),
                    turn=sa.case((idle, deliveries.c.turn + 1), else_=deliveries.c.turn),
                    due=sa.case((idle, time.time()), else_=deliveries.c.due),
                    version=sa.case((idle, deliveries.c.version + 1), else_=deliveries.c.version),
                )
            )
            return done.rowcount == 1

    def events(self, name: str, after: int, limit: int = 500) -> list[str]:
        """Events numbered above `after`, in order."""
        with self._engine.connect() as c:
            chosen = sa.select(events.c.event).where(events.c.delivery == name, events.c.number > after)
            return list(c.execute(chosen.order_by(events.c.number).limit(limit)).scalars())

    def versions(self, names: Sequence[str]) -> dict[str, int]:
        """How often each of these was changed."""
        with self._engine.connect() as c:
            chosen = sa.select(deliveries.c.id, deliveries.c.version).where(deliveries.c.id.in_(padded(names)))
            return {row[0]: row[1] for row in c.execute(chosen)}

    def carried_by(self, executors: Sequence[str]) -> list[StoredDelivery]:
        with self._engine.connect() as c:
            mine = (deliveries.c.executor.in_(executors), deliveries.c.status != "done")
            return [stored_delivery(row) for row in c.execute(sa.select(deliveries).where(*mine))]
