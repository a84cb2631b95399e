"""One delivery with its record: what the REST door and the command line both call."""

import asyncio
import contextlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Self

from contracts.events import Event
from contracts.fleet import VehicleKind
from contracts.orchestrator import Delivery, DeliveryQuestion, DeliveryResult, MissionSettings
from contracts.scene import Scene
from mission.clients import Simulated
from mission.customer import Customer
from mission.mission import Mission
from mission.outages import Patience
from mission.placement import InTrial, trial_question
from mission.policies import BadSearch, completed
from mission.policies.base import AnyPolicy
from mission.record import Record, new_id, now, read_question, read_result, read_state
from mission.state import MissionState, begin
from mission.vehicle import Trial
from orchestrator import sample_library
from orchestrator.summary import draw_summary
from service_kit.extensions import BadExtension

log = logging.getLogger("orchestrator.delivery")

Listener = Callable[[Event], None]
"""Hears every event of a delivery once it is written."""


class BadDelivery(ValueError):
    """A delivery that can't be flown as it was asked for; the message says what would be right."""


class Order:
    """A delivery that is sound: the request, the scene, the settings with the back end filled in."""

    def __init__(
        self,
        question: DeliveryQuestion,
        *,
        own_vehicles: bool = False,
        policy: AnyPolicy | None = None,
        own_request: bool = False,
    ) -> None:
        """`own_vehicles`: there are such that need no scene. `policy`: searches instead of the one that the settings
        name. `own_request`: the scene's goal was set for other words, as it is where a sample is given others. Raises
        BadDelivery for a question without scene or request, an unknown sample, or two models."""
        given = (question.scene is not None) + (question.sample is not None)
        if given == 2 or (given == 0 and not own_vehicles):
            raise BadDelivery("give either a scene or the name of a sample")
        request, scene = question.request, question.scene
        self.own_request = own_request
        if question.sample is not None:
            try:
                sample = sample_library.load(question.sample)
            except ValueError as error:
                raise BadDelivery(str(error)) from None
            self.own_request = request is not None and request.strip() != sample.request.strip()
            request, scene = request or sample.request, sample.scene
        if request is None or not request.strip():
            raise BadDelivery("say in `request` what is to be brought where")
        self.request: str = request
        self.scene: Scene | None = scene
        self.policy = policy
        try:
            self.settings: MissionSettings = completed(question.settings, policy)
        except (BadSearch, BadExtension) as error:
            raise BadDelivery(str(error)) from None
        named = (question.backend, self.settings.vision_model)
        if None not in named and named[0] != named[1]:
            raise BadDelivery(f"backend {named[0]} and settings.vision_model {named[1]} differ: name one of them")
        if question.backend is not None and self.settings.vision_model is None:
            self.settings = self.settings.model_copy(update={"vision_model": question.backend})
        self.question = question.model_copy(
            update={"request": request, "scene": scene, "settings": self.settings},
        )

    @property
    def scene_name(self) -> str | None:
        return None if self.scene is None else self.scene.name

    @property
    def flown_by(self) -> VehicleKind:
        """The kind of vehicle that flies it."""
        return "vehicle" if self.scene is None else "simulator"

    @classmethod
    def recorded(cls, folder: Path) -> Self:
        """The order of a record. Raises OSError, BadRecord or BadDelivery where the folder holds none."""
        question = read_question(folder)
        if question.sample is None or question.scene is None:
            return cls(question)
        own_request = True  # of a sample that is no longer there nobody knows the words
        with contextlib.suppress(BadDelivery):
            own_request = cls(question.model_copy(update={"scene": None})).own_request
        return cls(question.model_copy(update={"sample": None}), own_request=own_request)

    def placed(self, trial: Trial) -> InTrial:
        """The scene as a trial of that simulator. Raises BadDelivery where there is none."""
        if self.scene is None:
            raise BadDelivery("a simulator needs a scene")
        return InTrial(trial, trial_question(self.scene, self.settings, own_request=self.own_request))


class Run:
    """A delivery under way: its record and, at the end, its result."""

    def __init__(self, order: Order, runs: Path, *, listener: Listener | None = None) -> None:
        """Opens the record. Raises OSError where the folder can't be written."""
        self._order = order
        self._done: DeliveryResult | None = None
        self._state: MissionState | None = None
        self.problem: Exception | None = None
        """The unexpected error that the mission broke off by, where it was one."""
        name = new_id()
        delivery = Delivery(
            id=name,
            status="waiting",
            phase="parse",
            request=order.request,
            scene=order.scene_name,
            created=now(),
            folder=str(runs / name),
        )
        self.record = Record(runs / name, delivery, order.question, listener=listener)

    @classmethod
    def reopened(cls, folder: Path, *, listener: Listener | None = None) -> Self:
        """The delivery of a record that another process left: `fly` carries it on. Raises OSError, BadRecord or
        BadDelivery where the folder holds no record, one that can't be carried on, or one that somebody still
        writes."""
        run = cls.__new__(cls)
        run.problem = None
        run._order = Order.recorded(folder)
        run.record = Record.reopened(folder, listener=listener)
        try:
            run._done = read_result(folder)
            run._state = None if run._done is not None else read_state(folder)
        except BaseException:
            run.record.close()
            raise
        return run

    @property
    def id(self) -> str:
        return self.record.delivery.id

    async def fly(
        self, services: Simulated, customer: Customer | None = None, patience: Patience | None = None
    ) -> DeliveryResult:
        """Flies from where the record's state is, and completes the record; one that is done is not flown again.
        Cancelling the task ends the flight, not the record. Without a `customer` nobody is asked what a request leaves
        open; without `patience` nothing that is away is waited for."""
        try:
            result = self._done or await self._flown(self._mission(services, customer, patience))
            if self._done is None:
                self.record.conclude(result)
            await self._draw()
            self.record.announce(result)
        finally:
            self.record.close()
        return result

    async def _flown(self, mission: Mission) -> DeliveryResult:
        result = await mission.go_on(self._state or begin(self._order.request))
        self.problem = mission.problem
        return result

    def _mission(self, services: Simulated, customer: Customer | None, patience: Patience | None) -> Mission:
        order, record = self._order, self.record
        placed = order.placed(services.trial)
        return Mission(
            services.ports,
            placed,
            order.settings,
            record,
            customer=customer,
            keep=record.keep,
            policy=order.policy,
            patience=patience,
        )

    async def _draw(self) -> None:
        """The summary picture; a delivery without one is still a delivery."""
        try:
            await asyncio.to_thread(draw_summary, self.record.folder)
        except asyncio.CancelledError:
            task = asyncio.current_task()
            if task is not None:
                task.uncancel()
        except Exception:
            log.exception("the summary picture of %s could not be drawn", self.id)
