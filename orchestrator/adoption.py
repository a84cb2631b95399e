"""Records that no orchestrator has flown, taken into the list: of `logisticsvln deliver`, and of older versions."""

import logging
import time
from datetime import datetime
from pathlib import Path

from mission.record import DELIVERY_ID, is_being_written, read_delivery, read_events
from orchestrator.record_files import FolderFiles
from orchestrator.store.deliveries import DeliveryStore

log = logging.getLogger("orchestrator.adoption")


def adopt(runs: Path, store: DeliveryStore) -> int:
    """Takes in the records in `runs` that the database does not know and that nobody writes; how many there were."""
    names = [path.name for path in runs.iterdir() if DELIVERY_ID.fullmatch(path.name)] if runs.is_dir() else []
    known = store.known(names)
    return sum(_adopted(runs / name, store) for name in sorted(set(names) - known))


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
