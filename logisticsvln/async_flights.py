"""Deliveries flown from this process, awaited: the services run beside it, policy and model are its own Python.

`logisticsvln.LocalServices` is the same for programs without an event loop.
"""

import contextlib
import dataclasses
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, NamedTuple, Self

from pydantic import ValidationError

from contracts.errors import first_problem
from contracts.events import Event
from contracts.orchestrator import DeliveryQuestion, DeliveryResult, MissionSettings, OpenQuestion
from contracts.scene import Scene
from launcher.processes import Processes, free_ports, oracle_settings
from logisticsvln.functions import authors_part, call, must_take
from logisticsvln.policies import Policy, with_policy
from logisticsvln.scenes import read_scene
from logisticsvln.vision import Model, OwnVision
from mission.clients import Services, Simulated
from mission.customer import AnsweredBeforehand, Customer
from mission.model_check import WrongModel, check_models
from mission.outages import DEFAULT_WITHIN_S, Patience
from mission.record import read_events
from orchestrator.delivery import BadDelivery, Listener, Order, Run
from service_kit.addresses import FLIGHT_SERVICES, Addresses
from service_kit.connections import Connections
from service_kit.settings import process_environment

ORACLE = "oracle"
_MISSIONS, _NOBODY = logging.getLogger("mission"), logging.NullHandler()
"""What a mission breaks off by is raised: a program that has set up no logging is not told of it twice."""


class Flown(NamedTuple):
    """A delivery that was flown: its result, and the folder of its record."""

    result: DeliveryResult
    folder: Path

    @property
    def events(self) -> list[Event]:
        """Everything that happened, in its order."""
        return read_events(self.folder)

    @property
    def summary(self) -> Path:
        """One picture of the delivery (PNG)."""
        return self.folder / "summary.png"


class Asked(NamedTuple):
    """A delivery as it is asked for, found sound. `seeing`: the gateway's model that sees, null for its roles."""

    order: Order
    own: OwnVision | None
    seeing: str | None


def asked_for(
    request: str | None,
    scene: Scene | str | Path | None,
    *,
    sample: str | None,
    policy: Policy | None,
    vision: Model | None,
    settings: MissionSettings | dict[str, Any] | None,
) -> Asked:
    """What `fly` takes, looked at before any service is asked. Raises BadDelivery, BadScene."""
    own: OwnVision | None = None
    if vision is not None and not isinstance(vision, str):
        own = vision if isinstance(vision, OwnVision) else OwnVision(vision)
    named = vision if isinstance(vision, str) else None if own is None else own.name
    try:
        constants = MissionSettings.model_validate({} if settings is None else settings)
    except ValidationError as error:
        raise BadDelivery(f"settings: {first_problem(error)}") from None
    seeing = own.rest if own is not None else named or constants.vision_model
    flown_with, given = with_policy(constants, policy)
    try:
        question = DeliveryQuestion(
            request=request,
            scene=read_scene(scene) if isinstance(scene, str | Path) else scene,
            sample=sample,
            backend=named,
            settings=flown_with,
        )
    except ValidationError as error:
        raise BadDelivery(first_problem(error)) from None
    return Asked(Order(question, policy=given), own, seeing)


