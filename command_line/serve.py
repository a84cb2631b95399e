"""`logisticsvln serve`: the services as processes of this machine."""

import asyncio
import contextlib
import signal
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from launcher.processes import MODULES, CannotStart, Processes, oracle_settings
from service_kit.addresses import PORTS
from service_kit.settings import process_environment


def serve(
    service: Annotated[str | None, typer.Argument(help=f"One of {', '.join(PORTS)}; all without it.")] = None,
    base_port: Annotated[int, typer.Option(min=1, max=65000, help="The first of five ports.")] = 8100,
    logs: Annotated[Path, typer.Option(help="Where the services' logs go.")] = Path("runs/logs"),
    oracle: Annotated[bool, typer.Option(help="Switch the simulator's truth on, for the oracle back end.")] = False,
) -> None:
    """Run all services as processes of this machine, or one by name, until Ctrl-C."""
    if service is not None and service not in MODULES:
        stop(f"there is no service {service!r}; there are: {', '.join(MODULES)}", WRONG_INPUT)
    ports = {name: base_port + port - PORTS["orchestrator"] for name, port in PORTS.items()}
    chosen = ports if service is None else {service: ports[service]}
    extra = oracle_settings(ports) if oracle else {}
    folder = logs / time.strftime("%Y%m%d-%H%M%S")
    group = Processes(chosen, folder, environment=process_environment(), extra=extra)
    try:
        asyncio.run(interruptible(_serve(group, chosen, folder)))
    except CannotStart as error:
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
        while not leaving.is_set():
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(leaving.wait(), 0.5)
            gone = group.ended()
            if gone is not None and not leaving.is_set():
                raise CannotStart(f"{gone.name} ended with code {gone.process.returncode}: {gone.tail()}")
        console.print("stopping", highlight=False)
