"""An orchestrator as a process of its own beside the other services: killed, and started again."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Protocol

import httpx

from contracts.events import Event, read_event
from contracts.orchestrator import Delivery, DeliveryList, DeliveryResult
from service_kit.addresses import Addresses
from service_kit.settings import process_environment
from tests.conftest import free_port
from tests.ending import WITH_THE_TESTS
from tests.system.run_orchestrator import run_orchestrator

START_WITHIN_S = 180.0
"""A machine under load takes its time."""
LISTEN_AGAIN_S = 0.5
"""Many listeners who ask all the time leave an orchestrator that starts no processor."""


class Program(Protocol):
    """A process that was started, as `subprocess` has it."""

    @property
    def pid(self) -> int: ...

    def poll(self) -> int | None: ...

    def wait(self, timeout: float | None = None) -> int: ...


class OrchestratorDoor:
    """What callers see of an orchestrator, whichever process answers there."""

    def __init__(self, url: str) -> None:
        self.url = url
        # one for all listeners, as making a client takes longer than asking; what is kept open dies with the process
        self._client = httpx.Client(
            base_url=url, timeout=30, limits=httpx.Limits(max_connections=None, max_keepalive_connections=0)
        )

    def post(self, **question: object) -> str:
        """The id of a new delivery."""
        answer = self._client.post("/v1/deliveries", json=question)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    def cancel(self, name: str) -> None:
        """Returns when the delivery has ended."""
        answer = self._client.delete(f"/v1/deliveries/{name}")
        assert answer.status_code == 200, answer.text

    def delivery(self, name: str) -> Delivery:
        return Delivery.model_validate(self._client.get(f"/v1/deliveries/{name}").json())

    def deliveries(self) -> list[Delivery]:
        """All of them, page by page."""
        found: list[Delivery] = []
        before: dict[str, str] = {}
        while True:
            answer = self._client.get("/v1/deliveries", params={"limit": 200} | before)
            page = DeliveryList.model_validate(answer.json())
            found += page.deliveries
            if page.next is None:
                return found
            before = {"before": page.next}

    def events(self, name: str, after: int = 0, until: int | None = None) -> list[Event]:
        """The stream's events numbered above `after`, to its end, to number `until`, or to the process's death."""
        found: list[Event] = []
        headers = {"Last-Event-ID": str(after)}
        with contextlib.suppress(httpx.TransportError):
            address = f"/v1/deliveries/{name}/events"
            with self._client.stream("GET", address, headers=headers, timeout=60) as answer:
                for line in answer.iter_lines():
                    if line.startswith("data: {") and line != "data: {}":
                        found.append(read_event(line.removeprefix("data: ")))
                    if until is not None and found and found[-1].number >= until:
                        break
        return found


class OrchestratorProcess(OrchestratorDoor):
    """Always at the same address; `settings` are environment variables."""

    def __init__(self, at: Addresses, runs: Path, settings: Mapping[str, str] | None = None) -> None:
        self.port = free_port()
        super().__init__(f"http://127.0.0.1:{self.port}")
        self._environment = process_environment() | {
            "PORT": str(self.port),
            "RUNS_DIR": str(runs),
            "LLM_PARSER_URL": at.llm_parser,
            "VLM_GATEWAY_URL": at.vlm_gateway,
            "DEPTH_ASSIST_URL": at.depth_assist,
            "SIM_URL": at.sim,
            **(settings or {}),
        }
        self._log = runs.parent / f"orchestrator-{self.port}.log"
        self._process: Program | None = None

    def start(self) -> None:
        """Returns when it answers."""
        self._process = self._spawn()
        give_up = time.monotonic() + START_WITHIN_S
        while True:
            with contextlib.suppress(httpx.TransportError):
                if self._client.get("/healthz").status_code == 200:
                    return
            if self._process.poll() is not None or time.monotonic() > give_up:
                raise RuntimeError(f"the orchestrator did not start: {self.log()[-2000:]}")
            time.sleep(0.05)

    def _spawn(self) -> Program:
        command = [*WITH_THE_TESTS, sys.executable, "-m", "orchestrator"]
        with self._log.open("ab") as log:
            # a session of its own: on a loaded machine each process, not all tests together, gets its share
            return subprocess.Popen(command, env=self._environment, stdout=log, stderr=log, start_new_session=True)

    @property
    def pid(self) -> int:
        """Of the process that runs now."""
        assert self._process is not None
        return self._process.pid

    def kill(self) -> None:
        """SIGKILL, whatever it is doing."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        self._end(signal.SIGTERM)

    def log(self) -> str:
        return self._log.read_text()

    def _end(self, how: signal.Signals) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process.pid, how)
            self._process.wait(30)
            self._process = None


class ForkedOrchestrator(OrchestratorProcess):
    """Forked from a process that has imported everything: a hundred starts for the price of a few."""

    def _spawn(self) -> Program:
        processes = multiprocessing.get_context("forkserver")
        processes.set_forkserver_preload([run_orchestrator.__module__])
        process = processes.Process(target=run_orchestrator, args=(self._environment, self._log))
        process.start()
        return _Forked(process)


class _Forked:
    """A process of `multiprocessing` as `subprocess` would have it."""

    def __init__(self, process: BaseProcess) -> None:
        self._process = process

    @property
    def pid(self) -> int:
        assert self._process.pid is not None
        return self._process.pid

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise TimeoutError(f"the orchestrator has not ended after {timeout} s")
        return self._process.exitcode


def heard(orchestrator: OrchestratorDoor, name: str, after: int = 0, within_s: float = 600.0) -> list[Event]:
    """The events numbered above `after` of a listener who goes on after the last one heard whenever the stream breaks
    off."""
    events: list[Event] = []
    give_up = time.monotonic() + within_s
    while not (events and events[-1].kind == "result") and time.monotonic() < give_up:
        events += orchestrator.events(name, after=events[-1].number if events else after)
        time.sleep(LISTEN_AGAIN_S)
    return events


def without_clocks(result: DeliveryResult | None) -> DeliveryResult:
    """What two flights of the same delivery have in common."""
    assert result is not None
    calls = {role: c.model_copy(update={"seconds": 0.0, "latencies_s": ()}) for role, c in result.model_calls.items()}
    return result.model_copy(update={"timings_s": {}, "model_calls": calls})
