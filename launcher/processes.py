"""The services as child processes of this machine: started, awaited, and stopped together."""

import asyncio
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from service_kit.addresses import FLIGHT_SERVICES, PORTS, VEHICLE_PORTS, Addresses
from service_kit.client import ServiceClient

HOST = "127.0.0.1"
GATEWAY = "vlm_gateway"
READY_DEADLINE_S = 90.0
QUICK_DRAIN_S = 3
"""What services that one command started for itself may take for answers under way, where the environment does not say:
the command has its own already, or was interrupted."""
STARTED_WITH = {
    "orchestrator": {"GLIBC_TUNABLES": "glibc.malloc.tcache_count=0:glibc.malloc.mmap_threshold=1048576"},
}
"""Beneath the environment, by service; what the C library reads before anything else runs. The orchestrator's two dozen
threads would each come to keep a store of freed pieces of every size (0.2 MB), and the room of a picture that is freed
(11 MB) would stay in one of the heaps."""
END_WITHIN_S = 5.0
"""Beyond the time for answers under way."""
MODULES = {"orchestrator": "orchestrator"} | {
    name: f"services.{name}" for name in PORTS | VEHICLE_PORTS if name != "orchestrator"
}


class CannotStart(Exception):
    """A service could not be started; the message says which, why, and what its log says."""


@dataclass
class Child:
    """One service as a process."""

    name: str
    port: int
    process: subprocess.Popen[bytes]
    log: Path
    file: IO[bytes] = field(repr=False)

    @property
    def url(self) -> str:
        return f"http://{HOST}:{self.port}"

    def tail(self, lines: int = 3) -> str:
        """The end of its log, for a person."""
        self.file.flush()
        text = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return " | ".join(line.strip()[:300] for line in text[-lines:])


