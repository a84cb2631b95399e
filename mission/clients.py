"""The ports over HTTP: one class a service, one line a route, a deadline on every call."""

from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple, Self, TypeVar

from pydantic import BaseModel

from contracts.depth_assist import (
    ApproachAnswer,
    ApproachQuestion,
    ExploreAnswer,
    ExploreQuestion,
    SafeDistancesAnswer,
    SafeDistancesQuestion,
    ViewpointAnswer,
    ViewpointQuestion,
)
from contracts.llm_parser import ParseAnswer, ParseQuestion
from contracts.vlm_gateway import (
    ORACLE_VEHICLE_HEADER,
    BuildingBoxAnswer,
    BuildingBoxQuestion,
    ChooseDirectionAnswer,
    ChooseDirectionQuestion,
    FindObjectAnswer,
    FindObjectQuestion,
    FloorCountAnswer,
    FloorCountQuestion,
    PreflightAnswer,
    PreflightQuestion,
)
from mission.ports import Ports
from mission.reached import reached
from mission.vehicle import Trial
from mission.vehicles.simulator_trial import SimulatorTrial
from service_kit.addresses import Addresses
from service_kit.client import ServiceClient
from service_kit.connections import NO_TOKENS, Tokens

M = TypeVar("M", bound=BaseModel)

MODEL_DEADLINE_S = 180.0
WORLD_DEADLINE_S = 60.0
DEPTH_DEADLINE_S = 30.0


class HttpParser:
    def __init__(self, client: ServiceClient) -> None:
        self._client = client

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        return await reached(self._client.call("POST", "/v1/parse", ParseAnswer, question))


@dataclass
class AskedVehicle:
    """The simulator's vehicle whose pictures a mission asks about; the gateway's oracle needs its name."""

    name: str | None = None

    def board(self, name: str) -> None:
        """From now on it is this one."""
        self.name = name

    @property
    def headers(self) -> dict[str, str]:
        return {ORACLE_VEHICLE_HEADER: self.name} if self.name is not None else {}


class HttpVision:
    """`about`: the vehicle, where it is a simulator's."""

    def __init__(self, client: ServiceClient, about: AskedVehicle | None = None) -> None:
        self._client = client
        self._about = about or AskedVehicle()

    async def preflight(self, question: PreflightQuestion) -> PreflightAnswer:
        return await self._ask("/v1/preflight", PreflightAnswer, question)

    async def floor_count(self, question: FloorCountQuestion) -> FloorCountAnswer:
        return await self._ask("/v1/floor-count", FloorCountAnswer, question)

    async def building_box(self, question: BuildingBoxQuestion) -> BuildingBoxAnswer:
        return await self._ask("/v1/building-box", BuildingBoxAnswer, question)

    async def find_object(self, question: FindObjectQuestion) -> FindObjectAnswer:
        return await self._ask("/v1/find-object", FindObjectAnswer, question)

    async def choose_direction(self, question: ChooseDirectionQuestion) -> ChooseDirectionAnswer:
        return await self._ask("/v1/choose-direction", ChooseDirectionAnswer, question)

    async def _ask(self, path: str, answer: type[M], question: BaseModel) -> M:
        return await reached(self._client.call("POST", path, answer, question, headers=self._about.headers))


class HttpDepthAssist:
    def __init__(self, client: ServiceClient) -> None:
        self._client = client

    async def viewpoint(self, question: ViewpointQuestion) -> ViewpointAnswer:
        return await reached(self._client.call("POST", "/v1/viewpoint", ViewpointAnswer, question))

    async def safe_distances(self, question: SafeDistancesQuestion) -> SafeDistancesAnswer:
        return await reached(self._client.call("POST", "/v1/safe-distances", SafeDistancesAnswer, question))

    async def approach(self, question: ApproachQuestion) -> ApproachAnswer:
        return await reached(self._client.call("POST", "/v1/approach", ApproachAnswer, question))

    async def explore(self, question: ExploreQuestion) -> ExploreAnswer:
        return await reached(self._client.call("POST", "/v1/explore", ExploreAnswer, question))


class Simulated(NamedTuple):
    """What one mission in the simulator is flown with."""

    ports: Ports
    trial: Trial


class Services:
    """The HTTP clients of all four services. Use as an async context manager."""

    def __init__(self, at: Addresses, tokens: Tokens = NO_TOKENS) -> None:
        def client(service: str, url: str, timeout_s: float, token: str | None) -> ServiceClient:
            return ServiceClient(service, url, timeout_s=timeout_s, token=token)

        self.llm_parser = client("llm_parser", at.llm_parser, MODEL_DEADLINE_S, tokens.llm_parser)
        self.vlm_gateway = client("vlm_gateway", at.vlm_gateway, MODEL_DEADLINE_S, tokens.vlm_gateway)
        self.depth_assist = client("depth_assist", at.depth_assist, DEPTH_DEADLINE_S, tokens.depth_assist)
        self.sim = client("sim", at.sim, WORLD_DEADLINE_S, tokens.sim)

    @property
    def all(self) -> tuple[ServiceClient, ...]:
        return (self.llm_parser, self.vlm_gateway, self.depth_assist, self.sim)

    def ports(self, about: AskedVehicle | None = None) -> Ports:
        """The services that a mission asks, about pictures of a simulator's vehicle where it is one."""
        return Ports(
            parser=HttpParser(self.llm_parser),
            vision=HttpVision(self.vlm_gateway, about),
            depth=HttpDepthAssist(self.depth_assist),
        )

    def trial(self) -> Trial:
        """The simulator that judges."""
        return SimulatorTrial(self.sim)

    def simulated(self) -> Simulated:
        """Ports and trial for one mission: the gateway is told which of the simulator's vehicles it is asked about."""
        about = AskedVehicle()
        return Simulated(self.ports(about), SimulatorTrial(self.sim, about.board))

    async def close(self) -> None:
        for client in self.all:
            await client.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()
