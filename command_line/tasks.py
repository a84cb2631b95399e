"""`logisticsvln tasks`: make a set, show one task, count what is in a set."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, bar, stop
from contracts.scene_layout import goal_window
from evaluation.sim_client import SimulatorFault, own_simulator
from evaluation.task_set.absent import without_objects
from evaluation.task_set.generate import MAX_SEED, MAX_TASKS, CannotGenerate, generate, wanted_tasks
from evaluation.task_set.generate_real import generate_real
from evaluation.task_set.mixture import load_mixture, mixture_names
from evaluation.task_set.task_counts import TaskCounts, count_tasks, write_page
from evaluation.task_set.task_files import BadTasks, TaskSet, lines_of, load, packed, read, shipped_set_of
from evaluation.task_set.task_picture import draw_task
from mission.wording import counted

app = typer.Typer(
    help="The task set: make fresh ones, look at single tasks, count what is in them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command(name="generate")
def generate_command(
    seed: Annotated[int, typer.Option(min=0, max=MAX_SEED, help="Decides everything.")],
    count: Annotated[int, typer.Option(min=1, max=MAX_TASKS, help="How many tasks.")],
    out: Annotated[
        Path | None, typer.Option(help="A file (.jsonl, or .jsonl.zst to have it packed); else standard output.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="What the tasks' names begin with.", show_default="the seed")] = None,
    absent: Annotated[
        bool, typer.Option("--absent", help="Take the object away: nothing is there to be found.")
    ] = False,
    profile: Annotated[
        str | None,
        typer.Option(
            help=f"A mixture of sensors, light, weather, wind and starts: {', '.join(mixture_names())}, or a file.",
            show_default="as vld-300: perfect sensors by day",
        ),
    ] = None,
) -> None:
    """Make a fresh set of tasks of the same kind as a shipped one; every one is flown once, with the truth."""
    if out is not None and out.exists():
        stop(f"{out} is there already; name another file", WRONG_INPUT)
    try:
        made = generated(seed, count, Console(stderr=True), name, profile)
        made = without_objects(made) if absent else made
        if out is None:
            sys.stdout.write(lines_of(made.tasks).decode())
        else:
            out.parent.mkdir(parents=True, exist_ok=True)
            part = out.with_name(out.name + ".part")
            part.write_bytes(packed(made.tasks) if out.name.endswith(".zst") else lines_of(made.tasks))
            part.replace(out)
            found = count_tasks(read(lines_of(made.tasks), str(out)))
            typer.echo(f"{out}: {counted(found.tasks, 'task')} at {counted(found.buildings, 'building')}")
    except ValueError as error:
        stop(str(error), WRONG_INPUT)
    except (CannotGenerate, SimulatorFault) as error:
        stop(str(error), FAILED)
    except OSError as error:
        stop(f"{out} can't be written: {error.strerror}", WRONG_INPUT)
    except KeyboardInterrupt:
        stop("interrupted; nothing was written", INTERRUPTED)


@app.command()
def show(
    task: Annotated[str, typer.Argument(help="A task's name, such as vld-300-007.")],
    tasks: Annotated[
        str | None,
        typer.Option(
            help="A shipped set or a file of tasks.", show_default="the shipped set whose name TASK begins with"
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The picture.", show_default="TASK.png")] = None,
) -> None:
    """Draw one task into a PNG: the plan with start, target and shortest way, and the target's window."""
    try:
        found = load(tasks or shipped_set_of(task)).task(task)
    except BadTasks as error:
        stop(str(error), WRONG_INPUT)
    if found.absent:
        stop(f"the object of {found.id} is not there: there is no window to draw a way to", WRONG_INPUT)
    if goal_window(found.scene) is None:
        stop(f"the object of {found.id} stands free: there is no window to draw a way to", WRONG_INPUT)
    path = out or Path(f"{found.id}.png")
    try:
        with own_simulator() as simulator:
            draw_task(found, simulator, path)
    except SimulatorFault as error:
        stop(str(error), FAILED)
    except OSError as error:
        stop(f"{path} can't be written: {error.strerror}", WRONG_INPUT)
    typer.echo(str(path))


@app.command()
def stats(
    tasks: Annotated[str, typer.Argument(help="A shipped set or a file of tasks.")] = "vld-300",
    out: Annotated[Path | None, typer.Option(help="A folder for the page and its charts.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Count what is in a set; with --out also as a page with the paper's four charts (extra `eval`)."""
    try:
        chosen = load(tasks)
    except BadTasks as error:
        stop(str(error), WRONG_INPUT)
    found = count_tasks(chosen)
    if out is not None:
        try:
            for path in write_page(found, out):
                typer.echo(str(path), err=as_json)
        except ImportError:
            stop("the charts need matplotlib: install the extra `eval`", FAILED)
        except OSError as error:
            stop(f"{out} can't be written: {error.strerror}", WRONG_INPUT)
    if as_json:
        typer.echo(found.model_dump_json())
    elif out is None:
        Console().print(counts_table(found), highlight=False)


def generated(seed: int, count: int, console: Console, name: str | None = None, profile: str | None = None) -> TaskSet:
    """A fresh set, with a progress bar. Raises ValueError, CannotGenerate, SimulatorFault."""
    prefix = name or f"s{seed}"
    mixture = None if profile is None else load_mixture(profile)
    wanted = wanted_tasks(seed, count)  # before a simulator is started for what can't be made
    with bar(console) as progress, own_simulator() as simulator:
        job = progress.add_task("making tasks", total=count)
        if mixture is None:
            tasks = generate(wanted, prefix, simulator, lambda: progress.advance(job))
        else:
            tasks = generate_real(wanted, prefix, simulator, mixture, lambda: progress.advance(job))
    return read(lines_of(tasks), f"seed {seed}, count {count}" + (f", {profile}" if profile else ""))


def counts_table(found: TaskCounts) -> Table:
    """A set's counts for a terminal."""
    table = Table(box=None, padding=(0, 2), show_header=False)
    table.add_row(found.name, f"{found.tasks} tasks at {found.buildings} buildings, SHA-256 {found.checksum[:16]}...")
    for title in ("category", "building_kind", "footprint", "floor", "difficulty", "corners", "sky", "decoys"):
        counts: dict[str, int] = getattr(found, title)
        told = "  ".join(f"{name.replace('_', ' ')} {n}" for name, n in counts.items())
        table.add_row(title.replace("_", " "), told)
    return table
