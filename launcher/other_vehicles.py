"""What `serve --vehicle` starts beside the services: another vehicle's service, and the fleet that names it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from contracts.fleet import FleetMember, VehicleKind
from launcher.processes import HOST
from service_kit.connections import TOKEN_VARIABLES
from service_kit.settings import BadSetting


class OtherVehicle(NamedTuple):
    """`service` serves the vehicle, with `settings` of its own. `kind`: `simulator` where it brings a scene and a judge
    with it, `vehicle` where it is one drone, at `path` of the service's address."""

    service: str
    settings: Mapping[str, str]
    kind: VehicleKind
    path: str = ""

    def fleet_file(self, folder: Path, ports: Mapping[str, int], environment: Mapping[str, str]) -> Path:
        """A fleet file in `folder` with this vehicle, and the simulator for deliveries with a scene where it takes
        none; the services listen at `ports`. Raises OSError, and BadSetting for a token that is in no file."""
        variable = TOKEN_VARIABLES[self.service]
        if environment.get(variable):
            raise BadSetting(f"{variable}: a fleet names tokens by their files; set {variable}_FILE instead")
        token_file = environment.get(f"{variable}_FILE")
        members = [
            FleetMember(
                name=self.service,
                kind=self.kind,
                address=f"http://{HOST}:{ports[self.service]}{self.path}",
                token_file=token_file,
            )
        ]
        if self.kind == "vehicle":
            members.append(FleetMember(name="simulator", kind="simulator", address=f"http://{HOST}:{ports['sim']}"))
        folder.mkdir(parents=True, exist_ok=True)
        fleet = folder / "fleet.toml"
        fleet.write_text("\n".join(map(_table, members)), encoding="utf-8")
        return fleet.resolve()


def _table(member: FleetMember) -> str:
    fields = member.model_dump(mode="json", exclude_none=True)
    # what JSON writes of strings and whole numbers is TOML too
    return "\n".join(["[[vehicle]]", *(f"{name} = {json.dumps(value)}" for name, value in fields.items()), ""])


def of_mavlink(autopilot: str, cameras: Path | None) -> OtherVehicle:
    """A drone behind an autopilot. `autopilot`: MAVSDK's address of it. Without a file of real `cameras` the simulator
    draws what they would see, and judges."""
    settings = {"AUTOPILOT": autopilot}
    if cameras is None:
        return OtherVehicle("mavlink_vehicle", settings, "simulator")
    return OtherVehicle("mavlink_vehicle", settings | {"CAMERAS": str(cameras.resolve())}, "vehicle", "/v1/vehicle")


def of_carla(server: str) -> OtherVehicle:
    """A drone in CARLA, whose `server` listens at host:port."""
    return OtherVehicle("carla_world", {"CARLA": server}, "simulator")
