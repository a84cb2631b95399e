"""`logisticsvln deliver`: one delivery, shown live."""

import asyncio
import contextlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError
from rich.console import Console

from command_line import mission_options
from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from command_line.delivery_view import LiveView, PlainView, print_result
from command_line.mission_options import SEED_HIGH, mission_settings
from command_line.preflight import CannotFly, check_flight
from command_line.terminal_customer import TerminalCustomer
from contracts.cameras import DEFAULT_RIG
from contracts.errors import first_problem
from contracts.orchestrator import CustomerAnswer, DeliveryQuestion, DeliveryResult
from launcher.processes import CannotStart, parse_addresses
from logisticsvln.async_flights import ORACLE, AsyncLocalServices
from logisticsvln.scenes import read_scene
from mission.customer import AnsweredBeforehand
from orchestrator.delivery import BadDelivery, Order, Run
from service_kit.addresses import Addresses
from service_kit.connections import Connections
from service_kit.settings import BadSetting, process_environment


def deliver(
    request: Annotated[str | None, typer.Argument(help="The customer's words; a sample brings its own.")] = None,
    scene: Annotated[Path | None, typer.Option(help="A scene document (JSON).")] = None,
    sample: Annotated[str | None, typer.Option(help="A shipped delivery; `logisticsvln samples` lists them.")] = None,
    backend: mission_options.BackendOrRoles = None,
    viewpoint: mission_options.Viewpoint = None,
    choice: mission_options.Choice = None,
    floors: mission_options.Floors = "stepwise",
    sightings: mission_options.Sightings = "look-again",
    drift: mission_options.Drift = 0.0,
    parser: mission_options.Parser = None,
    ground_floor: mission_options.GroundFloor = None,
    max_steps: mission_options.MaxSteps = 30,
    rig: mission_options.RigName = DEFAULT_RIG,
    image_size: mission_options.ImageSize = None,
    sensors: mission_options.SensorsName = None,
    seed: Annotated[int, typer.Option(min=0, max=SEED_HIGH)] = 0,
    out: Annotated[Path, typer.Option(help="Where the records go.")] = Path("runs"),
    services: Annotated[
        str | None, typer.Option(help="Running services: name=url,..., or `default`; else own ones are started.")
    ] = None,
    answer: Annotated[
        list[str] | None,
        typer.Option(help="An answer to what the request leaves open, given beforehand; repeat it for more questions."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Fly one delivery and show it live. Ends with code 0 only when it was delivered, or stopped in
    front of a window that nobody judges. What the request leaves open is asked on a terminal; with --json or without a
    terminal only `--answer` answers."""
    try:
        settings = mission_settings(
            viewpoint=viewpoint,
            choice=choice,
            floors=floors,
            sightings=sightings,
            drift=drift,
            parser=parser,
            ground_floor=ground_floor,
            max_steps=max_steps,
            rig=rig,
            image_size=image_size,
            sensors=sensors,
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
        answers = [CustomerAnswer(text=text).text.strip() for text in answer or ()]
        at = parse_addresses(services) if services else None
        Connections.read(process_environment())  # a variable that is wrong is told before anything starts
    except ValidationError as error:
        stop(first_problem(error), WRONG_INPUT)
    except (BadDelivery, BadSetting, ValueError) as error:
        stop(str(error), WRONG_INPUT)
    console = Console(stderr=as_json)
    try:
        run, result = asyncio.run(interruptible(_deliver(order, answers, out, backend, at, console, live=not as_json)))
    except CannotFly as error:
        stop(str(error), WRONG_INPUT)
    except CannotStart as error:
        stop(f"the services could not be started: {error}", FAILED)
    except OSError as error:
        stop(f"the record can't be written to {out}: {error.strerror}", WRONG_INPUT)
    except asyncio.CancelledError:
        stop("interrupted before the flight began", INTERRUPTED)
    folder = str(run.record.folder)
    if as_json:
        told = {"id": run.id, "request": order.request, "scene": order.scene_name, "backend": backend}
        typer.echo(json.dumps(told | result.model_dump(mode="json") | {"folder": folder}, ensure_ascii=False))
    else:
        print_result(console, result, folder)
    if result.outcome == "cancelled":
        raise typer.Exit(INTERRUPTED)
    raise typer.Exit(0 if result.outcome in ("delivered", "stopped_not_judged") else FAILED)


async def _deliver(
    order: Order,
    answers: Sequence[str],
    out: Path,
    backend: str | None,
    at: Addresses | None,
    console: Console,
    *,
    live: bool,
) -> tuple[Run, DeliveryResult]:
    """Starts what is needed, flies, stops what was started. Cancelling it ends the flight, not the record. Raises
    CannotFly, CannotStart, OSError."""
    async with contextlib.AsyncExitStack() as stack:
        terminal = live and console.is_terminal
        view: LiveView | PlainView = LiveView(console, order.request, backend) if terminal else PlainView(console)
        stack.enter_context(view)
        if at is None:
            view.note("starting the services")
        local = AsyncLocalServices(oracle=backend == ORACLE, at=at, logs=out / "logs")
        services = (await stack.enter_async_context(local)).clients
        await check_flight(services, backend, order.settings.parser_model)
        run = Run(order, out, listener=view.show)
        asked = TerminalCustomer(console, view) if terminal and sys.stdin.isatty() else None
        customer = AnsweredBeforehand(answers, asked) if answers or asked else None
        return run, await run.fly(services.simulated(), customer, local.patience)
