"""`logisticsvln vehicles`: the fleet of a running orchestrator."""

import asyncio
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, WRONG_INPUT, stop
from contracts.fleet import FleetList, FleetVehicle
from service_kit.addresses import PORTS
from service_kit.client import CallError, ServiceClient
from service_kit.connections import TOKEN_VARIABLES
from service_kit.settings import BadSetting, process_environment, secret

USUAL = f"http://127.0.0.1:{PORTS['orchestrator']}"


def vehicles(
    at: Annotated[str, typer.Option(help="Where the orchestrator listens.")] = USUAL,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """List the vehicles of a running orchestrator's fleet: what each can do, where it is, what it flies."""
    if not at.startswith(("http://", "https://")):
        stop(f"--at {at}: give an http:// or https:// address", WRONG_INPUT)
    try:
        token = secret(process_environment(), TOKEN_VARIABLES["orchestrator"])
        found = asyncio.run(_fleet(at.rstrip("/"), token))
    except BadSetting as error:
        stop(str(error), WRONG_INPUT)
    except CallError as error:
        stop(str(error), FAILED)
    if as_json:
        typer.echo(found.model_dump_json())
    else:
        Console().print(_table(found))


async def _fleet(at: str, token: str | None) -> FleetList:
    async with ServiceClient("orchestrator", at, token=token) as client:
        return await client.call("GET", "/v1/vehicles", FleetList)


def _table(found: FleetList) -> Table:
    table = Table(box=None, padding=(0, 2), header_style="dim")
    for heading in ("vehicle", "kind", "state", "flies", "where", "battery", "can do"):
        table.add_column(heading, overflow="fold")
    for one in found.vehicles:
        table.add_row(one.name, one.kind, one.problem or one.state, _flies(one), *_of_itself(one))
    return table


def _flies(one: FleetVehicle) -> str:
    share = f"{len(one.deliveries)} of {one.room}" if one.kind == "simulator" else ""
    return " ".join((share, *one.deliveries)).strip() or "nothing"


def _of_itself(one: FleetVehicle) -> tuple[str, str, str]:
    """Where it is, its battery, and what it can do, as far as it tells."""
    if one.vehicle is None or one.capabilities is None:
        return "", "", ""
    pose, charge, can = one.vehicle.pose, one.vehicle.battery.remaining, one.capabilities
    where = f"{pose.x:.1f}, {pose.y:.1f}, {pose.z:.1f} m, {one.vehicle.mode}"
    cameras = ", ".join(camera.name for camera in can.cameras)
    abilities = f"{can.kind}: {cameras}; {can.max_speed_m_s:g} m/s"
    return where, "" if charge is None else f"{100 * charge:.0f} %", abilities
