"""A log that tells only what stands: the events of a step are held until its effects are final."""

from typing import NamedTuple

from contracts.event_data import EventData
from contracts.orchestrator import Phase
from mission.record import Log, Pictures


class _Held(NamedTuple):
    number: int
    phase: Phase
    message: str
    data: EventData
    pictures: Pictures | None


class HeldLog:
    """A `Log` before another one, which hears of events once they are to stand, or never."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._held: list[_Held] = []

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        self._held.append(_Held(number, phase, message, data, pictures))

    def tell(self) -> None:
        """The held events stand. Whatever the other log raises, none is told twice."""
        held, self._held = self._held, []
        for event in held:
            self._log.write(*event)

    def drop(self) -> None:
        """The held events are not to count."""
        self._held = []
