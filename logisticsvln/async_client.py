"""A running orchestrator, asked from a program with an event loop: `logisticsvln.Client`, awaited."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
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
AsyncAnswering = Callable[[OpenQuestion], Awaitable[str | None]]
"""Is asked what a request leaves open; null where nobody will say anything."""


class AsyncClient:
    """The deliveries and the fleet of an orchestrator: the methods of `Client`, awaited. Use it as an asynchronous
    context manager, or `close` it."""

    def __init__(
        self, url: str | None = None, *, token: str | None = None, timeout_s: float = 30.0, patience_s: float = 60.0
    ) -> None:
        """As `Client`."""
        self._http = httpx.AsyncClient(**calls.connection(url, token, timeout_s))
        self._patience_s = patience_s

    async def ready(self) -> Health:
        """What the orchestrator says of itself, and whether it takes the token (`access`)."""
        return await self._send(calls.get_health())

    async def deliver(
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
        """Orders a delivery, as `Client.deliver` does. Raises ValueError for what can't be one."""
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
        return await self._send(calls.post_delivery(question, key))

    async def delivery(self, delivery: str) -> Delivery:
        """A delivery, by its id, as it stands."""
        return await self._send(calls.get_delivery(delivery))

    async def deliveries(
        self,
        *,
        status: DeliveryStatus | None = None,
        since: datetime | None = None,
        text: str | None = None,
        page: int = 200,
    ) -> AsyncIterator[Delivery]:
        """All deliveries, the newest first; `page` by page as they are looked at."""
        before: str | None = None
        while True:
            found = await self._send(calls.list_deliveries(status, since, text, before, page))
            for delivery in found.deliveries:
                yield delivery
            if found.next is None:
                return
            before = found.next

    async def events(self, delivery: str, after: int = 0) -> AsyncIterator[Event]:
        """The events numbered above `after`, those that were and those to come, until the delivery is done. A stream
        that breaks off goes on where it was."""
        heard = calls.Listening(after, self._patience_s)
        while not heard.over:
            try:
                async with self._http.stream("GET", calls.events_path(delivery), headers=heard.headers()) as response:
                    if response.is_error:
                        calls.check(response.status_code, await response.aread())
                    async for message in EventSource(response).aiter_sse():
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
                await asyncio.sleep(calls.EVENTS_PAUSE_S)

    async def wait(
        self, delivery: str, *, timeout_s: float | None = None, answering: AsyncAnswering | None = None
    ) -> DeliveryResult:
        """The result of a delivery, once it is done, as `Client.wait` gives it. Raises TimeoutError."""
        waiting = calls.Waiting(delivery, timeout_s, self._patience_s)
        while True:
            try:
                now = await self.delivery(delivery)
            except (Unreachable, Refused) as error:
                waiting.missed(error)
            else:
                if (result := waiting.result_of(now)) is not None:
                    return result
                question = waiting.asked(now)
                if question is not None and answering is not None and (text := await answering(question)) is not None:
                    await self.answer(delivery, text)
            await asyncio.sleep(waiting.pause_s())

    async def answer(self, delivery: str, text: str) -> Delivery:
        """The customer's answer to the question of a delivery that is `needs_answer`."""
        return await self._send(calls.post_answer(delivery, text))

    async def cancel(self, delivery: str) -> Delivery:
        """Ends a delivery, whatever its status, and waits until its record is complete."""
        return await self._send(calls.delete_delivery(delivery))

    async def file(self, delivery: str, name: str) -> bytes:
        """A picture that an event names, or `summary.png`, `events.jsonl`, `result.json`, `question.json`."""
        return await self._send(calls.get_file(delivery, name))

    async def vehicles(self) -> tuple[FleetVehicle, ...]:
        """The vehicles of the fleet as they stand."""
        return (await self._send(calls.list_vehicles())).vehicles

    async def samples(self) -> list[str]:
        """Names of the deliveries that ship with the orchestrator."""
        return await self._send(calls.list_samples())

    async def bench(
        self,
        tasks: str,
        *,
        backend: str,
        settings: MissionSettings | None = None,
        limit: int | None = None,
        on_record: "OnRecord | None" = None,
    ) -> "BenchResult":
        """Flies a task set through the orchestrator's fleet, as `Client.bench` does. Raises BadTasks as well."""
        from logisticsvln.bench import RemoteBench

        flown = await asyncio.to_thread(RemoteBench, tasks, backend, settings, limit, on_record)
        for task, question, key in flown.orders():
            flown.ordered(task, await self._send(calls.post_delivery(question, key)))
        for delivery in flown.pending():
            await self.wait(delivery)
            flown.done(await self.delivery(delivery))
        return flown.result()

    async def close(self) -> None:
        """Closes the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def _send(self, call: calls.Call[T]) -> T:
        try:
            response = await self._http.request(**call.request())
        except httpx.RequestError as error:
            raise calls.unreachable(self._http.base_url, error) from None
        return calls.answer_of(call, response)