class AsyncLocalServices:
    """Simulator, parser, gateway and depth service as processes of this machine, for as long as the context lasts.

    Other services, at addresses of their own, do as well. Starting takes some seconds, so fly as much as possible in
    one context.
    """

    def __init__(
        self,
        *,
        oracle: bool = False,
        at: Addresses | None = None,
        logs: Path | None = None,
        settings: Mapping[str, Mapping[str, str]] | None = None,
        patience_s: float = DEFAULT_WITHIN_S,
    ) -> None:
        """Takes what the flights have in common.

        Args:
        oracle: Switches the simulator's truth on, for `vision="oracle"`.
        at: Services that run already, instead of starting some.
        logs: Where what the services say is kept; nowhere without it.
        settings: More environment variables by service, such as `{"sim": {"SIM_CATALOGUE": "my-things"}}`.
        patience_s: How long a service or a model may be away before a flight fails for it; the drone holds meanwhile.
        """
        self._oracle = oracle
        self._at = at
        self._logs = logs
        self._settings = {name: dict(more) for name, more in (settings or {}).items()}
        self._patience_s = patience_s
        self._stack = contextlib.AsyncExitStack()
        self._clients: Services | None = None
        self._own: Processes | None = None

    @property
    def clients(self) -> Services:
        """The services' clients. Raises RuntimeError outside the context."""
        if self._clients is None:
            raise RuntimeError("the services run inside `with` only")
        return self._clients

    @property
    def patience(self) -> Patience:
        """With what is away; a service of our own that has ended is started again by nobody."""
        own = self._own
        return Patience(self._patience_s, lambda: own is not None and own.ended() is not None)

    async def fly(
        self,
        request: str | None = None,
        scene: Scene | str | Path | None = None,
        *,
        sample: str | None = None,
        policy: Policy | None = None,
        vision: Model | None = None,
        settings: MissionSettings | dict[str, Any] | None = None,
        answers: "Sequence[str] | Customer | Callable[[OpenQuestion], str | None]" = (),
        on_event: Listener | None = None,
        out: str | Path = "runs",
    ) -> Flown:
        """Flies one delivery, and returns when it is over, however it ended.

        Args:
            request: The customer's words; a sample has its own.
            scene: A scene document, or the file of one.
            sample: The name of a delivery that ships with the project, instead of a scene.
            policy: How to search: a name, a `SearchPolicy`, or a function of (look, tools); the settings' own
                without it.
            vision: Who sees: a model of the gateway by its name, an `OwnVision`, or a model of one's own that one is
                made of; without it whom the gateway's roles name, which is the embedded model unless a GATEWAY_CONFIG
                says otherwise.
            settings: Every free constant of the mission.
            answers: What the customer says to what the request leaves open: texts given beforehand, or a function
                that is asked.
            on_event: Hears every event as it happens.
            out: The folder in which the record's folder is made.

        Raises:
            BadDelivery: For what can't be flown as it is asked for.
            BadScene: For a file that is no scene.
            Exception: Whatever policy or model raise, after the drone was given back.
        """
        order, own, seeing = asked_for(request, scene, sample=sample, policy=policy, vision=vision, settings=settings)
        if seeing == ORACLE and self._at is None and not self._oracle:
            raise BadDelivery("vision: the oracle needs the simulator's truth: LocalServices(oracle=True)")
        customer = _customer(answers)
        if on_event is not None:
            must_take(on_event, ("event",), "on_event")
        await self._check(seeing, order.settings.parser_model, roles=own is None or own.asks_others)
        run = Run(order, Path(out), listener=on_event)
        _MISSIONS.addHandler(_NOBODY)
        result = await run.fly(self._simulated(own), customer, self.patience)
        if run.problem is not None:
            run.problem.add_note(f"the record of the flight is in {run.record.folder}")
            raise run.problem.with_traceback(authors_part(run.problem))
        return Flown(result, run.record.folder)

    async def __aenter__(self) -> Self:
        """Raises CannotStart where a service can't be started, BadSetting for settings that are none."""
        environment = process_environment()
        try:
            at = self._at or await self._started(environment)
            tokens = Connections.read(environment).tokens
            self._clients = await self._stack.enter_async_context(Services(at, tokens))
        except BaseException:
            await self._stack.aclose()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._clients = self._own = None
        await self._stack.aclose()

    async def _started(self, environment: Mapping[str, str]) -> Addresses:
        ports = free_ports(FLIGHT_SERVICES)
        extra = oracle_settings(ports) if self._oracle else {}
        for name, more in self._settings.items():
            extra[name] = extra.get(name, {}) | more
        logs = self._logs or Path(self._stack.enter_context(TemporaryDirectory(prefix="logisticsvln-")))
        folder = logs / time.strftime("%Y%m%d-%H%M%S")
        self._own = Processes(ports, folder, environment=environment, extra=extra)
        return (await self._stack.enter_async_context(self._own)).addresses

    async def _check(self, seeing: str | None, parsing: str | None, *, roles: bool) -> None:
        """Raises BadDelivery, PortError."""
        try:
            await check_models(self.clients.ports().vision, seeing, parsing, roles=roles)
        except WrongModel as error:
            raise BadDelivery(str(error)) from None

    def _simulated(self, own: OwnVision | None) -> Simulated:
        simulated = self.clients.simulated()
        if own is None:
            return simulated
        ports = dataclasses.replace(simulated.ports, vision=own.before(simulated.ports.vision))
        return simulated._replace(ports=ports)


def _customer(answers: "Sequence[str] | Customer | Callable[[OpenQuestion], str | None]") -> Customer | None:
    if callable(answers):
        return AskedFunction(must_take(answers, ("question",), "answers"))
    if isinstance(answers, Sequence) and not isinstance(answers, str) and all(isinstance(a, str) for a in answers):
        return AnsweredBeforehand(answers) if answers else None
    if isinstance(answers, Sequence) or not hasattr(answers, "answer"):
        raise BadDelivery(f"answers: give a list of texts, one for each question, or a function, not {answers!r}")
    return answers


class AskedFunction:
    """A customer who is a function of the question; it is asked in a thread, since it may wait for a person."""

    patience_s = 86_400.0

    def __init__(self, function: Callable[[OpenQuestion], str | None]) -> None:
        self._function = function

    async def answer(self, number: int, question: OpenQuestion) -> str | None:
        said = await call(self._function, question)
        if said is not None and not isinstance(said, str):
            raise TypeError(f"answers: say a text, or None where nobody answers, not {said!r}")
        return said
