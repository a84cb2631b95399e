"""An orchestrator over real HTTP, with the block world behind it."""

import threading
import time
from pathlib import Path

import httpx
import uvicorn

from mission.clients import Simulated
from orchestrator.access import EVERYBODY, Access
from orchestrator.app import build_app
from orchestrator.assembly import Orchestrator
from orchestrator.deliveries import Bounds
from orchestrator.hangar import OneSimulator
from orchestrator.records import Records
from orchestrator.store.database import Database
from orchestrator.turns import Policy
from service_kit.run import server_config
from tests.conftest import free_port
from tests.mission.block_vehicle import BlockWorld
from tests.mission.box_world import BlockVision, block_ports


class Door:
    """A process has one engine: whoever opens a second door closes the first."""

    def __init__(
        self,
        runs: Path,
        world: BlockWorld,
        *,
        vision: BlockVision | None = None,
        access: Access = EVERYBODY,
        max_live: int = 2,
        max_waiting: int = 1000,
        patience_s: float = 600.0,
        service_within_s: float = 0.0,
        database: str | None = None,
    ) -> None:
        orchestrator = Orchestrator(
            Database(database or f"sqlite:///{runs / 'deliveries.sqlite'}"),
            OneSimulator(lambda: Simulated(block_ports(world, vision), world), max_live),
            Records(runs),
            Policy(patience_s, service_within_s, flights=2),
            Bounds(waiting=max_waiting),
            poll_s=0.05,
        )
        port = free_port()
        self._server = uvicorn.Server(server_config(build_app(orchestrator, access=access), "127.0.0.1", port, 2))
        self._thread = threading.Thread(target=self._server.run, daemon=True)
        self._thread.start()
        give_up = time.monotonic() + 20
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > give_up:
                raise RuntimeError("the orchestrator under test did not start")
            time.sleep(0.005)
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=20)

    def close(self) -> None:
        self.client.close()
        self._server.should_exit = True
        self._thread.join(20)
