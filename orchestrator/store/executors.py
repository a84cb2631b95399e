"""The processes that carry deliveries on, and when each was heard of last."""

import time

import sqlalchemy as sa

from orchestrator.store.tables import executors


class ExecutorStore:
    """The processes of one database. The database's clock is not asked: machines that share it keep time within a
    second or two of each other."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine

    def beat(self, name: str) -> None:
        """That process lives."""
        with self._engine.begin() as c:
            if c.execute(executors.update().where(executors.c.id == name).values(seen=time.time())).rowcount == 0:
                c.execute(executors.insert().values(id=name, seen=time.time()))

    def all(self) -> dict[str, float]:
        """When each was heard of last, in seconds since 1970."""
        with self._engine.connect() as c:
            return {row.id: row.seen for row in c.execute(sa.select(executors))}

    def retire(self, name: str) -> None:
        """That process ends: what it carries on may be taken over at once."""
        with self._engine.begin() as c:
            c.execute(executors.update().where(executors.c.id == name).values(seen=0.0))

    def leave(self, name: str) -> None:
        """That process is no more, and what it carried on has been taken over."""
        with self._engine.begin() as c:
            c.execute(executors.delete().where(executors.c.id == name))
