"""The records of deliveries in a folder that all orchestrators share: pictures as they come, everything else when a
delivery is done (mission.record)."""

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from contracts.orchestrator import Delivery, DeliveryResult, OpenQuestion
from mission.record import PICTURE_NAME, write_whole
from orchestrator.delivery import Order
from orchestrator.store.deliveries import StoredDelivery
from orchestrator.summary import draw_summary

log = logging.getLogger("orchestrator.records")

FILES = frozenset({"summary.png", "events.jsonl", "result.json", "question.json"})
"""Of a record, beside its pictures, for everybody who may look at the delivery."""


class Records:
    """`runs` is the folder of the records."""

    def __init__(self, runs: Path) -> None:
        self.runs = runs

    def open(self, stored: StoredDelivery, order: Order) -> Path:
        """The delivery's folder, made where it is not there. Raises OSError."""
        folder = self.runs / stored.id
        if not (folder / "delivery.json").exists():
            (folder / "pictures").mkdir(parents=True, exist_ok=True)
            write_whole(folder / "question.json", order.question.model_dump_json(indent=1))
            write_whole(folder / "delivery.json", delivery_of(stored, self.runs).model_dump_json(indent=1))
        return folder

    def complete(self, name: str, events: Sequence[str], result: DeliveryResult) -> int:
        """Everything that a finished delivery's record holds, and how many bytes that takes; a second time it is the
        same. Raises OSError."""
        folder = self.runs / name
        write_whole(folder / "events.jsonl", "".join(f"{line}\n" for line in events))
        try:
            _drawing().submit(draw_summary, folder).result()
        except Exception:  # a delivery without the picture is still a delivery
            log.exception("the summary picture of %s could not be drawn", name)
        write_whole(folder / "result.json", result.model_dump_json(indent=1))
        return size_of(folder)


@cache
def _drawing() -> ThreadPoolExecutor:
    """One thread for all of them: the C library keeps the room of a drawing (11 MB) for each thread that has drawn."""
    return ThreadPoolExecutor(1, thread_name_prefix="drawing")


def delivery_of(stored: StoredDelivery, runs: Path) -> Delivery:
    """What is told of a delivery."""
    return Delivery(
        id=stored.id,
        status=stored.status,
        phase=stored.phase,
        request=stored.request,
        scene=stored.scene,
        created=moment(stored.created),
        started=None if stored.started is None else moment(stored.started),
        ended=None if stored.ended is None else moment(stored.ended),
        priority=stored.priority,
        vehicle=stored.vehicle,
        flights=stored.flights,
        folder=str(runs / stored.id),
        question=None if stored.open_question is None else OpenQuestion.model_validate_json(stored.open_question),
        result=None if stored.result is None else DeliveryResult.model_validate_json(stored.result, extra="ignore"),
    )


def shown_file(folder: Path, file: str) -> Path | None:
    """A file of the record in that folder that may be shown; null where there is none."""
    path = folder / file if file in FILES else folder / "pictures" / file if PICTURE_NAME.fullmatch(file) else None
    return path if path is not None and path.is_file() else None


def size_of(folder: Path) -> int:
    """What the folder's files take, in bytes."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def moment(seconds: float) -> str:
    """Seconds since 1970 as a time in UTC."""
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%SZ}"
