"""Deliveries taken, listed, answered and cancelled, whichever process carries them on."""

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace

from pydantic import ValidationError

from contracts.events import Event, read_event
from contracts.orchestrator import Delivery, DeliveryList, DeliveryQuestion
from mission.model_check import WrongModel, check_models
from mission.ports import PortError
from mission.record import DELIVERY_ID, new_id
from orchestrator.delivery import BadDelivery, Order
from orchestrator.hangar import Hangar
from orchestrator.intake import Intake
from orchestrator.keeper import Keeper
from orchestrator.record_files import Shown, shown_file
from orchestrator.records import Records
from orchestrator.store.deliveries import DeliveryStore, StoredDelivery
from orchestrator.store.lines import Chosen, LineStore
from orchestrator.watch import Watch
from service_kit.errors import BadQuestion, Conflict, NotFound, ServiceError, TooMany, Unavailable

PREFLIGHT_S = 10.0
"""How long the gateway may take to say whether there is a model; it may have to load it."""
CANCEL_S = 30.0
COUNT_EVERY_S = 1.0


@dataclass(frozen=True)
class Bounds:
    """`waiting`: deliveries that may wait at a time."""

    waiting: int = 100_000


class Deliveries:
    """What the REST door offers."""

    def __init__(
        self,
        store: DeliveryStore,
        intake: Intake,
        lines: LineStore,
        watch: Watch,
        keeper: Keeper,
        hangar: Hangar,
        records: Records,
        bounds: Bounds | None = None,
    ) -> None:
        self._store = store
        self._intake = intake
        self._lines = lines
        self._watch = watch
        self._keeper = keeper
        self._hangar = hangar
        self._records = records
        self._bounds = bounds or Bounds()
        self._members = {member.name: member.kind for member in hangar.members}
        self._waiting = 0
        self._counted = 0.0

    async def take(self, question: DeliveryQuestion, key: str | None = None) -> Delivery:
        """Takes a delivery, which is then queued; the same `key` again is the same delivery. Raises BadQuestion (also
        for a model that there is not, and for a key that was another delivery's), TooMany."""
        asked = question.model_dump_json()
        try:
            order = self._order(question)
            await self._check(order)
            await self._check_room()
        except ServiceError:
            known = None if key is None else await asyncio.to_thread(self._store.of_key, key)
            if known is None:
                raise
            return self._same(known, asked)
        return self._same(await self._taken(_new(question, asked, order, key)), asked)

    def _order(self, question: DeliveryQuestion) -> Order:
        """Raises BadQuestion for a delivery that can't be flown as it is asked for."""
        try:
            order = Order(question, own_vehicles="vehicle" in self._members.values())
        except BadDelivery as error:
            raise BadQuestion(str(error)) from None
        if order.flown_by not in self._members.values():
            raise BadQuestion("scene: no simulator is part of the fleet; leave scene and sample out")
        if question.vehicle is not None and self._members.get(question.vehicle) != order.flown_by:
            there = [name for name, kind in self._members.items() if kind == order.flown_by]
            raise BadQuestion(
                f"vehicle: {question.vehicle} does not fly such a delivery; these do: {', '.join(there)}",
                code="unknown_vehicle",
            )
        if question.deadline is not None and question.deadline.timestamp() <= time.time():
            raise BadQuestion("deadline: it has passed; give a time to come", code="deadline_passed")
        return order

    async def _taken(self, row: dict[str, object]) -> StoredDelivery:
        """The new delivery, or the one that has its key already."""
        while (taken := await self._intake.add(row)) is None:
            row["id"] = new_id()
        if taken.id == row["id"]:
            self._waiting += 1
            self._keeper.nudge()
        return taken

    def _same(self, known: StoredDelivery, asked: str) -> Delivery:
        """Raises BadQuestion where the stored one was asked for in other words."""
        if known.question != asked and _question_of(known) != DeliveryQuestion.model_validate_json(asked):
            raise BadQuestion(
                f"Idempotency-Key: delivery {known.id} has it, and was asked for in other words; give each delivery a "
                "key of its own",
                code="idempotency_key_reused",
            )
        return self._records.told(known)

    async def _check_room(self) -> None:
        if time.monotonic() > self._counted + COUNT_EVERY_S:
            self._counted = time.monotonic()
            self._waiting = await asyncio.to_thread(self._store.waiting)
        if self._waiting >= self._bounds.waiting:
            raise TooMany(
                f"{self._waiting} deliveries wait, and no more than {self._bounds.waiting} may; try again later",
                headers={"retry-after": "10"},
            )

    async def _check(self, order: Order) -> None:
        """Raises BadQuestion where the order names a model that there is not, one that takes no pictures, or a parser
        that reads no requests. A gateway that does not answer is found by the mission itself, whose result says so."""
        seeing, parsing = order.settings.vision_model, order.settings.parser_model
        if seeing is None and parsing is None:
            return
        with contextlib.suppress(PortError, TimeoutError):
            try:
                vision = self._hangar.flown_with(None, order).ports.vision
                await asyncio.wait_for(check_models(vision, seeing, parsing), PREFLIGHT_S)
            except WrongModel as error:
                raise BadQuestion(str(error), code=error.code) from None

    async def answer(self, name: str, text: str) -> Delivery:
        """The customer's answer to the question of a delivery that waits for it. Raises NotFound, Conflict (nothing is
        asked)."""
        stored = await self._stored(name)
        given = [*json.loads(stored.answers), text.strip()]
        if stored.open_question is None or not await asyncio.to_thread(
            self._store.answer, name, stored.open_question, given
        ):
            now = await self._stored(name)
            raise Conflict(f"delivery {name} asks nothing: it is {now.status}", code="nothing_asked")
        self._watch.note(name)
        self._keeper.nudge()
        return await self.get(name)

    async def get(self, name: str) -> Delivery:
        """Raises NotFound."""
        return self._records.told(await self._stored(name))

    async def list(self, chosen: Chosen) -> DeliveryList:
        """The newest first. Raises NotFound for a page that begins before no delivery."""
        if chosen.before is not None:
            await self._stored(chosen.before)
        found = await asyncio.to_thread(self._lines.lines, replace(chosen, limit=chosen.limit + 1))
        shown = tuple(self._records.told(stored) for stored in found[: chosen.limit])
        return DeliveryList(deliveries=shown, next=shown[-1].id if len(found) > chosen.limit else None)

    async def cancel(self, name: str) -> Delivery:
        """Ends a delivery, whatever its status, and waits for its record to be complete; one that is done stays as it
        is. Raises NotFound."""
        stored = await self._stored(name)
        if stored.status != "done":
            await self._keeper.end(name, "cancelled")
        give_up = time.monotonic() + CANCEL_S
        while stored.status != "done" and time.monotonic() < give_up:
            stored = await self._stored(name)
            if stored.status != "done":
                await self._watch.changed(name, stored.version, give_up - time.monotonic())
        return self._records.told(stored)

    async def events(self, name: str, after: int = 0) -> AsyncIterator[Event]:
        """All events numbered above `after`: those that were, then those to come, until the delivery is done."""
        while True:
            stored = await self._stored(name)
            while texts := await asyncio.to_thread(self._store.events, name, after):
                for text in texts:
                    event = read_event(text)
                    after = event.number
                    yield event
            if stored.status == "done":
                return
            await self._watch.changed(name, stored.version)

    async def file(self, name: str, file: str) -> Shown:
        """A file of a record that may be shown. Raises NotFound, Unavailable."""
        stored = await self._stored(name)
        try:
            found = await asyncio.to_thread(shown_file, self._records.files, stored.id, file)
        except OSError:
            raise Unavailable("records can't be read now; try again later", code="no_records") from None
        if found is None:
            raise NotFound(f"the record of {name} has no {file[:80]} (yet)")
        return found

    async def _stored(self, name: str) -> StoredDelivery:
        if not DELIVERY_ID.fullmatch(name):
            raise NotFound("there is no such delivery: ids look like 20250131-120000-1a2b3c")
        stored = await asyncio.to_thread(self._store.get, name)
        if stored is None:
            raise NotFound(f"there is no delivery {name}")
        return stored


def _question_of(stored: StoredDelivery) -> DeliveryQuestion | None:
    """What was asked for, by an older version as well; null where today's can't read it."""
    try:
        return DeliveryQuestion.model_validate_json(stored.question)
    except ValidationError:
        return None


def _new(question: DeliveryQuestion, asked: str, order: Order, key: str | None) -> dict[str, object]:
    """The row of a delivery that has just been asked for: its request is to be read."""
    now = time.time()
    return {
        "id": new_id(),
        "question": asked,
        "request": order.request,
        "scene": order.scene_name,
        "idempotency_key": key,
        "priority": question.priority,
        "not_before": None if question.not_before is None else question.not_before.timestamp(),
        "deadline": None if question.deadline is None else question.deadline.timestamp(),
        "created": now,
        "status": "waiting",
        "phase": "parse",
        "lane": "request",
        "due": now,
        "answers": json.dumps([text.strip() for text in question.answers]),
        "answered": len(question.answers),
    }