class Processes:
    """A group of services. Use as an async context manager: all are stopped at its end, whatever happened."""

    def __init__(
        self,
        ports: Mapping[str, int],
        logs: Path,
        *,
        environment: Mapping[str, str],
        extra: Mapping[str, Mapping[str, str]] | None = None,
        drain_s: int = QUICK_DRAIN_S,
    ) -> None:
        """`ports` names the services to start; `extra` adds settings to single ones. `drain_s`: what answers under way
        may take when all are stopped, unless the environment says (`DRAIN_TIMEOUT_S`)."""
        self._ports = dict(ports)
        self._logs = logs
        self._environment = {"DRAIN_TIMEOUT_S": str(drain_s)} | {k: v for k, v in environment.items() if v}
        self._extra = {name: dict(more) for name, more in (extra or {}).items()}
        self.children: list[Child] = []

    @property
    def addresses(self) -> Addresses:
        """Where the services of this group listen; those that are not part of it at their usual ports."""
        return Addresses(**{n: f"http://{HOST}:{self._ports.get(n, PORTS[n])}" for n in FLIGHT_SERVICES})

    def start(self, first: str | None = None) -> None:
        """Starts all that are not started yet, or the `first` of them alone. Raises CannotStart where a port is taken
        or a log can't be written."""
        started = {child.name for child in self.children}
        ports = {n: port for n, port in self._ports.items() if n not in started and first in (None, n)}
        for name, port in ports.items():
            if not is_free(port):
                raise CannotStart(
                    f"port {port} for {name} is taken: end what listens there (`ss -ltnp | grep {port}`), "
                    "or choose other ports with --base-port"
                )
        try:
            self._logs.mkdir(parents=True, exist_ok=True)
            for name, port in ports.items():
                self.children.append(self._spawn(name, port))
        except OSError as error:
            raise CannotStart(f"the logs can't be written to {self._logs}: {error.strerror}") from None

    async def ready(self) -> None:
        """Returns when all are ready. Raises CannotStart when one ends or takes too long."""
        await asyncio.gather(*(self.ready_child(child) for child in self.children))

    def start_again(self, child: Child) -> Child:
        """Another process in the place of one that has ended. Raises CannotStart."""
        child.file.close()
        try:
            fresh = self._spawn(child.name, child.port)
        except OSError as error:
            raise CannotStart(f"{child.name} can't be started again: {error.strerror}") from None
        self.children[self.children.index(child)] = fresh
        return fresh

    def stop(self) -> None:
        """SIGTERM, first to the orchestrator, that its deliveries still have the others, then to these; SIGKILL to what
        runs on after its time for answers under way."""
        self._stop([child for child in self.children if child.name == "orchestrator"])
        self._stop([child for child in self.children if child.name != "orchestrator"])

    def _stop(self, children: Sequence[Child]) -> None:
        for child in children:
            if child.process.poll() is None:
                child.process.send_signal(signal.SIGTERM)
        drain_s = self._environment["DRAIN_TIMEOUT_S"]
        give_up = time.monotonic() + (float(drain_s) if drain_s.isdecimal() else 0.0) + END_WITHIN_S
        for child in children:
            try:
                child.process.wait(max(0.05, give_up - time.monotonic()))
            except subprocess.TimeoutExpired:
                child.process.kill()
                child.process.wait()
            child.file.close()

    def ended(self) -> Child | None:
        """A child that is not running any more; null while all run."""
        return next((child for child in self.children if child.process.poll() is not None), None)

    def kill(self) -> None:
        """Ends all at once; `stop`, which may be waiting for them, finds them gone."""
        for child in self.children:
            if child.process.poll() is None:
                child.process.kill()

    async def __aenter__(self) -> Self:
        try:
            if GATEWAY in self._ports and self._environment.get("GATEWAY_CONFIG"):
                self.start(GATEWAY)  # what is wrong in somebody's file is told before anything else is started
                await self.ready()
            self.start()
            await self.ready()
        except BaseException:
            self.stop()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _spawn(self, name: str, port: int) -> Child:
        at = self.addresses
        environment = STARTED_WITH.get(name, {}) | self._environment
        environment |= {
            "HOST": HOST,
            "PORT": str(port),
            # a process that is killed takes its services along
            "PARENT_PID": str(os.getpid()),
            "LLM_PARSER_URL": at.llm_parser,
            "VLM_GATEWAY_URL": at.vlm_gateway,
            "DEPTH_ASSIST_URL": at.depth_assist,
            "SIM_URL": at.sim,
        }
        environment |= self._extra.get(name, {})
        log = self._logs / f"{name}.log"
        file = log.open("ab")
        process = subprocess.Popen(
            [sys.executable, "-m", MODULES[name]],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            # a Ctrl-C in the terminal reaches this process only, which then stops its children in order
            start_new_session=True,
        )
        return Child(name, port, process, log, file)

    async def ready_child(self, child: Child) -> None:
        """`ready` for one of them."""
        give_up = time.monotonic() + READY_DEADLINE_S
        async with ServiceClient(child.name, child.url) as client:
            problem: str | None = "not asked yet"
            while problem is not None:
                if child.process.poll() is not None:
                    raise CannotStart(
                        f"{child.name} ended with code {child.process.returncode}: {child.tail() or 'its log is empty'}"
                    )
                if time.monotonic() > give_up:
                    raise CannotStart(f"{child.name} was not ready after {READY_DEADLINE_S:g} s: {problem}")
                problem = await client.ready()
                if problem is not None:
                    await asyncio.sleep(0.05)


def oracle_settings(ports: Mapping[str, int]) -> dict[str, dict[str, str]]:
    """What the `oracle` back end needs: the simulator's truth switched on, and the gateway told where to ask."""
    return {"sim": {"SIM_TRUTH": "on"}, "vlm_gateway": {"ORACLE_SIM_URL": f"http://{HOST}:{ports['sim']}"}}


def free_ports(names: Iterable[str]) -> dict[str, int]:
    """A free port of the loopback for each name."""
    sockets = {name: socket.socket() for name in names}
    try:
        for probe in sockets.values():
            probe.bind((HOST, 0))
        return {name: int(probe.getsockname()[1]) for name, probe in sockets.items()}
    finally:
        for probe in sockets.values():
            probe.close()


def is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return False
    return True


def parse_addresses(text: str) -> Addresses:
    """`name=url,name=url`, or `default` for the usual ports. Raises ValueError."""
    if text == "default":
        return Addresses()
    found = {}
    for part in text.split(","):
        name, _, url = part.strip().partition("=")
        if name not in FLIGHT_SERVICES or not re.match(r"^https?://[^\s/]+", url):
            raise ValueError(
                f"--services: {part.strip()!r} is not name=url with a name of {', '.join(FLIGHT_SERVICES)} "
                "and an http:// or https:// address"
            )
        found[name] = url
    return Addresses(**found)
