"""The fleet in the database: which vehicles there are, which of them are lost, and who flies what."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from contracts.fleet import VehicleKind
from orchestrator.store.deliveries import Superseded
from orchestrator.store.tables import deliveries, vehicles

_IN_THE_AIR = (deliveries.c.vehicle == vehicles.c.name, deliveries.c.status.in_(("flying", "needs_answer")))


@dataclass(frozen=True)
class StoredVehicle:
    """A row of `vehicles`; `flying`: the deliveries that it flies. `state` and
    `capabilities`: as it told them itself, JSON."""

    name: str
    kind: VehicleKind
    room: int
    seen: float | None
    problem: str | None
    state: str | None
    capabilities: str | None
    flying: tuple[str, ...] = ()


class VehicleStore:
    """The vehicles of one database."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine

    def register(self, name: str, kind: VehicleKind, room: int) -> None:
        """Makes it known; what is known of it otherwise stays."""
        with self._engine.begin() as c:
            changed = c.execute(vehicles.update().where(vehicles.c.name == name).values(kind=kind, room=room))
            if changed.rowcount == 0:
                c.execute(vehicles.insert().values(name=name, kind=kind, room=room))

    def all(self) -> list[StoredVehicle]:
        with self._engine.connect() as c:
            flying: dict[str, list[str]] = {}
            pairs = sa.select(vehicles.c.name, deliveries.c.id).where(*_IN_THE_AIR).order_by(deliveries.c.started)
            for name, delivery in c.execute(pairs):
                flying.setdefault(name, []).append(delivery)
            rows = c.execute(sa.select(vehicles).order_by(vehicles.c.name)).all()
        return [StoredVehicle(**row._mapping, flying=tuple(flying.get(row.name, ()))) for row in rows]

    def room(self) -> dict[VehicleKind, int]:
        """How many deliveries each kind of vehicle may fly at a time: of those that are not lost."""
        found: dict[VehicleKind, int] = {"simulator": 0, "vehicle": 0}
        with self._engine.connect() as c:
            ready = vehicles.c.problem.is_(None)
            by_kind = sa.select(vehicles.c.kind, sa.func.sum(vehicles.c.room)).where(ready).group_by(vehicles.c.kind)
            found.update({row[0]: int(row[1]) for row in c.execute(by_kind)})
        return found

    def forget(self, names: Sequence[str]) -> None:
        """Those that are none of these are no part of the fleet any more."""
        with self._engine.begin() as c:
            c.execute(vehicles.delete().where(vehicles.c.name.not_in(names)))

    def board(self, delivery: str, version: int, kind: VehicleKind, only: str | None = None) -> str | None:
        """A free vehicle of that kind for the delivery, the one with the most room left, or the `only` one that may fly
        it; null where none is free. The delivery's version goes up by one. Raises Superseded."""
        with self._engine.begin() as c:
            name = next((row for row in self._with_room(c, kind) if only in (None, row)), None)
            if name is None:
                return None
            now = time.time()
            started = sa.func.coalesce(deliveries.c.started, now)
            done = c.execute(
                deliveries.update()
                .where(deliveries.c.id == delivery, deliveries.c.version == version)
                .values(
                    vehicle=name,
                    status="flying",
                    started=started,
                    flights=deliveries.c.flights + 1,
                    version=version + 1,
                )
            )
            if done.rowcount != 1:
                raise Superseded(delivery)
            return name

    def _with_room(self, c: sa.Connection, kind: VehicleKind) -> list[str]:
        """Names, most room first. PostgreSQL locks the fleet for the transaction, SQLite has one writer at a time."""
        if c.dialect.name == "postgresql":
            c.execute(sa.select(vehicles.c.name).where(vehicles.c.kind == kind).with_for_update())
        else:
            c.execute(vehicles.update().where(vehicles.c.kind == kind).values(room=vehicles.c.room))
        busy = sa.select(sa.func.count()).select_from(deliveries).where(*_IN_THE_AIR).scalar_subquery()
        left: sa.ColumnElement[Any] = vehicles.c.room - busy
        ready = (vehicles.c.kind == kind, vehicles.c.problem.is_(None), left > 0)
        return list(c.execute(sa.select(vehicles.c.name).where(*ready).order_by(left.desc())).scalars())

    def mark_lost(self, name: str, problem: str) -> None:
        with self._engine.begin() as c:
            c.execute(vehicles.update().where(vehicles.c.name == name).values(problem=problem))

    def mark_ready(self, name: str, state: str | None = None, capabilities: str | None = None) -> None:
        """It answers, with what it tells of itself."""
        told = {"problem": None, "seen": time.time(), "state": state, "capabilities": capabilities}
        with self._engine.begin() as c:
            c.execute(vehicles.update().where(vehicles.c.name == name).values(**told))
