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
from typing import Literal, NamedTuple, Protocol, Self, TextIO, TypeVar

from pydantic import ValidationError

from contracts.base import Wire
from contracts.errors import first_problem
from contracts.event_data import EventData
from contracts.events import Event, KnownEvent, MoveEvent, PlacedEvent, ResultEvent, new_event, read_event
from contracts.geometry import Point3, Pose
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, Phase
from mission.state import MissionState
from service_kit.file_lock import HeldElsewhere, hold

W = TypeVar("W", bound=Wire)
PICTURE_NAME = re.compile(r"[0-9]{4}_[a-z0-9_+-]{1,40}\.jpg")
DELIVERY_ID = re.compile(r"[0-9]{8}-[0-9]{6}-[0-9a-f]{6}")


Pictures = Callable[[], Mapping[str, bytes]]
"""Makes JPEG files by a short name: called only by a log that keeps them."""


class BadRecord(ValueError):
    """A record that can't be carried on; the message says what is wrong with it."""


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
        self._open(folder, delivery, listener, _locked(folder / "events.jsonl", "x"))

    @classmethod
    def reopened(cls, folder: Path, *, listener: Callable[[KnownEvent], None] | None = None) -> Self:
        """The record of a delivery that another process left, to be carried on. An event cut off by the process's end
        is dropped: it will be written again. Raises OSError, and BadRecord where the folder holds no record, or
        somebody still writes it."""
        delivery = _read(folder, "delivery.json", Delivery)
        events = _locked(folder / "events.jsonl", "a")
        whole = _whole_events(folder)
        if whole.more:
            events.close()
            raise BadRecord(f"line {len(whole.events) + 1} of {folder / 'events.jsonl'} is no event, but others follow")
        events.truncate(whole.bytes)
        record = cls.__new__(cls)
        record._open(folder, delivery, listener, events)
        if whole.events:
            record._number = whole.events[-1].number
            record._started -= whole.events[-1].time_s
            record._announced = isinstance(whole.events[-1], ResultEvent)
        return record

    def _open(
        self, folder: Path, delivery: Delivery, listener: Callable[[KnownEvent], None] | None, events: TextIO
    ) -> None:
        self.folder = folder
        self.delivery = delivery
        self._listener = listener
        self._started = time.monotonic()
        self._number = 0
        self._announced = False
        self._events = events

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
        """Writes the last event, unless it is there, after everything else is in the folder, and closes the record."""
        if not self._announced:
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


def write_whole(path: Path, content: str | bytes) -> None:
    """Either the whole file is there or nothing of it, on a full disk as well. Raises OSError."""
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as file:
            file.write(content.encode("utf-8") if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def read_events(folder: Path) -> list[Event]:
    """All whole events of a record; a line cut off by a crash ends the list."""
    return _whole_events(folder).events


class _Whole(NamedTuple):
    """The events up to the first line that is none or does not end, and the bytes that they take. `more`: whole lines
    follow one that is none."""

    events: list[Event]
    bytes: int
    more: bool = False


def _whole_events(folder: Path) -> _Whole:
    events: list[Event] = []
    size = 0
    try:
        data = (folder / "events.jsonl").read_bytes()
    except OSError:
        return _Whole(events, size)
    for line in data.split(b"\n")[:-1]:
        try:
            events.append(read_event(line.decode("utf-8", errors="replace")))
        except ValidationError:
            return _Whole(events, size, more=True)
        size += len(line) + 1
    return _Whole(events, size)


def _locked(path: Path, mode: Literal["x", "a", "r"]) -> TextIO:
    """The file, open for whoever writes the record, one at a time; the operating system frees it when they end. Raises
    OSError, BadRecord where somebody else writes it."""
    file = path.open(mode, encoding="utf-8")
    try:
        hold(file)
    except HeldElsewhere:
        file.close()
        raise BadRecord(
            f"{path.parent} is written by another process; wait until that has ended, or end it, and carry on then"
        ) from None
    return file


def is_being_written(folder: Path) -> bool:
    """Somebody has the record open to carry the delivery on."""
    try:
        with _locked(folder / "events.jsonl", "r"):
            return False
    except (BadRecord, OSError) as error:
        return isinstance(error, BadRecord)


def read_state(folder: Path) -> MissionState | None:
    """Where the mission was left, or null where it had not come so far. Raises BadRecord for a state that is damaged or
    of another version, and for one that knows of events, or a record of a flight, without the other."""
    told = read_events(folder)
    if not (folder / "state.json").exists():
        if any(event.phase != "parse" for event in told):
            raise BadRecord(f"{folder} has events of a flight, but no state.json to carry it on from")
        return None
    state = _read(folder, "state.json", MissionState)
    last = told[-1].number if told else 0
    if state.events > last:
        raise BadRecord(
            f"{folder} has lost something: its state.json was written after event {state.events}, its events.jsonl "
            f"ends with event {last}"
        )
    return state


def _read(folder: Path, name: str, kind: type[W]) -> W:
    """A file of a record. Raises BadRecord, OSError."""
    try:
        return kind.model_validate_json((folder / name).read_bytes())
    except FileNotFoundError:
        raise BadRecord(f"{folder} is not the record of a delivery: it has no {name}") from None
    except ValidationError as error:
        raise BadRecord(f"{folder / name} is damaged or of another version: {first_problem(error)}") from None


def read_question(folder: Path) -> DeliveryQuestion:
    """What was asked for. Raises OSError, BadRecord."""
    return _read(folder, "question.json", DeliveryQuestion)


def read_result(folder: Path) -> DeliveryResult | None:
    """The result of a delivery of any version that is done; null where there is none that is whole."""
    try:
        return DeliveryResult.model_validate_json((folder / "result.json").read_bytes(), extra="ignore")
    except (OSError, ValidationError):
        return None


def read_delivery(folder: Path) -> Delivery | None:
    """A delivery as its record tells it, or null where the folder is not a record. One that was cut off has ended
    with outcome `failed`."""
    try:
        delivery = _read(folder, "delivery.json", Delivery)
    except (OSError, BadRecord):
        return None
    result = read_result(folder) or cut_off(len(read_events(folder)))
    return delivery.model_copy(update={"status": "done", "phase": "done", "result": result, "folder": str(folder)})


def cut_off(events: int) -> DeliveryResult:
    """The result of a delivery whose process ended before it did."""
    return failed(f"the record breaks off after {events} events: the process that flew it ended")


def failed(message: str) -> DeliveryResult:
    """The result of a delivery of which nothing else is known."""
    return DeliveryResult(
        outcome="failed",
        message=message,
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
