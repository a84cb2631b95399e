"""An orchestrator over real HTTP, with the block world behind it."""

import threading
import time
from collections.abc import Mapping
from pathlib import Path

import httpx
import uvicorn

from contracts.vehicle import VehicleState
from contracts.vlm_gateway import ListedModel
from mission.placement import OwnVehicle
from mission.ports import Ports, ServiceRefused, ServiceUnreachable
from orchestrator.access import EVERYBODY, Access
from orchestrator.app import build_app
from orchestrator.assembly import Orchestrator
from orchestrator.deliveries import Bounds
from orchestrator.delivery import Order
from orchestrator.hangar import FlownWith, Hangar, Member, SignOfLife
from orchestrator.record_files import FolderFiles, RecordFiles
from orchestrator.records import Records
from orchestrator.store.database import Database
from orchestrator.turns import Policy
from orchestrator.webhooks import Webhook
from service_kit.run import server_config
from tests.conftest import free_port
from tests.mission.block_vehicle import BlockVehicle, BlockWorld
from tests.mission.box_world import BlockVision, block_ports

WITHIN_S = 60.0
"""A loaded machine needs time to start, to answer, and to end."""


class BlockSimulators:
    """A fleet of block worlds by name, each with room for so many drones."""

    def __init__(self, room: int, worlds: Mapping[str, BlockWorld], vision: BlockVision | None = None) -> None:
        self._worlds = worlds
        self._vision = vision
        self.members = [Member(name, "simulator", room) for name in worlds]

    async def ask(self, name: str) -> SignOfLife:
        return SignOfLife("block world: nobody answers" if self._worlds[name].away else None)

    def ports(self) -> Ports:
        return block_ports(self._worlds[self.members[0].name], self._vision)

    async def models(self) -> tuple[ListedModel, ...]:
        return (ListedModel(id="geometry", owned_by="scripted", roles=("recognition",)),)

    async def drone(self, name: str, drone: str) -> VehicleState:
        if self._worlds[name].silent:
            raise ServiceUnreachable("block world: nobody answers")
        vehicle = self._worlds[name].vehicles.get(drone)
        if vehicle is None:
            raise ServiceRefused(f"block world: there is no vehicle {drone}", code="not_found", status=404)
        return await vehicle.state()

    def flown_with(self, vehicle: str | None, order: Order) -> FlownWith:
        world = self._worlds[vehicle or self.members[0].name]
        return FlownWith(block_ports(world, self._vision), order.placed(world))


class OneDrone:
    """A hangar with a drone of our own, named hexa, and no simulator."""

    def __init__(self, drone: BlockVehicle) -> None:
        self._drone = drone
        self._world = BlockWorld(drone.block, vehicles={drone.name: drone}, boarded=drone.name)
        self.members = [Member("hexa", "vehicle")]

    async def ask(self, name: str) -> SignOfLife:
        return SignOfLife(None, await self._drone.state(), await self._drone.connect())

    def ports(self) -> Ports:
        return block_ports(self._world, BlockVision(self._world))

    async def models(self) -> tuple[ListedModel, ...]:
        return (ListedModel(id="geometry", owned_by="scripted", roles=("recognition",)),)

    async def drone(self, name: str, drone: str) -> VehicleState:
        return await self._drone.state()

    def flown_with(self, vehicle: str | None, order: Order) -> FlownWith:
        return FlownWith(self.ports(), OwnVehicle(self._drone))


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
        hangar: Hangar | None = None,
        flights: int = 3,
        webhook: Webhook | None = None,
        port: int | None = None,
        files: RecordFiles | None = None,
    ) -> None:
        self._world = world
        orchestrator = Orchestrator(
            Database(database or f"sqlite:///{runs / 'deliveries.sqlite'}"),
            hangar or BlockSimulators(max_live, {"simulator": world}, vision),
            Records(FolderFiles(runs) if files is None else files),
            Policy(patience_s, service_within_s, flights),
            Bounds(waiting=max_waiting),
            poll_s=0.05,
            webhook=webhook,
        )
        port = port or free_port()
        self._server = uvicorn.Server(server_config(build_app(orchestrator, access=access), "127.0.0.1", port, 2))
        self._thread = threading.Thread(target=self._server.run, daemon=True)
        self._thread.start()
        give_up = time.monotonic() + WITHIN_S
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > give_up:
                raise RuntimeError("the orchestrator under test did not start")
            time.sleep(0.005)
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=WITHIN_S)

    def close(self) -> None:
        self._world.hovers = False
        self.client.close()
        self._server.should_exit = True
        self._thread.join(WITHIN_S)
