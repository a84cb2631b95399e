"""What the pages show: the whole system for its operators, one delivery for its customer."""

import asyncio
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

from contracts.orchestrator import Delivery, OpenQuestion
from contracts.overview import (
    CustomersDrone,
    DeliveryLine,
    DroneSeen,
    FlightSeen,
    Outlook,
    Overview,
    Span,
    StreetPlan,
    Tracking,
)
from orchestrator.deliveries import Deliveries
from orchestrator.newest import Newest
from orchestrator.record_files import Shown
from orchestrator.roll_call import RollCall
from orchestrator.store.lines import Chosen, LineStore, StoredLine
from orchestrator.streets import Streets
from orchestrator.telemetry import Silent, Telemetry
from service_kit.errors import NotFound, Unavailable

STOPPED = ("delivered", "stopped_not_judged", "wrong_window", "not_in_front")
ASKING_SHOWN = 20
ENOUGH = 3
"""From so many earlier flights on it is told how long one takes."""
TIMES_KEPT_S = 10.0
MAX_KEPT = 2_000


class Overlook:
    """Looks only: nothing here changes a delivery."""

    def __init__(
        self, deliveries: Deliveries, lines: LineStore, fleet: RollCall, telemetry: Telemetry, streets: Streets
    ) -> None:
        self._deliveries = deliveries
        self._lines = lines
        self._fleet = fleet
        self.telemetry = telemetry
        self._streets = streets
        self._pictures: Newest[str, str | None] = Newest(MAX_KEPT)
        self._times: list[float] = []
        self._timed = -TIMES_KEPT_S

    async def overview(self, chosen: Chosen) -> Overview:
        """Everything at once, of the deliveries the chosen ones. Raises NotFound for a page before no delivery."""
        if chosen.before is not None:
            await self._deliveries.get(chosen.before)
        found, counts, vehicles = await asyncio.gather(
            asyncio.to_thread(self._lines.lines, replace(chosen, limit=chosen.limit + 1)),
            asyncio.to_thread(self._lines.counts),
            self._fleet.list(),
        )
        shown = tuple(_line(stored) for stored in found[: chosen.limit])
        flying = [name for vehicle in vehicles for name in vehicle.deliveries]
        requests = await asyncio.to_thread(self._lines.requests, flying)
        asking = await self._asking() if counts["needs_answer"] else ()
        return Overview(
            time=datetime.now(UTC),
            counts=counts,
            deliveries=shown,
            next=shown[-1].id if len(found) > chosen.limit else None,
            asking=asking,
            flights=tuple(
                await asyncio.gather(*(self._flight(name, requests[name]) for name in flying if name in requests))
            ),
            vehicles=vehicles,
        )

    async def drone(self, name: str) -> DroneSeen:
        """Raises NotFound where none flies, Unavailable where it does not tell."""
        await self._deliveries.get(name)
        try:
            seen = await self.telemetry.of(name)
        except Silent as error:
            raise Unavailable(str(error), code="drone_silent") from None
        if seen is None:
            raise NotFound(f"no drone flies delivery {name} now")
        return seen

    async def street(self, name: str) -> StreetPlan:
        """Raises NotFound."""
        await self._deliveries.get(name)
        street = await self._streets.of(name)
        if street is None:
            raise NotFound(f"the street of delivery {name} is not known: a vehicle flies it where it stands")
        return street

    async def tracking(self, name: str) -> Tracking:
        """For its customer. Raises NotFound."""
        delivery = await self._deliveries.get(name)
        try:
            seen, silent = await self.telemetry.of(name), False
        except Silent:
            seen, silent = None, True
        waits = delivery.status == "waiting"
        ahead = await asyncio.to_thread(self._lines.ahead_of, name) if waits else None
        times = await self._flight_times()
        held_up = delivery.result is None and await asyncio.to_thread(self._lines.held_up, name)
        return Tracking(
            time=datetime.now(UTC),
            request=delivery.request,
            status=delivery.status,
            phase=delivery.phase,
            created=datetime.fromisoformat(delivery.created),
            started=None if delivery.started is None else datetime.fromisoformat(delivery.started),
            ended=None if delivery.ended is None else datetime.fromisoformat(delivery.ended),
            question=delivery.question,
            drone=None if seen is None else _for_customer(seen),
            silent=silent,
            held_up=held_up,
            outlook=Outlook(ahead=ahead, flight=_span(times), deliveries=len(times)),
            outcome=None if delivery.result is None else delivery.result.outcome,
            picture=await self._picture_of_stop(delivery) is not None,
        )

    async def picture(self, name: str) -> Shown:
        """Of the stop. Raises NotFound, Unavailable."""
        file = await self._picture_of_stop(await self._deliveries.get(name))
        if file is None:
            raise NotFound("there is no picture of the stop (yet)")
        return await self._deliveries.file(name, file)

    async def _picture_of_stop(self, delivery: Delivery) -> str | None:
        """The file of the last picture that shows the window; null before the drone has stopped at one."""
        if delivery.result is None or delivery.result.outcome not in STOPPED:
            return None
        if delivery.id not in self._pictures:
            self._pictures[delivery.id] = await asyncio.to_thread(self._lines.last_picture, delivery.id)
        return self._pictures[delivery.id]

    async def _asking(self) -> tuple[DeliveryLine, ...]:
        found = await asyncio.to_thread(self._lines.lines, Chosen(ASKING_SHOWN, "needs_answer"))
        return tuple(_line(stored) for stored in found)

    async def _flight_times(self) -> list[float]:
        """One question to the database serves every customer for a while, once there are enough of them."""
        if len(self._times) < ENOUGH or time.monotonic() > self._timed + TIMES_KEPT_S:
            self._times = await asyncio.to_thread(self._lines.flight_times)
            self._timed = time.monotonic()
        return self._times

    async def _flight(self, name: str, request: str) -> FlightSeen:
        street = await self._streets.key_of(name)
        try:
            seen = await self.telemetry.of(name)
            return FlightSeen(delivery=name, request=request, drone=seen, problem=None, street=street)
        except Silent as error:
            return FlightSeen(delivery=name, request=request, drone=None, problem=str(error), street=street)


def _line(stored: StoredLine) -> DeliveryLine:
    result = {} if stored.result is None else json.loads(stored.result)
    asked = None if stored.open_question is None else OpenQuestion.model_validate_json(stored.open_question)
    shown = stored._asdict() | {name: _moment(getattr(stored, name)) for name in ("created", "started", "ended")}
    del shown["open_question"], shown["result"]
    return DeliveryLine(
        **shown,
        question=None if asked is None else asked.text,
        outcome=result.get("outcome"),
        message=result.get("message"),
    )


def _moment(seconds: float | None) -> datetime | None:
    return None if seconds is None else datetime.fromtimestamp(round(seconds, 3), UTC)


def _span(times: Sequence[float]) -> Span | None:
    if len(times) < ENOUGH:
        return None
    tenths = statistics.quantiles(times, n=10, method="inclusive")
    return Span(least_s=round(tenths[0], 1), most_s=round(tenths[-1], 1))


def _for_customer(seen: DroneSeen) -> CustomersDrone:
    return CustomersDrone(time=seen.time, pose=seen.state.pose, battery=seen.state.battery.remaining)
