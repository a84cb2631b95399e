"""The log of a delivery that the database keeps: a step's events are held until the step is done, its pictures go to
the record's folder at once."""

import time
from pathlib import Path

from contracts.event_data import EventData
from contracts.events import KnownEvent, new_event
from contracts.orchestrator import Phase
from mission.record import Pictures


class StepLog:
    """Events that follow number `told`; `begun`: when the record began, in seconds since 1970."""

    def __init__(self, folder: Path, begun: float, told: int) -> None:
        self._folder = folder
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
            (self._folder / "pictures" / name).write_bytes(jpeg)
            names.append(name)
        time_s = round(max(0.0, time.time() - self._begun), 3)
        self._held.append(new_event(data, number=number, time_s=time_s, phase=phase, message=message, pictures=names))

    def held(self) -> list[tuple[int, str]]:
        """The numbers and texts of the step's events."""
        return [(event.number, event.model_dump_json()) for event in self._held]

    def kept(self) -> None:
        """The held events are in the database."""
        self._told += len(self._held)
        self._held.clear()

    def dropped(self) -> None:
        """The step is not to count: it will be done again."""
        self._held.clear()
