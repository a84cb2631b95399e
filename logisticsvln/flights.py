"""Deliveries flown from this process: the services run beside it, policy and model are its own Python.

```python
from logisticsvln import LocalServices

with LocalServices() as services:
    flown = services.fly(sample="green-flower-pot")
    print(flown.result.outcome, flown.summary)
```
"""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from contracts.orchestrator import MissionSettings, OpenQuestion
from contracts.scene import Scene
from logisticsvln.async_flights import ORACLE, AsyncLocalServices, Flown, asked_for
from logisticsvln.policies import Policy
from logisticsvln.vision import Model
from mission.customer import Customer
from mission.outages import DEFAULT_WITHIN_S
from orchestrator.delivery import Listener
from service_kit.addresses import Addresses

T = TypeVar("T")
__all__ = ["Flown", "LocalServices", "fly"]


class LocalServices:
    """Simulator, parser, gateway and depth service as processes of this machine, for as long as the context lasts.

    Starting takes some seconds, so fly as much as possible in one context. Works in notebooks too.
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
        self._services = AsyncLocalServices(oracle=oracle, at=at, logs=logs, settings=settings, patience_s=patience_s)
        self._loop = LoopThread()

    def fly(
        self,
        request: str | None = None,
        scene: Scene | str | Path | None = None,
        *,
        sample: str | None = None,
        policy: Policy | None = None,
        vision: Model | None = None,
        settings: MissionSettings | dict[str, Any] | None = None,
        answers: Sequence[str] | Customer | Callable[[OpenQuestion], str | None] = (),
        on_event: Listener | None = None,
        out: str | Path = "runs",
    ) -> Flown:
        """Flies one delivery, and returns when it is over, however it ended.

        Args:
            request: The customer's words; a sample has its own.
            scene: A scene document, or the file of one.
            sample: The name of a delivery that ships with the project, instead of a scene.
            policy: How to search: a name, a `SearchPolicy`, or a function of (look, tools).
            vision: Who sees: a model of the gateway by its name, or one's own object or function
                (`logisticsvln.vision`); without it whom the gateway's roles name, which is the embedded model unless
                a GATEWAY_CONFIG says otherwise.
            settings: Every free constant of the mission.
            answers: What the customer says to what the request leaves open: texts given beforehand, or a function
                that is asked.
            on_event: Hears every event as it happens, in the services' own thread.
            out: The folder in which the record's folder is made.

        Raises:
            BadDelivery: For what can't be flown as it is asked for.
            BadScene: For a file that is no scene.
            Exception: Whatever policy or model raise, after the drone was given back.
        """
        return self._loop.run(
            self._services.fly(
                request,
                scene,
                sample=sample,
                policy=policy,
                vision=vision,
                settings=settings,
                answers=answers,
                on_event=on_event,
                out=out,
            )
        )

    def __enter__(self) -> Self:
        """Raises CannotStart where a service can't be started, BadSetting for settings that are none."""
        self._loop.start()
        try:
            self._loop.run(self._services.__aenter__())
        except BaseException:
            self._loop.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._loop.run(self._services.__aexit__(kind, error, trace))
        finally:
            self._loop.stop()


def fly(
    request: str | None = None,
    scene: Scene | str | Path | None = None,
    *,
    sample: str | None = None,
    policy: Policy | None = None,
    vision: Model | None = None,
    settings: MissionSettings | dict[str, Any] | None = None,
    answers: Sequence[str] | Customer | Callable[[OpenQuestion], str | None] = (),
    on_event: Listener | None = None,
    out: str | Path = "runs",
) -> Flown:
    """Flies one delivery with services that are started for it and stopped after it; `LocalServices.fly` says what the
    arguments are. For more than one flight, start `LocalServices` once."""
    seeing = asked_for(request, scene, sample=sample, policy=policy, vision=vision, settings=settings).seeing
    with LocalServices(oracle=seeing == ORACLE) as services:
        return services.fly(
            request,
            scene,
            sample=sample,
            policy=policy,
            vision=vision,
            settings=settings,
            answers=answers,
            on_event=on_event,
            out=out,
        )


class LoopThread:
    """An event loop in a thread of its own, beside whatever loop the caller has: notebooks run one."""

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Once before `run`."""
        if self._loop is not None:
            raise RuntimeError("it runs already; enter it once at a time")
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="logisticsvln", daemon=True)
        self._thread.start()

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Its result. An interrupt here cancels it, and is raised once it has put itself in order."""
        if self._loop is None:
            work.close()
            raise RuntimeError("the services run inside `with` only")
        ended = threading.Event()

        async def watched() -> T:
            try:
                return await work
            finally:
                ended.set()

        future = asyncio.run_coroutine_threadsafe(watched(), self._loop)
        try:
            return future.result()
        except KeyboardInterrupt:
            future.cancel()
            ended.wait()
            raise

    def stop(self) -> None:
        """Ends the thread."""
        loop, thread = self._loop, self._thread
        self._loop = self._thread = None
        if loop is None or thread is None:
            return
        asyncio.run_coroutine_threadsafe(_put_in_order(), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _put_in_order() -> None:
    """Cancels what is left, such as the renewing of a lease."""
    others = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)
    await asyncio.get_running_loop().shutdown_asyncgens()
    await asyncio.get_running_loop().shutdown_default_executor()
