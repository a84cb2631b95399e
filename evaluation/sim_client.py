"""The simulator over HTTP, for the tools that build and judge scenes; nothing of the simulator is imported."""

import asyncio
import tempfile
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from contracts.cameras import Rig, default_rig
from contracts.scene import Scene
from contracts.sim import Catalogue, Claim, Episode, EpisodeQuestion, Truth, TruthQuestion, Verdict
from contracts.vehicle import Move, MoveResult, Observation
from launcher.processes import CannotStart, Processes, free_ports
from service_kit.connections import Connections
from service_kit.settings import process_environment

M = TypeVar("M", bound=BaseModel)
_TIMEOUT_S = 120.0
_LEASE_S = 900.0
"""A tool may think longer about one picture than a mission does, and renews nothing."""


class SimulatorFault(RuntimeError):
    """The simulator refused, or can't be reached; the message says what it said."""


class SimClient:
    """One simulator at `url`, e.g. `http://127.0.0.1:8104`. Every call raises SimulatorFault."""

    def __init__(self, url: str, token: str | None = None) -> None:
        self.url = url.rstrip("/")
        self._headers = {"Content-Type": "application/json"}
        if token:
            self._headers["Authorization"] = f"Bearer {token}"

    def catalogue(self) -> Catalogue:
        return self._call("GET", "/v1/catalogue", None, Catalogue)

    def open(self, scene: Scene, rig: Rig | None = None) -> Episode:
        """A drone at the scene's start, with the default rig where no other is wanted."""
        question = EpisodeQuestion(scene=scene, rig=rig or default_rig(), lease_s=_LEASE_S)
        return self._call("POST", "/v1/episodes", question, Episode)

    def observe(self, episode: str, cameras: Sequence[str], depth: bool = False) -> Observation:
        path = f"/v1/episodes/{episode}/observation?cameras={','.join(cameras)}&depth={str(depth).lower()}"
        return self._call("GET", path, None, Observation)

    def truth(self, episode: str, question: TruthQuestion) -> Truth:
        return self._call("POST", f"/v1/episodes/{episode}/truth", question, Truth)

    def move(self, episode: str, number: int, move: Move) -> MoveResult:
        return self._call("PUT", f"/v1/episodes/{episode}/moves/{number}", move, MoveResult)

    def claim(self, episode: str, claim: Claim) -> Verdict:
        return self._call("POST", f"/v1/episodes/{episode}/claim", claim, Verdict)

    def close(self, episode: str) -> None:
        self._send("DELETE", f"/v1/episodes/{episode}", None)

    def _call(self, method: str, path: str, question: BaseModel | None, answer: type[M]) -> M:
        return answer.model_validate_json(self._send(method, path, question))

    def _send(self, method: str, path: str, question: BaseModel | None) -> bytes:
        data = None if question is None else question.model_dump_json().encode()
        request = urllib.request.Request(self.url + path, data=data, method=method, headers=self._headers)
        try:
            with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as response:
                return bytes(response.read())
        except urllib.error.HTTPError as error:
            said = error.read(2000).decode(errors="replace")
            raise SimulatorFault(f"{method} {path} answered {error.code}: {said}") from None
        except OSError as error:
            raise SimulatorFault(f"the simulator at {self.url} can't be reached: {error}") from None


@contextmanager
def own_simulator() -> Iterator[SimClient]:
    """A simulator of one's own on a free port that tells the truth, ended with the block, or with this process. Not
    from within a running event loop. Raises SimulatorFault, and BadSetting where the environment's token can't be
    read."""
    environment = process_environment()
    token = Connections.read(environment).tokens.sim
    with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs:
        truthful = {"sim": {"SIM_TRUTH": "on"}}
        group = Processes(free_ports(("sim",)), Path(logs), environment=environment, extra=truthful)
        try:
            _started(group)
            yield SimClient(group.addresses.sim, token)
        finally:
            group.stop()


def _started(group: Processes) -> None:
    try:
        group.start()
        asyncio.run(group.ready())
    except CannotStart as error:
        raise SimulatorFault(f"the simulator did not start: {error}") from None
