"""What a delivery is flown with, for each vehicle of the fleet: the services that a mission asks, and the placement."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from mission.clients import Simulated
from mission.placement import Placement
from mission.ports import Ports
from orchestrator.delivery import Order
from orchestrator.store.vehicles import Kind


class FlownWith(NamedTuple):
    """Of one mission."""

    ports: Ports
    placement: Placement


@dataclass(frozen=True)
class FleetVehicle:
    """A vehicle of the fleet: a simulator with `room` for so many drones, or one drone."""

    name: str
    kind: Kind
    room: int = 1


class Hangar(Protocol):
    """Where missions get their services and vehicles from."""

    @property
    def vehicles(self) -> Sequence[FleetVehicle]: ...

    def kind_for(self, order: Order) -> Kind:
        """Which kind of vehicle flies such a delivery."""
        ...

    def flown_with(self, vehicle: str | None, order: Order) -> FlownWith:
        """For a mission with that vehicle of the fleet, or for one that stands on the ground and has none yet."""
        ...


class OneSimulator:
    """A fleet of one simulator; `services` are made anew for every mission."""

    def __init__(self, services: Callable[[], Simulated], room: int) -> None:
        self._services = services
        self.vehicles = (FleetVehicle("simulator", "simulator", room),)

    def kind_for(self, order: Order) -> Kind:
        return "simulator"

    def flown_with(self, vehicle: str | None, order: Order) -> FlownWith:
        services = self._services()
        return FlownWith(services.ports, order.placed(services.trial))
