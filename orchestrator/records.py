"""The records of deliveries: pictures as they come, everything else when a delivery is done (mission.record)."""

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import cache, partial

from contracts.events import read_event
from contracts.orchestrator import Delivery, DeliveryResult, OpenQuestion
from orchestrator.delivery import Order
from orchestrator.record_files import PICTURES, RecordFiles
from orchestrator.store.deliveries import StoredDelivery
from orchestrator.store.lines import StoredLine
from orchestrator.summary import summary_of

log = logging.getLogger("orchestrator.records")


class Records:
    """In `files`, which all orchestrators share."""

    def __init__(self, files: RecordFiles) -> None:
        self.files = files

    def open(self, stored: StoredDelivery, order: Order) -> None:
        """The delivery's record is begun where it is not there. Raises OSError."""
        if self.files.read(stored.id, "delivery.json") is None:
            question = order.question.model_dump_json(indent=1)
            told = self.told(stored).model_dump_json(indent=1)
            self.files.write(stored.id, {"question.json": question.encode()})
            self.files.write(stored.id, {"delivery.json": told.encode()})

    def complete(self, stored: StoredDelivery, events: Sequence[str], result: DeliveryResult) -> int:
        """Everything that a finished delivery's record holds, and how many bytes that takes; a second time it is the
        same. Raises OSError."""
        name, files = stored.id, self.files
        files.write(name, {"events.jsonl": "".join(f"{line}\n" for line in events).encode()})
        try:
            picture = partial(_picture, files, name)
            drawn = _drawing().submit(summary_of, stored.request, result, list(map(read_event, events)), picture)
            files.write(name, {"summary.png": drawn.result()})
        except Exception:  # a delivery without the picture is still a delivery
            log.exception("the summary picture of %s could not be drawn", name)
        files.write(name, {"result.json": result.model_dump_json(indent=1).encode()})
        return files.size(name)

    def told(self, stored: StoredDelivery | StoredLine) -> Delivery:
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
            folder=self.files.place(stored.id),
            question=None if stored.open_question is None else OpenQuestion.model_validate_json(stored.open_question),
            result=None if stored.result is None else DeliveryResult.model_validate_json(stored.result, extra="ignore"),
        )


def _picture(files: RecordFiles, delivery: str, name: str) -> bytes | None:
    return files.read(delivery, PICTURES + name)


@cache
def _drawing() -> ThreadPoolExecutor:
    """One thread for all of them: the C library keeps the room of a drawing (11 MB) for each thread that has drawn."""
    return ThreadPoolExecutor(1, thread_name_prefix="drawing")


def moment(seconds: float) -> str:
    """Seconds since 1970 as a time in UTC."""
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%SZ}"
