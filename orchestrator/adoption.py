"""Records that no orchestrator has flown, taken into the list: of `logisticsvln deliver`, and of older versions."""

import logging
import os
import time
from datetime import datetime
from pathlib import Path

from mission.record import DELIVERY_ID, is_being_written, read_delivery, read_events
from orchestrator.record_files import FolderFiles
from orchestrator.store.deliveries import DeliveryStore

log = logging.getLogger("orchestrator.adoption")


class Adoption:
    """Looks into `runs` again and again: the database is asked about a record until it knows it."""

    def __init__(self, runs: Path, store: DeliveryStore) -> None:
        self._runs = runs
        self._store = store
        self._known: set[str] = set()

    def adopt(self) -> int:
        """Takes in the records that the database does not know and that nobody writes; how many there were."""
        there = set(os.listdir(self._runs)) if self._runs.is_dir() else set()
        self._known &= there  # what is thrown away and comes again is asked about again
        names = sorted(name for name in there - self._known if DELIVERY_ID.fullmatch(name))
        known = self._store.known(names)
        adopted = {name for name in names if name not in known and _adopted(self._runs / name, self._store)}
        self._known |= known | adopted
        return len(adopted)


def _adopted(folder: Path, store: DeliveryStore) -> bool:
    delivery = read_delivery(folder)
    if delivery is None or is_being_written(folder):
        return False
    result = delivery.result
    events = [(event.number, event.model_dump_json()) for event in read_events(folder)]
    question = folder / "question.json"
    values = {
        "id": folder.name,
        "question": question.read_text(encoding="utf-8") if question.is_file() else "{}",
        "request": delivery.request,
        "scene": delivery.scene,
        "priority": 0,
        "created": _seconds(delivery.created),
        "status": "done",
        "phase": "done",
        "result": None if result is None else result.model_dump_json(),
        "lane": "prompt",
        "events": len(events),
        "told": "done",
        "record_bytes": FolderFiles(folder.parent).size(folder.name),
    }
    return store.add(values, events)


def _seconds(moment: str) -> float:
    try:
        return datetime.fromisoformat(moment).timestamp()
    except ValueError:
        return time.time()
