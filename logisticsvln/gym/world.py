"""The simulator that environments fly in: one process for all environments of this process, or one at an address."""

import os
import threading
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import httpx
from pydantic import BaseModel

from contracts.sim import Claim, Episode, EpisodeQuestion, Verdict
from contracts.vehicle import Move, MoveResult, Observation
from launcher.processes import Processes, free_ports
from logisticsvln import calls
from logisticsvln.flights import LoopThread
from service_kit.connections import Connections
from service_kit.settings import process_environment

M = TypeVar("M", bound=BaseModel)
LEASE_S = 3600.0
"""Between two steps an agent may think for so long."""
TIMEOUT_S = 120.0
ROOM = {"SIM_MAX_EPISODES": "500", "SIM_KEPT_SCENES": "32"}


class OwnSimulator:
    """A simulator's process, started when the first environment needs it and stopped when the last is closed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._of = 0
        self._loop = LoopThread()
        self._group: Processes | None = None
        self._logs: TemporaryDirectory[str] | None = None

    def enter(self) -> str:
        """Its address. Raises CannotStart."""
        with self._lock:
            if self._of != os.getpid():  # of the process that forked this one: it is not ours to stop
                self._users, self._of, self._loop, self._group = 0, os.getpid(), LoopThread(), None
            if self._group is None:
                self._start()
            assert self._group is not None
            self._users += 1
            return self._group.addresses.sim

    def leave(self) -> None:
        with self._lock:
            if self._of != os.getpid() or self._group is None:
                return
            self._users -= 1
            if self._users == 0:
                self._group.stop()
                self._loop.stop()
                self._group = None
                if self._logs is not None:
                    self._logs.cleanup()

    def _start(self) -> None:
        self._logs = TemporaryDirectory(prefix="logisticsvln-")
        group = Processes(
            free_ports(("sim",)), Path(self._logs.name), environment=process_environment(), extra={"sim": ROOM}
        )
        self._loop.start()
        try:
            group.start()
            self._loop.run(group.ready())
        except BaseException:
            group.stop()
            self._loop.stop()
            raise
        self._group = group


_OWN = OwnSimulator()


class World:
    """One drone at a time in a simulator. Every call raises CallError."""

    def __init__(self, url: str | None) -> None:
        """`url`: of a simulator that runs; this process's own without it. Raises CannotStart."""
        token = Connections.read(process_environment()).tokens.sim
        self._own = url is None
        self._url = url or _OWN.enter()
        headers = {"authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(base_url=self._url, headers=headers, timeout=TIMEOUT_S, trust_env=False)
        self._episode: str | None = None
        self._moves = 0

    def begin(self, question: EpisodeQuestion) -> Episode:
        """The drone at the start of a scene; the one before is given back."""
        self.end()
        asked = question.model_copy(update={"lease_s": LEASE_S})
        episode = self._call("POST", "/v1/episodes", Episode, asked)
        self._episode, self._moves = episode.id, 0
        return episode

    def observe(self) -> Observation:
        return self._call("GET", f"/v1/episodes/{self._episode}/observation", Observation)

    def move(self, move: Move) -> MoveResult:
        self._moves += 1
        return self._call("PUT", f"/v1/episodes/{self._episode}/moves/{self._moves}", MoveResult, move)

    def claim(self) -> Verdict:
        return self._call("POST", f"/v1/episodes/{self._episode}/claim", Verdict, Claim())

    def end(self) -> None:
        """Gives the drone back, where there is one."""
        episode, self._episode = self._episode, None
        if episode is not None:
            try:
                self._http.delete(f"/v1/episodes/{episode}")
            except httpx.TransportError:
                return  # a simulator that is gone has freed it

    def close(self) -> None:
        """Gives everything back; a second time does nothing."""
        if self._http.is_closed:
            return
        self.end()
        self._http.close()
        if self._own:
            _OWN.leave()

    def _call(self, method: str, path: str, answer: type[M], question: BaseModel | None = None) -> M:
        call = calls.Call(method, path, calls.told(answer), question)
        try:
            response = self._http.request(**call.request())
        except httpx.TransportError as error:
            raise calls.unreachable(self._url, error, "sim") from None
        return calls.answer_of(call, response, "sim")
