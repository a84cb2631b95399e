"""`logisticsvln bench --subtask …`: services of its own, one role asked, its figures printed."""

import asyncio
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from orchestrator.clients import Services
from orchestrator.ports import PortError
from orchestrator.processes import FLIGHT_SERVICES, CannotStart, Processes, free_ports, own_environment
from orchestrator.record import write_whole
from vld.records import RunSettings, Task
from vld.sim_client import SimClient, SimulatorFault
from vld.subtasks.figures import Subtask, SubtaskScores
from vld.subtasks.run import Examiner, Plan
from vld.summary import Rate

FAILED, INTERRUPTED = 1, 130


def ask_alone(
    subtask: Subtask,
    tasks: Sequence[Task],
    settings: RunSettings,
    gateway: Mapping[str, str],
    console: Console,
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    """The command: asks, prints the figures (or one JSON object), and with `out` writes it to `OUT/SUBTASK.json`."""
    mission = settings.mission
    plan = Plan(settings.backend, mission.parser_model, size=mission.image_size, settings=mission)
    try:
        scores = examine(subtask, tasks, plan, console, gateway=gateway)
        told = json.dumps(scores.model_dump(mode="json"), ensure_ascii=False)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            write_whole(out / f"{subtask}.json", told + "\n")
    except (CannotStart, SimulatorFault, PortError) as error:
        _stop(str(error), FAILED)
    except OSError as error:
        _stop(f"{out} can't be written: {error.strerror}", FAILED)
    except KeyboardInterrupt:
        _stop("interrupted before the last question: nothing is told of a part", INTERRUPTED)
    if as_json:
        typer.echo(told)
    else:
        print_scores(Console(), scores)


def examine(
    subtask: Subtask,
    tasks: Sequence[Task],
    plan: Plan,
    console: Console,
    environment: Mapping[str, str] | None = None,
    gateway: Mapping[str, str] | None = None,
) -> SubtaskScores:
    """Starts the services, asks, stops them. `gateway` adds settings to the gateway's.

    Raises orchestrator.processes.CannotStart, vld.sim_client.SimulatorFault, orchestrator.ports.PortError.
    """
    return asyncio.run(_examine(subtask, tasks, plan, console, environment or {}, gateway or {}))


async def _examine(
    subtask: Subtask,
    tasks: Sequence[Task],
    plan: Plan,
    console: Console,
    environment: Mapping[str, str],
    gateway: Mapping[str, str],
) -> SubtaskScores:
    needed = ("vlm_gateway", "llm_parser") if subtask == "parse" else FLIGHT_SERVICES
    ports = free_ports(needed)
    # the truth is what answers are judged by; a model is told it only where it is the oracle
    extra = {"sim": {"SIM_TRUTH": "on"}, "vlm_gateway": dict(gateway)}
    if plan.backend == "oracle" and "sim" in ports:
        extra["vlm_gateway"]["ORACLE_SIM_URL"] = f"http://127.0.0.1:{ports['sim']}"
    with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs, _bar(console) as bar:
        job = bar.add_task(f"{subtask}, {plan.backend}", total=len(tasks))
        mine = own_environment() | dict(environment)
        async with Processes(ports, Path(logs), environment=mine, extra=extra) as group:
            simulator = SimClient(group.addresses.sim) if "sim" in ports else None
            async with Services(group.addresses, gateway_token=mine.get("GATEWAY_TOKEN")) as services:
                examiner = Examiner(plan, services.ports(), simulator)
                return await examiner.run(subtask, tasks, lambda done, _: bar.update(job, completed=done))


def print_scores(console: Console, scores: SubtaskScores) -> None:
    """A subtask's figures on a terminal."""
    skipped = f", {scores.skipped} stops skipped" if scores.skipped else ""
    console.print(
        f"{scores.subtask} by {scores.model or scores.backend}: {scores.questions} questions over {scores.tasks} "
        f"tasks{skipped}, {scores.wall_s:.0f} s",
        highlight=False,
    )
    main = Table(box=None, padding=(0, 2), show_header=False)
    for name, rate in scores.rates.items():
        main.add_row(name.replace("_", " "), *_cells(rate))
    for name, value in scores.values.items():
        main.add_row(name.replace("_", " "), "", "n/a" if value is None else f"{value:.2f}")
    console.print(main, highlight=False)
    for title, group in scores.groups.items():
        table = Table(box=None, padding=(0, 2), show_header=False, title=title, title_justify="left")
        for name, rate in group.items():
            table.add_row(name.replace("_", " ").strip(), *_cells(rate))
        if group:
            console.print(table, highlight=False)
    calls, waits = scores.model_calls, scores.model_calls.latency_s
    console.print(
        f"calls {calls.calls}  from cache {calls.cache_hits}  unreadable {calls.unreadable}  refused {calls.refused}  "
        f"unreachable {calls.unreachable}  "
        + ("" if waits.p50 is None else f"p50 {waits.p50:.3f} s  p95 {waits.p95:.3f} s  p99 {waits.p99:.3f} s"),
        highlight=False,
    )


def _cells(rate: Rate) -> tuple[str, str, str]:
    if rate.rate is None or rate.low is None or rate.high is None:
        return f"{rate.k}/{rate.n}", "n/a", ""
    return f"{rate.k}/{rate.n}", f"{100 * rate.rate:.1f} %", f"[{100 * rate.low:.1f}, {100 * rate.high:.1f}]"


def _bar(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def _stop(message: str, code: int) -> NoReturn:
    typer.echo(f"logisticsvln: {' '.join(message.split())}", err=True)
    raise typer.Exit(code)
