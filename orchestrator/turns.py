"""Deliveries carried on: one step at a time, each of them one transaction.

What a step does to the world is numbered (docs/mission.md), so that a step that was done and not written does no harm
when it is done again, here or by another process.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

import zstandard

from contracts.event_data import NoData
from contracts.flight_limits import FlightLimits
from contracts.orchestrator import DeliveryQuestion, DeliveryStatus
from mission.mission import Mission
from mission.outages import Patience
from mission.stages import Ended, NeedsAnswer, PlaceDrone, Preflight, ReadRequest
from mission.state import MissionState, begin
from orchestrator.customer import StoredCustomer
from orchestrator.delivery import Order
from orchestrator.delivery_log import StepLog
from orchestrator.hangar import Hangar
from orchestrator.records import Records
from orchestrator.store.deliveries import DeliveryStore, Ending, Following, StoredDelivery
from orchestrator.store.vehicles import VehicleStore
from orchestrator.vehicle_contact import Contact, WatchedPlacement

log = logging.getLogger("orchestrator.turns")

ON_THE_GROUND = (ReadRequest, NeedsAnswer, Preflight, PlaceDrone)
BROKEN_OFF = ("service_unreachable", "failed")
NO_VEHICLE_S = 2.0
"""After that a delivery for which no vehicle was free asks again."""


@dataclass(frozen=True)
class Policy:
    """What is done about trouble. `answer_within_s`: how long customers are waited for; `service_within_s`: how long
    a service or a model that is away is waited for; `flights`: how often a delivery is begun to be flown at most;
    `limits`: of every flight."""

    answer_within_s: float
    service_within_s: float
    flights: int
    limits: FlightLimits = field(default_factory=FlightLimits)


@dataclass(frozen=True)
class Tools:
    """What all turns of a process share."""

    store: DeliveryStore
    vehicles: VehicleStore
    hangar: Hangar
    records: Records
    policy: Policy


class Turn:
    """A delivery that this process carries on, from the step to which it has come."""

    def __init__(self, stored: StoredDelivery, tools: Tools) -> None:
        self._stored = stored
        self._tools = tools
        self._version = stored.version
        self._order = Order(DeliveryQuestion.model_validate_json(stored.question), own_vehicles=True)
        self._state = _unpacked(stored.state) or begin(self._order.request, stored.id)
        self._vehicle = stored.vehicle
        self._flights = stored.flights
        tools.records.open(stored, self._order)
        self._log = StepLog(tools.records.files, stored.id, stored.begun or time.time(), stored.events)
        patience_s = self._order.question.answer_within_s
        self._customer = StoredCustomer(
            tools.store, stored.id, tools.policy.answer_within_s if patience_s is None else patience_s
        )
        self._contact = Contact()
        self._mission = self._new_mission()
        self._ending: Ending | None = stored.ending
        self._step: asyncio.Task[MissionState] | None = None
        self._idle = asyncio.Event()
        self._left = False

    def end(self, reason: Ending) -> None:
        """The delivery is to end: a step under way is broken off."""
        if self._ending is None:
            self._ending = reason
            self._interrupt()

    async def leave(self, within_s: float) -> None:
        """The process ends: a step under way has so long to end by itself, and is then broken off; what it did so far
        is not written."""
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._idle.wait(), max(0.0, within_s))
        self._left = True
        self._interrupt()

    def _interrupt(self) -> None:
        if self._step is not None:
            self._step.cancel()

    async def step(self) -> bool:
        """One step; false when the turn is over. Raises Superseded where another process carries the delivery on."""
        self._idle.clear()
        try:
            return await self._stepped()
        finally:
            self._idle.set()

    async def _stepped(self) -> bool:
        if self._ending is not None and not self._state.over:
            self._state = self._ended(self._state, self._ending)
        if self._state.over:
            await self._conclude()
            return False
        stage = self._state.stage
        if self.on_the_ground and isinstance(stage, PlaceDrone):
            await self._park(Following(self._order.flown_by, max(time.time(), self._stored.not_before or 0.0)))
            return False
        if isinstance(stage, NeedsAnswer) and self.on_the_ground and not await self._answered(stage):
            answer_by = stage.question.answer_by.timestamp()
            await self._park(Following("request", answer_by, question=len(self._state.exchanges) + 1))
            return False
        if not self.on_the_ground and self._vehicle is None and not await self._board():
            await self._park(Following(self._order.flown_by, time.time() + NO_VEHICLE_S))
            return False
        state = await self._advanced()
        if self._contact.lost is not None and isinstance(state.stage, Ended) and state.stage.outcome in BROKEN_OFF:
            return await self._lose_vehicle(state)
        self._state = state
        await self._commit()
        return True

    @property
    def on_the_ground(self) -> bool:
        """It has no vehicle yet, and needs none for what it does."""
        return self._stored.lane in ("request", "prompt") and self._vehicle is None

    async def _advanced(self) -> MissionState:
        self._step = asyncio.create_task(self._mission.advanced(self._state))
        try:
            state = await self._step
        finally:
            self._step = None
        if self._left:
            await asyncio.Event().wait()  # the process ends: this step is another one's
        return state if self._ending is None else self._ended(state, self._ending)

    async def _answered(self, stage: NeedsAnswer) -> bool:
        """The customer has answered, or may no more."""
        if stage.question.answer_by <= datetime.now(UTC):
            return True
        return await asyncio.to_thread(self._customer.given, len(self._state.exchanges) + 1) is not None

    async def _board(self) -> bool:
        """Gets a vehicle of the fleet; false where none is free."""
        taken = await asyncio.to_thread(
            self._tools.vehicles.board,
            self._stored.id,
            self._version,
            self._order.flown_by,
            self._order.question.vehicle,
        )
        if taken is None:
            return False
        self._vehicle, self._version, self._flights = taken, self._version + 1, self._flights + 1
        self._mission = self._new_mission()
        return True

    async def _lose_vehicle(self, state: MissionState) -> bool:
        """The vehicle is marked, and the delivery flown again by another, or ended."""
        name, why = self._vehicle or "", self._contact.lost or ""
        if not self._contact.gone:
            await asyncio.to_thread(self._tools.vehicles.mark_lost, name, why)
        self._log.dropped()
        number = self._log.number + 1
        if self._flights >= self._tools.policy.flights:
            self._state = state.model_copy(
                update={"events": self._log.number, "stage": Ended(outcome="vehicle_lost", message=f"{name}: {why}")}
            )
            await self._commit()
            return True
        self._log.write(number, "place", f"the vehicle {name} was lost: {why}; another one flies it again", NoData())
        self._state = _from_the_start(self._state, f"{self._stored.id}-{self._flights + 1}", number)
        self._vehicle = None
        await self._park(Following(self._order.flown_by, time.time()))
        return False

    async def _park(self, following: Following) -> None:
        """Ends the turn."""
        await asyncio.to_thread(self._log.write_pictures)
        store, told = self._tools.store, self._told(None if following.question else "waiting")
        held = self._log.held()
        await asyncio.to_thread(store.park, self._stored.id, self._version, told, held, following)

    async def _conclude(self) -> None:
        """Gives the vehicle back, completes the record, and lets everybody know."""
        await self._mission.release(self._state)
        result = self._mission.result(self._state)
        number = self._log.number + 1
        if number == self._state.events + 1:
            self._log.write(number, "done", f"{result.outcome}: {result.message}", result)
        told = await asyncio.to_thread(self._tools.store.events, self._stored.id, 0, 100_000)
        lines = [*told, *(text for _, text in self._log.held())]
        size = await asyncio.to_thread(self._tools.records.complete, self._stored, lines, result)
        done = {"executor": None, "due": None, "state": None, "phase": "done", "ended": time.time()}
        await self._commit(done | {"result": result.model_dump_json(), "record_bytes": size}, "done")

    async def _commit(self, changes: Mapping[str, object] | None = None, status: DeliveryStatus | None = None) -> None:
        """Writes state and events. Raises Superseded."""
        await asyncio.to_thread(self._log.write_pictures)
        told = self._told(status) | dict(changes or {})
        commit = self._tools.store.commit
        self._version = await asyncio.to_thread(commit, self._stored.id, self._version, told, self._log.held())
        self._log.kept()

    def _told(self, status: DeliveryStatus | None) -> dict[str, object]:
        """What the database is told of the state."""
        state, asked = self._state, None
        if isinstance(state.stage, NeedsAnswer):
            asked = state.stage.question.model_dump_json()
        return {
            "state": _packed(state),
            "phase": state.phase,
            "status": status or ("needs_answer" if asked else "flying" if self._vehicle else "waiting"),
            "open_question": asked,
            "vehicle": self._vehicle,
        }

    def _new_mission(self) -> Mission:
        self._contact = Contact()
        ports, placement = self._tools.hangar.flown_with(self._vehicle, self._order)
        watched = WatchedPlacement(placement, self._contact)
        policy = self._tools.policy
        return Mission(
            ports,
            watched,
            self._order.settings,
            self._log,
            limits=policy.limits,
            customer=self._customer,
            patience=Patience(policy.service_within_s),
        )

    def _ended(self, state: MissionState, reason: Ending) -> MissionState:
        if isinstance(state.stage, Ended) and state.stage.outcome != "cancelled":
            return state
        said = {
            "cancelled": f"cancelled during {state.phase}",
            "deadline_passed": f"the deadline passed during {state.phase}",
        }
        return state.model_copy(update={"stage": Ended(outcome=reason, message=said[reason]), "flight": None})


def _from_the_start(state: MissionState, key: str, events: int) -> MissionState:
    """A new flight of a delivery whose request has been read."""
    begun = begin(state.request, key)
    kept = ("exchanges", "floor", "object", "calls", "seconds")
    read = {name: getattr(state, name) for name in kept}
    return begun.model_copy(update=read | {"stage": PlaceDrone(), "phase": "place", "events": events})


def _packed(state: MissionState) -> bytes:
    return zstandard.compress(state.model_dump_json().encode(), 3)


def _unpacked(data: bytes | None) -> MissionState | None:
    return None if data is None else MissionState.model_validate_json(zstandard.decompress(data))
