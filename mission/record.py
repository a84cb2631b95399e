"""The record of one delivery: a folder that only grows, and from which everything can be shown later.

question.json    what was asked for, with every setting and the scene
delivery.json    id, time, request
events.jsonl     one of contracts.events a line, flushed as it happens
state.json       the mission's state after its last step, from which it can be carried on
pictures/        the JPEG of each view, marked pictures, named by the events
result.json      written last, in one piece: a folder without it is a delivery that was cut off
summary.png      one picture for people
"""

import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, Protocol, Self

from pydantic import ValidationError

from contracts.event_data import EventData
from contracts.events import Event, KnownEvent, MoveEvent, PlacedEvent, new_event, read_event
from contracts.geometry import Point3, Pose
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, Phase
from mission.state import MissionState

PICTURE_NAME = re.compile(r"[0-9]{4}_[a-z0-9_+-]{1,40}\.jpg")
DELIVERY_ID = re.compile(r"[0-9]{8}-[0-9]{6}-[0-9a-f]{6}")


Pictures = Callable[[], Mapping[str, bytes]]
"""Makes JPEG files by a short name: called only by a log that keeps them."""


class Log(Protocol):
    """Where a mission writes what happens."""

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        """Event `number` (1, 2, ...), with its pictures. A number that is there already is the same event: nothing is
        written again."""
        ...


class Record:
    """The folder of a running delivery. `listener` hears every event after it has been written."""

    def __init__(
        self,
        folder: Path,
        delivery: Delivery,
        question: DeliveryQuestion,
        *,
        listener: Callable[[KnownEvent], None] | None = None,
    ) -> None:
        """A new record. Raises OSError, FileExistsError where there is one already."""
        (folder / "pictures").mkdir(parents=True)
        write_whole(folder / "question.json", question.model_dump_json(indent=1))
        write_whole(folder / "delivery.json", delivery.model_dump_json(indent=1))
        self._open(folder, delivery, listener, "x")

    @classmethod
    def reopened(cls, folder: Path, *, listener: Callable[[KnownEvent], None] | None = None) -> Self:
        """The record of a delivery that another process left, to be carried on. An event cut off by the process's end
        is dropped: it will be written again. Raises OSError, ValueError where the folder holds no record."""
        delivery = Delivery.model_validate_json((folder / "delivery.json").read_text(encoding="utf-8"))
        whole = read_events(folder)
        record = cls.__new__(cls)
        record._open(folder, delivery, listener, "a")
        record._events.truncate(_length_of(folder / "events.jsonl", len(whole)))
        if whole:
            record._number = whole[-1].number
            record._started -= whole[-1].time_s
        return record

    def _open(
        self, folder: Path, delivery: Delivery, listener: Callable[[KnownEvent], None] | None, mode: Literal["x", "a"]
    ) -> None:
        self.folder = folder
        self.delivery = delivery
        self._listener = listener
        self._started = time.monotonic()
        self._number = 0
        self._events = (folder / "events.jsonl").open(mode, encoding="utf-8")

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        """Raises ValueError for a number that leaves a gap."""
        if number <= self._number:
            return
        if number != self._number + 1:
            raise ValueError(f"event {number} can't follow event {self._number}: the record has lost something")
        names = []
        for short, jpeg in (pictures() if pictures is not None else {}).items():
            name = f"{number:04d}_{short}.jpg"
            (self.folder / "pictures" / name).write_bytes(jpeg)
            names.append(name)
        time_s = round(time.monotonic() - self._started, 3)
        event = new_event(data, number=number, time_s=time_s, phase=phase, message=message, pictures=names)
        self._events.write(event.model_dump_json() + "\n")
        self._events.flush()
        self._number = number
        if self._listener is not None:
            self._listener(event)

    def keep(self, state: MissionState) -> None:
        """Writes the state from which the mission can be carried on."""
        write_whole(self.folder / "state.json", state.model_dump_json())

    def conclude(self, result: DeliveryResult) -> None:
        """Writes the result: from here on the delivery is done, whatever happens to the process."""
        write_whole(self.folder / "result.json", result.model_dump_json(indent=1))

    def announce(self, result: DeliveryResult) -> None:
        """Writes the last event, after everything else is in the folder, and closes the record."""
        self.write(self._number + 1, "done", f"{result.outcome}: {result.message}", result)
        os.fsync(self._events.fileno())
        self.close()

    def close(self) -> None:
        self._events.close()


def new_id() -> str:
    """A delivery's name: when it was asked for, and six random hexadecimal digits."""
    return f"{datetime.now(UTC):%Y%m%d-%H%M%S}-{os.urandom(3).hex()}"


def now() -> str:
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"


def write_whole(path: Path, text: str) -> None:
    """Either the whole file is there or nothing of it."""
    part = path.with_name(path.name + ".part")
    with part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)


def read_events(folder: Path) -> list[Event]:
    """All whole events of a record; a line cut off by a crash ends the list."""
    events: list[Event] = []
    try:
        lines = (folder / "events.jsonl").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return events
    for line in lines:
        try:
            events.append(read_event(line))
        except ValidationError:
            break
    return events


def read_state(folder: Path) -> MissionState | None:
    """Where the mission was left, or null where it had not come so far. Raises ValueError for a state of another
    version."""
    try:
        return MissionState.model_validate_json((folder / "state.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None


def _length_of(path: Path, lines: int) -> int:
    """How many bytes so many lines at the beginning of a file take."""
    with path.open("rb") as file:
        return sum(len(line) for line, _ in zip(file, range(lines), strict=False))


def read_delivery(folder: Path) -> Delivery | None:
    """A delivery as its record tells it, or null where the folder is not a record. One that was cut off has ended
    with outcome `failed`."""
    try:
        delivery = Delivery.model_validate_json((folder / "delivery.json").read_text(encoding="utf-8"))
    except (OSError, ValidationError):
        return None
    try:
        result = DeliveryResult.model_validate_json(
            (folder / "result.json").read_text(encoding="utf-8"), extra="ignore"
        )
    except (OSError, ValidationError):
        result = cut_off(len(read_events(folder)))
    return delivery.model_copy(
        update={"status": "done", "phase": "done", "result": result, "folder": str(folder)},
    )


def cut_off(events: int) -> DeliveryResult:
    """The result of a delivery whose process ended before it did."""
    return DeliveryResult(
        outcome="failed",
        message=f"the record breaks off after {events} events: the process that flew it ended",
        steps=0,
        exploration_steps=0,
        path_m=0.0,
        path_horizontal_m=0.0,
        flight_s=0.0,
        floor=None,
        object=None,
        final_height_m=None,
        pose=None,
        verdict=None,
        timings_s={},
        model_calls={},
        renderer=None,
    )


def track_of(events: Sequence[Event]) -> list[Pose | Point3]:
    """The poses and way points of a record, in the order flown."""
    track: list[Pose | Point3] = [e.data.pose for e in events if isinstance(e, PlacedEvent)]
    for event in events:
        if isinstance(event, MoveEvent):
            track += [*event.data.corners, event.data.to]
    return track
