"""`logisticsvln serve`: the services as processes of this machine."""

import asyncio
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from launcher.other_vehicles import OtherVehicle, of_carla, of_mavlink
from launcher.processes import MODULES, CannotStart, Processes, oracle_settings
from launcher.supervisor import GaveUp, Supervisor
from service_kit.addresses import PORTS, VEHICLE_PORTS
from service_kit.settings import DRAIN_S, BadSetting, process_environment

AUTOPILOT = "udpin://127.0.0.1:14540"
"""Where PX4's simulators send to."""
CARLA = "127.0.0.1:2000"
_SERVED_BY = {"mavlink": "mavlink_vehicle", "carla": "carla_world"}


Vehicle = Literal["simulator", "mavlink", "carla"]


def serve(
    service: Annotated[str | None, typer.Argument(help=f"One of {', '.join(MODULES)}; all without it.")] = None,
    base_port: Annotated[int, typer.Option(min=1, max=65000, help="The first of the ports.")] = 8100,
    logs: Annotated[Path, typer.Option(help="Where the services' logs go.")] = Path("runs/logs"),
    oracle: Annotated[bool, typer.Option(help="Switch the simulator's truth on, for the oracle back end.")] = False,
    vehicle: Annotated[Vehicle, typer.Option(help="Which vehicle flies the deliveries.")] = "simulator",
    autopilot: Annotated[str, typer.Option(help="Of mavlink: where the autopilot is heard.")] = AUTOPILOT,
    cameras: Annotated[
        Path | None, typer.Option(help="Of mavlink: a TOML file of real cameras; without it the simulator draws.")
    ] = None,
    carla: Annotated[str, typer.Option(help="Of carla: host:port of its server.")] = CARLA,
) -> None:
    """Run all services as processes of this machine, or one by name, until Ctrl-C. A service that ends is started
    again; one that ends again and again ends the command, which says which one it was."""
    if service is not None and service not in MODULES:
        stop(f"there is no service {service!r}; there are: {', '.join(MODULES)}", WRONG_INPUT)
    environment = process_environment()
    folder = logs / time.strftime("%Y%m%d-%H%M%S")
    ports = {name: base_port + port - PORTS["orchestrator"] for name, port in (PORTS | VEHICLE_PORTS).items()}
    extra = oracle_settings(ports) if oracle else {}
    others = {"mavlink_vehicle": of_mavlink(autopilot, cameras), "carla_world": of_carla(carla)}
    other = others.get(service or _SERVED_BY.get(vehicle, ""))
    if other is not None:
        extra |= {other.service: dict(other.settings)}
    chosen = {name: ports[name] for name in (PORTS if service is None else (service,))}
    if other is not None and service is None:
        chosen[other.service] = ports[other.service]
        extra["orchestrator"] = {"FLEET": str(_fleet_of(other, folder, ports, environment))}
    group = Processes(chosen, folder, environment=environment, extra=extra, drain_s=DRAIN_S)
    try:
        asyncio.run(interruptible(_serve(group, chosen, folder)))
    except (CannotStart, GaveUp) as error:
        stop(str(error), FAILED)
    except asyncio.CancelledError:
        stop("interrupted while starting", INTERRUPTED)


def _fleet_of(other: OtherVehicle, folder: Path, ports: Mapping[str, int], environment: Mapping[str, str]) -> Path:
    """The file of a fleet with that vehicle."""
    if environment.get("FLEET"):
        stop("FLEET names a fleet already: name the vehicle there, or leave --vehicle out", WRONG_INPUT)
    try:
        return other.fleet_file(folder, ports, environment)
    except BadSetting as error:
        stop(str(error), WRONG_INPUT)
    except OSError as error:
        stop(f"the fleet can't be written to {folder}: {error.strerror}", FAILED)


async def _serve(group: Processes, ports: dict[str, int], folder: Path) -> None:
    console = Console()
    leaving = asyncio.Event()
    console.print(f"starting {', '.join(ports)} (logs in {folder})", highlight=False)
    async with group:
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, leaving.set)
        table = Table.grid(padding=(0, 2))
        for child in group.children:
            table.add_row(child.name, child.url, str(child.log))
        console.print(table)
        if "orchestrator" in ports:
            console.print(f"ready: the viewer is at http://127.0.0.1:{ports['orchestrator']}/", highlight=False)
        else:
            console.print("ready", highlight=False)
        supervisor = Supervisor(group, lambda said: _tell(console, said))
        kept, told = asyncio.create_task(supervisor.run()), asyncio.create_task(leaving.wait())
        await asyncio.wait({kept, told}, return_when=asyncio.FIRST_COMPLETED)
        told.cancel()
        if kept.done():
            kept.result()
        kept.cancel()
        console.print("stopping: answers under way may end; Ctrl-C again stops at once", highlight=False)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: group.kill())


def _tell(console: Console, said: str) -> None:
    console.print(f"{time.strftime('%H:%M:%S')} {said}", highlight=False, markup=False)
