"""The records of deliveries in a folder that all orchestrators share: pictures as they come, everything else when a
delivery is done (mission.record)."""

import logging
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from contracts.orchestrator import Delivery, DeliveryResult, OpenQuestion
from mission.record import write_whole
from orchestrator.delivery import Order
from orchestrator.store.deliveries import StoredDelivery
from orchestrator.summary import draw_summary

log = logging.getLogger("orchestrator.records")


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
            draw_summary(folder)
        except Exception:  # a delivery without the picture is still a delivery
            log.exception("the summary picture of %s could not be drawn", name)
        write_whole(folder / "result.json", result.model_dump_json(indent=1))
        return size_of(folder)


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


def size_of(folder: Path) -> int:
    """What the folder's files take, in bytes."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def moment(seconds: float) -> str:
    """Seconds since 1970 as a time in UTC."""
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%SZ}"
