"""Records in a folder as deliveries to look at: a run of `bench`, or those of `logisticsvln deliver`."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from pydantic import ValidationError

from contracts.events import Event, MoveEvent, PlacedEvent, ResultEvent, TurnEvent
from contracts.geometry import Pose
from contracts.orchestrator import Delivery, DeliveryResult, DeliveryStatus
from contracts.overview import DeliveryLine, FlightSeen, Overview, StreetPlan
from mission.record import (
    BadRecord,
    cut_off,
    is_being_written,
    read_events,
    read_question,
    read_result,
)
from orchestrator.record_files import FolderFiles, Shown, shown_file
from orchestrator.store.lines import Chosen
from orchestrator.streets import street_of
from service_kit.errors import NotFound

LOOK_EVERY_S = 0.5


class Replays:
    """Records below `folder`, or below its `episodes`; nothing is written there."""

    def __init__(self, folder: Path) -> None:
        self._given = folder
        self._done: dict[str, Delivery] = {}
        self._streets: dict[str, StreetPlan | None] = {}

    @property
    def _folder(self) -> Path:
        """A run has its `episodes` once the first of them is begun."""
        episodes = self._given / "episodes"
        return episodes if episodes.is_dir() else self._given

    async def overview(self, chosen: Chosen) -> Overview:
        """As the orchestrator's, without vehicles: a record tells only where its drone stopped last. Raises
        NotFound for a page before no record."""
        everything = await asyncio.to_thread(self._all)
        counts: dict[DeliveryStatus, int] = {"waiting": 0, "flying": 0, "needs_answer": 0, "done": 0}
        for delivery in everything:
            counts[delivery.status] += 1
        older = everything if chosen.before is None else _older(everything, chosen.before)
        fit = [delivery for delivery in older if _fits(delivery, chosen)]
        shown = fit[: chosen.limit]
        return Overview(
            time=datetime.now(UTC),
            counts=counts,
            deliveries=tuple(_line(delivery) for delivery in shown),
            next=shown[-1].id if len(fit) > chosen.limit else None,
            asking=(),
            flights=await asyncio.to_thread(self._flights, everything),
            vehicles=(),
        )

    async def get(self, name: str) -> Delivery:
        """Raises NotFound."""
        found = await asyncio.to_thread(self._read, name)
        if found is None:
            raise NotFound(f"there is no record {name}")
        return found

    async def events(self, name: str, after: int) -> AsyncIterator[Event]:
        """Those that are written and those to come, until the delivery is done. Raises NotFound."""
        while True:
            delivery = await self.get(name)
            for event in await asyncio.to_thread(read_events, self._folder / name):
                if event.number > after:
                    after = event.number
                    yield event
                    if isinstance(event, ResultEvent):
                        return
            if delivery.status == "done":
                return
            await asyncio.sleep(LOOK_EVERY_S)

    async def street(self, name: str) -> StreetPlan:
        """Raises NotFound."""
        await self.get(name)
        street = await asyncio.to_thread(self._street, name)
        if street is None:
            raise NotFound(f"the record {name} does not tell its street")
        return street

    async def file(self, name: str, file: str) -> Shown:
        """A file of a record that may be shown. Raises NotFound."""
        await self.get(name)
        found = await asyncio.to_thread(shown_file, FolderFiles(self._folder), name, file)
        if found is None:
            raise NotFound(f"the record of {name} has no {file[:80]} (yet)")
        return found

    def _street(self, name: str) -> StreetPlan | None:
        if name not in self._streets:
            try:
                scene = read_question(self._folder / name).scene
            except (OSError, BadRecord):
                scene = None
            self._streets[name] = None if scene is None else street_of(scene)
        return self._streets[name]

    def _flights(self, everything: Sequence[Delivery]) -> tuple[FlightSeen, ...]:
        return tuple(self._flight(delivery) for delivery in everything if delivery.status == "flying")

    def _flight(self, delivery: Delivery) -> FlightSeen:
        street = self._street(delivery.id)
        return FlightSeen(
            delivery=delivery.id,
            request=delivery.request,
            drone=None,
            problem=None,
            street=None if street is None else street.key,
            stop=_last_stop(read_events(self._folder / delivery.id)),
        )

    def _all(self) -> list[Delivery]:
        """The newest first."""
        names = (path.name for path in self._folder.iterdir() if path.is_dir()) if self._folder.is_dir() else ()
        found = [delivery for name in names if (delivery := self._read(name)) is not None]
        return sorted(found, key=lambda delivery: (delivery.created, delivery.id), reverse=True)

    def _read(self, name: str) -> Delivery | None:
        if name in self._done:
            return self._done[name]
        folder = self._folder / name
        if folder.parent != self._folder or name in (".", ".."):
            return None
        try:
            delivery = Delivery.model_validate_json((folder / "delivery.json").read_bytes(), extra="ignore")
        except (OSError, ValidationError):
            return None
        result = read_result(folder)
        if result is None and is_being_written(folder):
            events = read_events(folder)
            phase = events[-1].phase if events else delivery.phase
            return Delivery.model_validate(delivery.model_dump() | {"id": name, "status": "flying", "phase": phase})
        return self._remembered(name, delivery, result or cut_off(len(read_events(folder))))

    def _remembered(self, name: str, delivery: Delivery, result: DeliveryResult) -> Delivery:
        done = {"id": name, "status": "done", "phase": "done", "result": result}
        self._done[name] = delivery.model_copy(update=done)
        return self._done[name]


def _last_stop(events: Sequence[Event]) -> Pose | None:
    """Where the last flight ended; null before take-off."""
    for event in reversed(events):
        if isinstance(event, MoveEvent | TurnEvent):
            return event.data.to
        if isinstance(event, PlacedEvent):
            return event.data.pose
    return None


def _older(newest_first: Sequence[Delivery], before: str) -> Sequence[Delivery]:
    """Raises NotFound."""
    for at, delivery in enumerate(newest_first):
        if delivery.id == before:
            return newest_first[at + 1 :]
    raise NotFound(f"there is no record {before}")


def _fits(delivery: Delivery, chosen: Chosen) -> bool:
    outcome = None if delivery.result is None else delivery.result.outcome
    words = (chosen.text or "").casefold()
    return (
        chosen.status in (None, delivery.status)
        and chosen.outcome in (None, outcome)
        and (words in delivery.request.casefold() or words in delivery.id.casefold())
    )


def _line(delivery: Delivery) -> DeliveryLine:
    result = delivery.result
    return DeliveryLine(
        id=delivery.id,
        status=delivery.status,
        phase=delivery.phase,
        request=delivery.request,
        scene=delivery.scene,
        created=datetime.fromisoformat(delivery.created),
        started=None,
        ended=None,
        priority=0,
        vehicle=None,
        flights=0,
        question=None,
        outcome=None if result is None else result.outcome,
        message=None if result is None else result.message,
    )
