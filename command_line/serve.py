"""`logisticsvln serve`: the services as processes of this machine."""

import asyncio
import signal
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from launcher.processes import MODULES, CannotStart, Processes, oracle_settings
from launcher.supervisor import GaveUp, Supervisor
from service_kit.addresses import PORTS
from service_kit.settings import DRAIN_S, process_environment


def serve(
    service: Annotated[str | None, typer.Argument(help=f"One of {', '.join(PORTS)}; all without it.")] = None,
    base_port: Annotated[int, typer.Option(min=1, max=65000, help="The first of five ports.")] = 8100,
    logs: Annotated[Path, typer.Option(help="Where the services' logs go.")] = Path("runs/logs"),
    oracle: Annotated[bool, typer.Option(help="Switch the simulator's truth on, for the oracle back end.")] = False,
) -> None:
    """Run all services as processes of this machine, or one by name, until Ctrl-C. A service that ends is started
    again; one that ends again and again ends the command, which says which one it was."""
    if service is not None and service not in MODULES:
        stop(f"there is no service {service!r}; there are: {', '.join(MODULES)}", WRONG_INPUT)
    ports = {name: base_port + port - PORTS["orchestrator"] for name, port in PORTS.items()}
    chosen = ports if service is None else {service: ports[service]}
    extra = oracle_settings(ports) if oracle else {}
    folder = logs / time.strftime("%Y%m%d-%H%M%S")
    group = Processes(chosen, folder, environment=process_environment(), extra=extra, drain_s=DRAIN_S)
    try:
        asyncio.run(interruptible(_serve(group, chosen, folder)))
    except (CannotStart, GaveUp) as error:
        stop(str(error), FAILED)
    except asyncio.CancelledError:
        stop("interrupted while starting", INTERRUPTED)


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
