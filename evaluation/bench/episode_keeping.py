"""What a run keeps of one episode beside its result: nothing, its record, or its record and its trajectory."""

import shutil
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from contracts.event_data import EventData
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, Phase
from mission.placement import Placement
from mission.record import Log, Pictures, Record
from mission.trajectory import TrajectoryWriter
from mission.vehicles.recorded import RecordedPlacement, kept_on_disk

TRAJECTORY = "trajectory"
"""The folder of an episode's trajectory, in that of its record."""
Kept = Literal["none", "failures", "all"]
"""Whose pictures a run keeps."""


class Unwritten:
    """A log for runs that keep nothing but results."""

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        """Forgets it."""


class _OnDisk:
    """A record as a log."""

    def __init__(self, record: Record) -> None:
        self._record = record

    def write(self, number: int, phase: Phase, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        with kept_on_disk():
            self._record.write(number, phase, message, data, pictures)


class EpisodeKeeping:
    """Use as a context manager round one flight; a null `folder` keeps nothing. Whatever it does raises
    mission.ports.ServiceUnreachable where the disk takes no more."""

    def __init__(
        self, folder: Path | None, delivery: Delivery, question: DeliveryQuestion, *, trajectory: bool
    ) -> None:
        """What a session that was killed left in the folder is taken away."""
        self.log: Log = Unwritten()
        self._record: Record | None = None
        self._trajectory: TrajectoryWriter | None = None
        if folder is None:
            return
        shutil.rmtree(folder, ignore_errors=True)
        with kept_on_disk():
            self._record = Record(folder, delivery, question)
            self.log = _OnDisk(self._record)
            if trajectory:
                self._trajectory = TrajectoryWriter(folder / TRAJECTORY)

    def placement(self, placement: Placement) -> Placement:
        """The same, recorded where that is wanted."""
        return placement if self._trajectory is None else RecordedPlacement(placement, self._trajectory)

    def conclude(self, result: DeliveryResult) -> None:
        """The episode is over."""
        if self._record is not None:
            with kept_on_disk():
                self._record.conclude(result)
                self._record.announce(result)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for kept in (self._record, self._trajectory):
            if kept is not None:
                with kept_on_disk():
                    kept.close()
