"""Records and deliveries that are kept long enough are thrown away."""

import time
from dataclasses import dataclass

from orchestrator.records import Records
from orchestrator.store.upkeep import UpkeepStore

BATCH = 200
DAY_S = 86_400.0


@dataclass(frozen=True)
class Keep:
    """How long finished deliveries are kept, and how much their records may take; null: for ever, without bound."""

    days: float | None = None
    max_bytes: int | None = None


class Retention:
    """Deletes the files of a delivery first, and then its row: what is broken off is done again."""

    def __init__(self, store: UpkeepStore, records: Records, keep: Keep) -> None:
        self._store = store
        self._records = records
        self._keep = keep

    def clear(self) -> int:
        """Throws away what has to go; how many deliveries that were."""
        count = 0
        while names := self._next():
            for name in names:
                self._records.files.delete(name)
            self._store.delete(names)
            count += len(names)
        return count

    def _next(self) -> list[str]:
        keep = self._keep
        names = self._store.outdated(time.time() - keep.days * DAY_S, BATCH) if keep.days is not None else []
        if not names and keep.max_bytes is not None:
            names = self._store.too_much(keep.max_bytes, BATCH)
        return names
