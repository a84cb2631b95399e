"""The log of a delivery that the database keeps: a step's events are held until the step is done, and its
pictures are written before it is."""

import time

from contracts.event_data import EventData
from contracts.events import KnownEvent, new_event
from contracts.orchestrator import Phase
from mission.record import Pictures
from orchestrator.record_files import PICTURES, RecordFiles


class StepLog:
    """Events of a delivery that follow number `told`; `begun`: when the record began, in seconds since 1970."""

    def __init__(self, files: RecordFiles, delivery: str, begun: float, told: int) -> None:
        self._files = files
        self._delivery = delivery
        self._pictures: dict[str, bytes] = {}
        self._begun = begun
        self._told = told
        self._held: list[KnownEvent] = []

    @property
    def number(self) -> int:
        """Of the last event, held ones included."""
        return self._told + len(self._held)

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        """Raises ValueError for a number that leaves a gap."""
        if number <= self.number:
            return
        if number != self.number + 1:
            raise ValueError(f"event {number} can't follow event {self.number}")
        names = []
        for short, jpeg in (pictures() if pictures is not None else {}).items():
            name = f"{number:04d}_{short}.jpg"
            self._pictures[PICTURES + name] = jpeg
            names.append(name)
        time_s = round(max(0.0, time.time() - self._begun), 3)
        self._held.append(new_event(data, number=number, time_s=time_s, phase=phase, message=message, pictures=names))

    def held(self) -> list[tuple[int, str]]:
        """The numbers and texts of the step's events."""
        return [(event.number, event.model_dump_json()) for event in self._held]

    def write_pictures(self) -> None:
        """Those of the held events, before anybody hears of them. Raises OSError."""
        if self._pictures:
            self._files.write(self._delivery, self._pictures)
            self._pictures.clear()

    def kept(self) -> None:
        """The held events are in the database."""
        self._told += len(self._held)
        self._held.clear()

    def dropped(self) -> None:
        """The step is not to count: it will be done again."""
        self._held.clear()
        self._pictures.clear()
