"""What a delivery is flown with, for each vehicle of the fleet: the services that a mission asks, and the placement."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from contracts.fleet import VehicleKind
from contracts.vehicle import VehicleCapabilities, VehicleState
from contracts.vlm_gateway import ListedModel
from mission.placement import Placement
from mission.ports import Ports
from orchestrator.delivery import Order


class FlownWith(NamedTuple):
    """Of one mission."""

    ports: Ports
    placement: Placement


@dataclass(frozen=True)
class Member:
    """A vehicle of the fleet: a simulator with `room` for so many drones, or one drone."""

    name: str
    kind: VehicleKind
    room: int = 1


@dataclass(frozen=True)
class SignOfLife:
    """What a vehicle says when it is asked how it fares: why it can't fly, and what it tells of itself."""

    problem: str | None = None
    state: VehicleState | None = None
    capabilities: VehicleCapabilities | None = None


class Hangar(Protocol):
    """Where missions get their services and vehicles from."""

    @property
    def members(self) -> Sequence[Member]: ...

    async def ask(self, name: str) -> SignOfLife:
        """How that vehicle fares."""
        ...

    def ports(self) -> Ports:
        """The services that all missions ask, without a vehicle."""
        ...

    async def models(self) -> tuple[ListedModel, ...]:
        """The gateway's models. Raises PortError."""
        ...

    async def drone(self, name: str, drone: str) -> VehicleState:
        """How that vehicle's drone of that name stands: a simulator has many. Raises PortError."""
        ...

    def flown_with(self, vehicle: str | None, order: Order) -> FlownWith:
        """For a mission with that vehicle of the fleet, or for one that stands on the ground and has none yet."""
        ...
