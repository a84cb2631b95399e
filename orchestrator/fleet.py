"""The fleet over HTTP: simulators and vehicles, as the fleet file names them."""

from collections.abc import Sequence
from pathlib import Path

from contracts.fleet import FleetFile, FleetMember
from contracts.geometry import Point3
from contracts.sim import Verdict
from contracts.vehicle import VehicleState
from contracts.vlm_gateway import ListedModel, ModelList
from mission.clients import AskedVehicle, Services
from mission.ports import PortError, Ports
from mission.reached import reached
from mission.vehicle import Vehicle
from mission.vehicles.http_vehicle import HttpVehicle
from mission.vehicles.simulator_trial import SimulatorTrial
from orchestrator.delivery import Order
from orchestrator.hangar import FlownWith, Member, SignOfLife
from service_kit.client import ServiceClient
from service_kit.setting_files import read_toml
from service_kit.settings import secret

CALL_DEADLINE_S = 60.0


def read_fleet(path: Path) -> tuple[FleetMember, ...]:
    """The members of a fleet file. Raises BadSetting with one line that says what is wrong."""
    return read_toml("FLEET", path, FleetFile).vehicle


class VehicleAt:
    """A vehicle of our own at an address: it stands ready, and nobody judges."""

    def __init__(self, client: ServiceClient) -> None:
        self._client = client

    @property
    def rig_name(self) -> str | None:
        return None

    @property
    def sensors_name(self) -> str | None:
        return None

    async def begin(self, key: str) -> Vehicle:
        return await HttpVehicle.at(self._client)

    async def resume(self, vehicle: str) -> Vehicle:
        return HttpVehicle(self._client, vehicle)

    async def renderer(self, vehicle: str) -> str | None:
        return None

    async def claim(self, vehicle: str, target: Point3 | None) -> Verdict | None:
        return None


class Fleet:
    """The members of a fleet and the services that all missions ask."""

    def __init__(self, services: Services, members: Sequence[FleetMember], sim_token: str | None) -> None:
        """`sim_token`: of simulators that name no file with a token of their own. Raises BadSetting."""
        self._services = services
        self.members = [Member(member.name, member.kind, member.room) for member in members]
        self._kinds = {member.name: member.kind for member in members}
        self._clients = {member.name: _client(member, sim_token) for member in members}

    async def ask(self, name: str) -> SignOfLife:
        client = self._clients[name]
        if self._kinds[name] == "simulator":
            return SignOfLife(await client.usable())
        vehicle = HttpVehicle(client, name)
        try:
            state, capabilities = await vehicle.state(), await vehicle.connect()
        except PortError as error:
            return SignOfLife(str(error))
        problems = state.health.problems or ("the vehicle says that it is not well",)
        problem = "the vehicle has lost itself" if state.mode == "lost" else None if state.health.ok else problems[0]
        return SignOfLife(problem, state, capabilities)

    def ports(self) -> Ports:
        return self._services.ports()

    async def models(self) -> tuple[ListedModel, ...]:
        return (await reached(self._services.vlm_gateway.call("GET", "/v1/models", ModelList))).data

    async def drone(self, name: str, drone: str) -> VehicleState:
        base = f"/v1/episodes/{drone}" if self._kinds[name] == "simulator" else ""
        return await HttpVehicle(self._clients[name], drone, base).state()

    def flown_with(self, vehicle: str | None, order: Order) -> FlownWith:
        client = self._clients[vehicle or self.members[0].name]
        if order.scene is None:
            return FlownWith(self._services.ports(), VehicleAt(client))
        about = AskedVehicle()
        return FlownWith(self._services.ports(about), order.placed(SimulatorTrial(client, about.board)))

    async def close(self) -> None:
        for client in self._clients.values():
            await client.close()
        await self._services.close()


def _client(member: FleetMember, sim_token: str | None) -> ServiceClient:
    token = sim_token if member.kind == "simulator" else None
    if member.token_file is not None:
        token = secret({"TOKEN_FILE": member.token_file}, "TOKEN")
    service = "sim" if member.kind == "simulator" else member.name
    return ServiceClient(service, member.address, timeout_s=CALL_DEADLINE_S, token=token)
