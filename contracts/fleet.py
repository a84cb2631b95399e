"""The vehicles that an orchestrator gives deliveries to: as its fleet file names them, and as they stand."""

from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from contracts.base import Name, Wire
from contracts.vehicle import VehicleCapabilities, VehicleState

VehicleKind = Literal["simulator", "vehicle"]
"""A simulator makes a drone for each delivery; a vehicle is one."""
MAX_VEHICLES = 1_000
HttpAddress = Annotated[str, Field(pattern=r"^https?://[^\s/]+\S*$", max_length=500)]


class FleetMember(Wire):
    """A vehicle of the fleet. `address`: of the simulator, or of the vehicle itself (contracts.vehicle). `room`: how
    many drones fly in the simulator at a time. `token_file`: holds the token that it asks for."""

    name: Name
    kind: VehicleKind
    address: HttpAddress
    room: int = Field(default=1, ge=1, le=1_000)
    token_file: str | None = None

    @model_validator(mode="after")
    def _one_drone_flies_one_delivery(self) -> Self:
        if self.kind == "vehicle" and self.room != 1:
            raise ValueError("room: a vehicle flies one delivery at a time; leave it out")
        return self


class FleetFile(Wire):
    """A fleet file, TOML: one `[[vehicle]]` for each."""

    vehicle: tuple[FleetMember, ...] = Field(min_length=1, max_length=MAX_VEHICLES)

    @model_validator(mode="after")
    def _names_are_names(self) -> Self:
        names = [member.name for member in self.vehicle]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"vehicle: {twice[0]} is there twice; give each a name of its own")
        return self


class FleetVehicle(Wire):
    """A vehicle of the fleet as it stands. `deliveries`: those that it flies now; `seen`: when it answered last;
    `problem`: why it is lost. `vehicle` and `capabilities`: as one drone told them itself, null for a simulator."""

    name: Name
    kind: VehicleKind
    room: int
    state: Literal["ready", "flying", "lost"]
    problem: str | None = None
    seen: AwareDatetime | None = None
    deliveries: tuple[Name, ...] = ()
    vehicle: VehicleState | None = None
    capabilities: VehicleCapabilities | None = None


class FleetList(Wire):
    vehicles: tuple[FleetVehicle, ...]
