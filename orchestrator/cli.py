"""`logisticsvln`: serve, deliver, doctor, recording, samples."""

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from contracts.orchestrator import DeliveryQuestion, DeliveryResult
from contracts.scene import Scene
from mission.clients import Addresses, Services
from orchestrator import mission_options, sample_library
from orchestrator.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from orchestrator.delivery import BadDelivery, Order, Run
from orchestrator.doctor import calibrate_with, examine, print_calibration, print_findings
from orchestrator.mission_options import SEED_HIGH, mission_settings
from orchestrator.processes import (
    FLIGHT_SERVICES,
    MODULES,
    PORTS,
    CannotStart,
    Processes,
    free_ports,
    oracle_settings,
    own_environment,
    parse_addresses,
)
from orchestrator.terminal import LiveView, PlainView, print_result
from service_kit.client import CallError, Refused

app = typer.Typer(
    name="logisticsvln",
    help="Vision-language drone delivery to a window: from a sentence to a safe stop.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

MAX_SCENE_BYTES = 4 * 1024 * 1024


@app.command()
def deliver(
    request: Annotated[str | None, typer.Argument(help="The customer's words; a sample brings its own.")] = None,
    scene: Annotated[Path | None, typer.Option(help="A scene document (JSON).")] = None,
    sample: Annotated[str | None, typer.Option(help="A shipped delivery; `logisticsvln samples` lists them.")] = None,
    backend: mission_options.Backend = "embedded",
    viewpoint: mission_options.Viewpoint = None,
    choice: mission_options.Choice = None,
    floors: mission_options.Floors = "stepwise",
    sightings: mission_options.Sightings = "look-again",
    drift: mission_options.Drift = 0.0,
    parser: mission_options.Parser = None,
    max_steps: mission_options.MaxSteps = 30,
    image_size: mission_options.ImageSize = 800,
    seed: Annotated[int, typer.Option(min=0, max=SEED_HIGH)] = 0,
    out: Annotated[Path, typer.Option(help="Where the records go.")] = Path("runs"),
    services: Annotated[
        str | None, typer.Option(help="Running services: name=url,..., or `default`; else own ones are started.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Fly one delivery and show it live. Ends with code 0 only when it was delivered."""
    try:
        settings = mission_settings(
            viewpoint=viewpoint,
            choice=choice,
            floors=floors,
            sightings=sightings,
            drift=drift,
            parser=parser,
            max_steps=max_steps,
            image_size=image_size,
            seed=seed,
        )
        question = DeliveryQuestion(
            request=request,
            scene=read_scene(scene) if scene else None,
            sample=sample,
            backend=backend,
            settings=settings,
        )
        order = Order(question)
        at = parse_addresses(services) if services else None
    except ValidationError as error:
        stop(_first(error), WRONG_INPUT)
    except (BadDelivery, ValueError) as error:
        stop(str(error), WRONG_INPUT)
    console = Console(stderr=as_json)
    try:
        run, result = asyncio.run(interruptible(_deliver(order, out, backend, at, console, live=not as_json)))
    except CannotStart as error:
        stop(f"the services could not be started: {error}", FAILED)
    except OSError as error:
        stop(f"the record can't be written to {out}: {error.strerror}", WRONG_INPUT)
    except asyncio.CancelledError:
        stop("interrupted before the flight began", INTERRUPTED)
    folder = str(run.record.folder)
    if as_json:
        told = {"id": run.id, "request": order.request, "scene": order.scene.name, "backend": backend}
        typer.echo(json.dumps(told | result.model_dump(mode="json") | {"folder": folder}, ensure_ascii=False))
    else:
        print_result(console, result, folder)
    if result.outcome == "cancelled":
        raise typer.Exit(INTERRUPTED)
    raise typer.Exit(0 if result.outcome == "delivered" else FAILED)


async def _deliver(
    order: Order, out: Path, backend: str, at: Addresses | None, console: Console, *, live: bool
) -> tuple[Run, DeliveryResult]:
    """Starts what is needed, flies, stops what was started. Cancelling it ends the flight, not the record."""
    async with contextlib.AsyncExitStack() as stack:
        terminal = live and console.is_terminal
        view: LiveView | PlainView = LiveView(console, order.request, backend) if terminal else PlainView(console)
        stack.enter_context(view)
        if at is None:
            ports = free_ports(FLIGHT_SERVICES)
            view.note("starting the services")
            extra = oracle_settings(ports) if backend == "oracle" else {}
            logs = out / "logs" / time.strftime("%Y%m%d-%H%M%S")
            own = Processes(ports, logs, environment=own_environment(), extra=extra)
            at = (await stack.enter_async_context(own)).addresses
        clients = await stack.enter_async_context(Services(at, gateway_token=own_environment().get("GATEWAY_TOKEN")))
        run = Run(order, out, listener=view.show)
        return run, await run.fly(clients.ports())


@app.command()
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
    group = Processes(chosen, folder, environment=own_environment(), extra=extra)
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


@app.command()
def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    out: Annotated[Path, typer.Option(help="Where records go.")] = Path("runs"),
    model: Annotated[
        str | None,
        typer.Option("--calibrate", help="An alias of the gateway: find out how this vision model writes boxes."),
    ] = None,
    gateway: Annotated[
        str | None, typer.Option(help="A running gateway, for --calibrate; else one is started for it.")
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, max=20, help="Pictures to show, for --calibrate.")] = 3,
) -> None:
    """Look whether this machine has what is needed, and say what to do about what it hasn't."""
    if model is not None:
        _calibrate(model, gateway, rounds, out, as_json=as_json)
    findings = examine(own_environment(), out)
    if as_json:
        typer.echo(json.dumps({"ok": all(f.ok for f in findings), "findings": [f._asdict() for f in findings]}))
    else:
        print_findings(Console(), findings)
    raise typer.Exit(0 if all(f.ok for f in findings) else 1)


def _calibrate(model: str, gateway: str | None, rounds: int, out: Path, *, as_json: bool) -> NoReturn:
    console = Console(stderr=as_json)
    try:
        found = asyncio.run(calibrate_with(model, gateway, rounds, out / "logs", own_environment(), console))
    except CannotStart as error:
        stop(f"the gateway could not be started: {error}", FAILED)
    except Refused as error:
        stop(f"the gateway refuses {model!r}: {error.reason}", WRONG_INPUT if error.status == 422 else FAILED)
    except CallError as error:
        stop(str(error), FAILED)
    if as_json:
        typer.echo(json.dumps({"ok": found.certainty in ("sure", "likely"), **found.model_dump()}))
    else:
        print_calibration(console, found)
    raise typer.Exit(0 if found.certainty in ("sure", "likely") else 1)


@app.command()
def recording(
    action: Annotated[Literal["export", "import", "check"], typer.Argument(help="What to do with the file.")],
    file: Annotated[Path, typer.Argument(help="The recording.")],
) -> None:
    """Put the gateway's recorded answers (CACHE_PATH or REDIS_URL) into one file, or take them out of one."""
    command = [sys.executable, "-m", "services.vlm_gateway.recording", action, str(file)]
    raise typer.Exit(subprocess.run(command, env=own_environment(), check=False).returncode)


@app.command()
def samples() -> None:
    """List the deliveries that ship with the project."""
    table = Table(box=None, padding=(0, 2), header_style="dim")
    for heading in ("sample", "difficulty", "what", "request"):
        table.add_column(heading, overflow="fold")
    for name in sample_library.names():
        one = sample_library.load(name)
        table.add_row(one.name, one.difficulty, one.title, one.request)
    Console().print(table)


def read_scene(path: Path) -> Scene:
    """Raises ValueError with one line that says what is wrong with the file."""
    try:
        if path.stat().st_size > MAX_SCENE_BYTES:
            raise ValueError(f"{path} is larger than {MAX_SCENE_BYTES} bytes: that is no scene document")
        return Scene.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file") from None
    except ValidationError as error:
        raise ValueError(f"{path} is not a scene: {_first(error)}") from None


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    return f"{where}: {first['msg']}" if where else str(first["msg"])


def main() -> None:
    """The command line's entry point."""
    sys.exit(app())


if __name__ == "__main__":
    main()
