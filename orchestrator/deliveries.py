"""Deliveries taken, listed and cancelled: a bounded number under way, all others as their records tell."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable
from pathlib import Path

from contracts.events import Event, PlacedEvent
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult
from contracts.vlm_gateway import PreflightQuestion
from mission.clients import Simulated
from mission.customer import DEFAULT_PATIENCE_S
from mission.ports import PortError, ServiceRefused, UnknownModel
from mission.record import DELIVERY_ID, PICTURE_NAME, cut_off, read_delivery, read_events
from orchestrator.delivery import BadDelivery, Order, Run
from orchestrator.mailbox import Mailbox
from service_kit.errors import BadQuestion, Conflict, NotFound, TooMany, Unavailable

log = logging.getLogger("orchestrator.deliveries")

PREFLIGHT_S = 10.0
"""How long the gateway may take to say whether there is a model; it may have to load it."""
FILES = frozenset({"summary.png", "events.jsonl", "result.json", "question.json"})


class LiveDelivery:
    """One delivery under way: its events so far, and its customer. `changed` is set, and replaced, whenever something
    is new."""

    def __init__(self, run: Run, mailbox: Mailbox) -> None:
        self.run = run
        self.mailbox = mailbox
        self.events: list[Event] = []
        self.result: DeliveryResult | None = None
        self.task: asyncio.Task[None] | None = None
        self.changed = asyncio.Event()

    def add(self, event: Event) -> None:
        self.events.append(event)
        self.notify()

    def notify(self) -> None:
        """Wakes everybody who waits now."""
        self.changed.set()
        self.changed = asyncio.Event()

    @property
    def over(self) -> bool:
        return self.task is not None and self.task.done()

    @property
    def waits_on_ground(self) -> bool:
        """Its customer is asked, and it holds no drone meanwhile."""
        return self.mailbox.question is not None and not any(isinstance(event, PlacedEvent) for event in self.events)

    def delivery(self) -> Delivery:
        question = self.mailbox.question if self.result is None else None
        status = "done" if self.result is not None else "flying" if question is None else "needs_answer"
        told = {
            "status": status,
            "phase": self.events[-1].phase if self.events else "parse",
            "question": question,
            "result": self.result,
        }
        return self.run.record.delivery.model_copy(update=told)


class Deliveries:
    """Takes, lists and cancels deliveries; `runs` is the folder of the records. At most `max_live` are under way, and
    `max_waiting` wait on the ground for an answer, `patience_s` each unless they say otherwise."""

    def __init__(
        self,
        services: Callable[[], Simulated],
        runs: Path,
        *,
        max_live: int = 2,
        max_waiting: int = 50,
        max_listed: int = 200,
        patience_s: float = DEFAULT_PATIENCE_S,
    ) -> None:
        self._services = services
        self._runs = runs
        self._max_live = max_live
        self._max_waiting = max_waiting
        self._max_listed = max_listed
        self._patience_s = patience_s
        self._live: dict[str, LiveDelivery] = {}

    async def take(self, question: DeliveryQuestion) -> Delivery:
        """Starts a delivery. Raises BadQuestion (also for a model that there is not), TooMany, Unavailable (the record
        can't be written)."""
        try:
            order = Order(question)
        except BadDelivery as error:
            raise BadQuestion(str(error)) from None
        await self._check(order)
        # no waiting between the count and the start: others would slip in
        self._check_room()
        started: list[LiveDelivery] = []
        try:
            run = Run(order, self._runs, listener=lambda event: started[0].add(event))
        except OSError as error:
            raise Unavailable(f"the record can't be written: {error.strerror}", code="no_record") from None
        patience_s = self._patience_s if question.answer_within_s is None else question.answer_within_s
        live = LiveDelivery(run, Mailbox(patience_s, lambda: self._waiting < self._max_waiting))
        started.append(live)
        self._live[run.id] = live
        live.task = asyncio.create_task(self._fly(live), name=f"delivery {run.id}")
        await asyncio.sleep(0)  # a task that is cancelled before its first step would leave no record
        return live.delivery()

    @property
    def _waiting(self) -> int:
        return sum(live.waits_on_ground for live in self._live.values())

    def _check_room(self) -> None:
        """Raises TooMany where no further delivery may fly."""
        under_way = sum(not live.over and not live.waits_on_ground for live in self._live.values())
        if under_way >= self._max_live:
            raise TooMany(
                f"{under_way} deliveries are under way, and no more than {self._max_live} may be; "
                "wait for one to end or cancel one",
                headers={"retry-after": "10"},
            )

    async def answer(self, name: str, text: str) -> Delivery:
        """Hands the customer's answer to a delivery that waits for it. Raises NotFound, Conflict (nothing is asked),
        TooMany (it would take off, and as many as may be are under way: the question stays open)."""
        live = self._live.get(name)
        if live is None or live.mailbox.question is None:
            delivery = await asyncio.to_thread(self.get, name)
            raise Conflict(f"delivery {name} asks nothing: it is {delivery.status}", code="nothing_asked")
        if live.waits_on_ground:
            self._check_room()
        live.mailbox.give(text)
        return live.delivery()

    async def _check(self, order: Order) -> None:
        """Raises BadQuestion where the order names a model that there is not, or that takes no pictures. A gateway that
        does not answer is found by the mission itself, whose result says so."""
        if order.settings.vision_model is None:
            return
        question = PreflightQuestion(model=order.settings.vision_model)
        with contextlib.suppress(PortError, TimeoutError):
            try:
                await asyncio.wait_for(self._services().ports.vision.preflight(question), PREFLIGHT_S)
            except UnknownModel as error:
                raise BadQuestion(str(error), code="unknown_model") from None
            except ServiceRefused as error:
                if error.status == 422:
                    raise BadQuestion(str(error)) from None

    async def _fly(self, live: LiveDelivery) -> None:
        try:
            live.result = await live.run.fly(self._services(), live.mailbox)
        except Exception:
            log.exception("delivery %s broke off", live.run.id)
            live.result = cut_off(len(live.events))
        finally:
            live.notify()
            self._live.pop(live.run.id, None)

    def get(self, name: str) -> Delivery:
        """Raises NotFound."""
        live = self._live.get(name)
        if live is not None:
            return live.delivery()
        found = read_delivery(self._folder(name))
        if found is None:
            raise NotFound(f"there is no delivery {name}")
        return found

    def list(self) -> list[Delivery]:
        """The newest first, at most `max_listed`."""
        names = [path.name for path in self._runs.iterdir()] if self._runs.is_dir() else []
        newest = sorted((n for n in names if DELIVERY_ID.fullmatch(n)), reverse=True)[: self._max_listed]
        found = [live.delivery() if (live := self._live.get(n)) else read_delivery(self._runs / n) for n in newest]
        return [delivery for delivery in found if delivery is not None]

    async def cancel(self, name: str) -> Delivery:
        """Ends a delivery under way and waits for its record to be complete; one that is done stays as it is.
        Raises NotFound."""
        live = self._live.get(name)
        if live is not None and live.task is not None and live.result is None:
            live.task.cancel()
            await asyncio.wait({live.task}, timeout=30)
        return self.get(name)

    async def events(self, name: str, after: int = 0) -> AsyncIterator[Event]:
        """All events numbered above `after`: those that were, then those to come, until the delivery is done."""
        live = self._live.get(name)
        if live is None:
            for event in read_events(self._folder(name)):
                if event.number > after:
                    yield event
            return
        told = after
        while True:
            changed = live.changed
            for event in live.events[told:]:
                told = event.number
                yield event
            if live.over or live.result is not None:
                return
            await changed.wait()

    def picture(self, name: str, file: str) -> Path:
        """A file of a record that may be shown. Raises NotFound."""
        folder = self._folder(name)
        if file in FILES:
            path = folder / file
        elif PICTURE_NAME.fullmatch(file):
            path = folder / "pictures" / file
        else:
            raise NotFound("a record has no such file")
        if not path.is_file():
            raise NotFound(f"the record of {name} has no {file} (yet)")
        return path

    async def close(self) -> None:
        """Cancels what is under way and waits for the records."""
        tasks = [live.task for live in self._live.values() if live.task is not None]
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks, timeout=10)

    def _folder(self, name: str) -> Path:
        if not DELIVERY_ID.fullmatch(name):
            raise NotFound("there is no such delivery: ids look like 20250131-120000-1a2b3c")
        return self._runs / name
