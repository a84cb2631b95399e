"""A running orchestrator, asked by a program that waits for each answer; `logisticsvln.AsyncClient` is awaited."""

import time
from collections.abc import Callable, Iterator
from datetime import datetime
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar

import httpx
from httpx_sse import EventSource

from contracts.events import Event
from contracts.fleet import FleetVehicle
from contracts.health import Health
from contracts.orchestrator import (
    Delivery,
    DeliveryResult,
    DeliveryStatus,
    MissionSettings,
    OpenQuestion,
)
from contracts.scene import Scene
from logisticsvln import calls
from service_kit.client import Refused, Unreachable

if TYPE_CHECKING:
    from logisticsvln.bench import BenchResult, OnRecord

T = TypeVar("T")
Answering = Callable[[OpenQuestion], str | None]
"""Is asked what a request leaves open; null where nobody will say anything."""


class Client:
    """The deliveries and the fleet of an orchestrator. Use it as a context manager, or `close` it.

    Every method raises `CallError`: `Unreachable` where nobody answers, `Refused` with status, code and message where
    the orchestrator says no, `Garbled` where something else than an orchestrator of this version answers.
    """

    def __init__(
        self, url: str | None = None, *, token: str | None = None, timeout_s: float = 30.0, patience_s: float = 60.0
    ) -> None:
        """Connects when the first call is made.

        Args:
            url: Where the orchestrator listens; this machine's usual port without it.
            token: What it asks for; `ORCHESTRATOR_TOKEN`, or the file of `ORCHESTRATOR_TOKEN_FILE`, without it.
            timeout_s: Seconds that one call may take.
            patience_s: Seconds that `events` and `wait` go on asking an orchestrator that does not answer, since it may
                be started again.
        """
        self._http = httpx.Client(**calls.connection(url, token, timeout_s))
        self._patience_s = patience_s

    def ready(self) -> Health:
        """What the orchestrator says of itself, and whether it takes the token (`access`)."""
        return self._send(calls.get_health())

    def deliver(
        self,
        request: str | None = None,
        *,
        sample: str | None = None,
        scene: Scene | None = None,
        backend: str | None = None,
        settings: MissionSettings | dict[str, Any] | None = None,
        priority: int = 0,
        not_before: datetime | None = None,
        deadline: datetime | None = None,
        answer_within_s: float | None = None,
        key: str | None = None,
    ) -> Delivery:
        """Orders a delivery, which is then queued; `wait` for it, or follow its `events`.

        Args:
            request: The customer's words; a sample has its own.
            sample: The name of a delivery that ships with the project. Without scene and sample, a vehicle of the
                fleet flies where it stands.
            scene: Where a simulator flies it.
            backend: Who answers about pictures: `embedded`, or an alias of the gateway's configuration.
            settings: Every free constant of the mission.
            priority: 0 to 9; of those that wait the highest is flown first.
            not_before: It does not take off before; a time with its time zone.
            deadline: It ends then, in the air as well.
            answer_within_s: How long the customer's answer to a question is waited for; 0 asks nobody.
            key: The same key again is the same delivery, however often it is ordered.

        Raises:
            ValueError: For what can't be a delivery; nothing is sent.
        """
        question = calls.question_of(
            request=request,
            scene=scene,
            sample=sample,
            backend=backend,
            settings=MissionSettings() if settings is None else settings,
            priority=priority,
            not_before=not_before,
            deadline=deadline,
            answer_within_s=answer_within_s,
        )
        return self._send(calls.post_delivery(question, key))

    def delivery(self, delivery: str) -> Delivery:
        """A delivery, by its id, as it stands."""
        return self._send(calls.get_delivery(delivery))

    def deliveries(
        self,
        *,
        status: DeliveryStatus | None = None,
        since: datetime | None = None,
        text: str | None = None,
        page: int = 200,
    ) -> Iterator[Delivery]:
        """All deliveries, the newest first; `page` by page as they are looked at."""
        before: str | None = None
        while True:
            found = self._send(calls.list_deliveries(status, since, text, before, page))
            yield from found.deliveries
            if found.next is None:
                return
            before = found.next

    def events(self, delivery: str, after: int = 0) -> Iterator[Event]:
        """The events numbered above `after`, those that were and those to come, until the delivery is done. A stream
        that breaks off goes on where it was."""
        heard = calls.Listening(after, self._patience_s)
        while not heard.over:
            try:
                with self._http.stream("GET", calls.events_path(delivery), headers=heard.headers()) as response:
                    if response.is_error:
                        calls.check(response.status_code, response.read())
                    for message in EventSource(response).iter_sse():
                        event = heard.take(message.event, message.data)
                        if event is not None:
                            yield event
                heard.broke_off(Unreachable(calls.SERVICE, "ends the stream of events before the delivery is done"))
            except httpx.RequestError as error:
                heard.broke_off(calls.unreachable(self._http.base_url, error))
            except Refused as error:
                if not calls.is_passing(error):
                    raise
                heard.broke_off(error)
            if not heard.over:
                time.sleep(calls.EVENTS_PAUSE_S)

    def wait(
        self, delivery: str, *, timeout_s: float | None = None, answering: Answering | None = None
    ) -> DeliveryResult:
        """The result of a delivery, once it is done. `answering` is asked what the request leaves open. Raises
        TimeoutError where it is not done within `timeout_s` seconds: it goes on all the same."""
        waiting = calls.Waiting(delivery, timeout_s, self._patience_s)
        while True:
            try:
                now = self.delivery(delivery)
            except (Unreachable, Refused) as error:
                waiting.missed(error)
            else:
                if (result := waiting.result_of(now)) is not None:
                    return result
                question = waiting.asked(now)
                if question is not None and answering is not None and (text := answering(question)) is not None:
                    self.answer(delivery, text)
            time.sleep(waiting.pause_s())

    def answer(self, delivery: str, text: str) -> Delivery:
        """The customer's answer to the question of a delivery that is `needs_answer`."""
        return self._send(calls.post_answer(delivery, text))

    def cancel(self, delivery: str) -> Delivery:
        """Ends a delivery, whatever its status, and waits until its record is complete."""
        return self._send(calls.delete_delivery(delivery))

    def file(self, delivery: str, name: str) -> bytes:
        """A picture that an event names, or `summary.png`, `events.jsonl`, `result.json`, `question.json`."""
        return self._send(calls.get_file(delivery, name))

    def vehicles(self) -> tuple[FleetVehicle, ...]:
        """The vehicles of the fleet as they stand."""
        return self._send(calls.list_vehicles()).vehicles

    def samples(self) -> list[str]:
        """Names of the deliveries that ship with the orchestrator."""
        return self._send(calls.list_samples())

    def bench(
        self,
        tasks: str,
        *,
        backend: str,
        settings: MissionSettings | None = None,
        limit: int | None = None,
        on_record: "OnRecord | None" = None,
    ) -> "BenchResult":
        """Flies a task set (`vld-300`, or a file of tasks) through the orchestrator's fleet and works out its figures
        as `logisticsvln bench` does. `on_record` hears of each task once it is done. Raises BadTasks as well."""
        from logisticsvln.bench import RemoteBench

        flown = RemoteBench(tasks, backend, settings, limit, on_record)
        for task, question, key in flown.orders():
            flown.ordered(task, self._send(calls.post_delivery(question, key)))
        for delivery in flown.pending():
            self.wait(delivery)
            flown.done(self.delivery(delivery))
        return flown.result()

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _send(self, call: calls.Call[T]) -> T:
        try:
            response = self._http.request(**call.request())
        except httpx.RequestError as error:
            raise calls.unreachable(self._http.base_url, error) from None
        return calls.answer_of(call, response)
