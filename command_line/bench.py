"""`logisticsvln bench`: one arm over a task set."""

import asyncio
import json
import os
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Literal

import typer
from pydantic import ValidationError
from rich.console import Console
from sqlalchemy.exc import SQLAlchemyError

from command_line import mission_options
from command_line.bench_merge import merge
from command_line.bench_progress import LiveProgress, PlainProgress
from command_line.bench_setup import (
    DATABASE_VARIABLE,
    chosen_tasks,
    gateway_settings,
    model_name,
    one_core_each,
    open_database,
    read_shard,
    share_of,
    stop_where_given,
    stop_where_queued,
    versions,
)
from command_line.bench_summary import print_summary
from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from command_line.labelled_requests import score_requests
from command_line.mission_options import SEED_HIGH, mission_settings
from command_line.preflight import stop_without_models
from command_line.subtask import ask_alone
from contracts.cameras import DEFAULT_RIG
from contracts.errors import first_problem
from evaluation.bench.customer import Asked
from evaluation.bench.episode_keeping import Kept
from evaluation.bench.episode_queue import EpisodeQueue
from evaluation.bench.folder import BadFolder, RunFolder
from evaluation.bench.queue_database import program_of
from evaluation.bench.run import CannotRun, Run
from evaluation.bench.run_settings import RunSettings
from evaluation.bench.sensor_faults import SensorFaults
from evaluation.bench.worker import Job
from evaluation.metrics.summary import Summary
from evaluation.sim_client import SimulatorFault
from evaluation.spread import spread
from evaluation.subtasks.figures import Subtask
from evaluation.task_set.absent import without_objects
from evaluation.task_set.generate import CannotGenerate
from service_kit.settings import process_environment

MAX_WORKERS = 64


app = typer.Typer(
    invoke_without_command=True,
    subcommand_metavar="[merge RUN...]",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(merge)


@app.callback()
def bench(
    context: typer.Context,
    tasks: Annotated[str | None, typer.Option(help="A shipped set or a file of tasks.", show_default="vld-300")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Fly a fresh set of this seed instead.")] = None,
    count: Annotated[int | None, typer.Option(min=1, help="How many tasks the fresh set has.")] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="Only the first tasks, evenly over the set.")] = None,
    absent: Annotated[
        bool, typer.Option("--absent", help="Take the objects away: the search should find none.")
    ] = False,
    backend: mission_options.Backend = "embedded",
    viewpoint: mission_options.Viewpoint = None,
    choice: mission_options.Choice = None,
    floors: mission_options.Floors = "stepwise",
    sightings: mission_options.Sightings = "look-again",
    drift: mission_options.Drift = 0.0,
    parser: mission_options.Parser = None,
    max_steps: mission_options.MaxSteps = 30,
    rig: mission_options.RigName = DEFAULT_RIG,
    image_size: mission_options.ImageSize = None,
    sensors: mission_options.SensorsName = None,
    mission_seed: Annotated[int, typer.Option(min=0, max=SEED_HIGH, help="Of the random viewpoint policy.")] = 0,
    miss_rate: Annotated[float, typer.Option(min=0, max=1, help="Oracle: a view with the object says nothing.")] = 0.0,
    false_claim_rate: Annotated[float, typer.Option(min=0, max=1, help="Oracle: a look claims another thing.")] = 0.0,
    floor_miscount_rate: Annotated[float, typer.Option(min=0, max=1, help="Oracle: a count is off by one.")] = 0.0,
    box_jitter: Annotated[float, typer.Option(min=0, max=1, help="Oracle: edges off by this share (sigma).")] = 0.0,
    refusal_rate: Annotated[float, typer.Option(min=0, max=1, help="Oracle: an answer is declined.")] = 0.0,
    noise_seed: Annotated[int, typer.Option(min=0, max=SEED_HIGH, help="Oracle: of all of these.")] = 0,
    fault_rate: mission_options.FaultRate = 0.0,
    fault_seed: mission_options.FaultSeed = 0,
    workers: Annotated[
        int | None, typer.Option(min=1, max=MAX_WORKERS, help="Processes that fly.", show_default="one a core")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The run's folder; one that was begun is completed.")] = None,
    customer: Annotated[
        Asked, typer.Option(help="Who answers a mission's questions: nobody, or whoever the task's request is from.")
    ] = "nobody",
    pictures: Annotated[Kept, typer.Option(help="Whose pictures to keep.")] = "none",
    trajectories: Annotated[
        bool,
        typer.Option("--trajectories", help="Keep all pictures, depth and moves, for `logisticsvln export`."),
    ] = False,
    cache: Annotated[
        Literal["on", "off", "replay"] | None,
        typer.Option(help="Answers of models.", show_default="off for embedded and oracle, else on"),
    ] = None,
    recording: Annotated[Path | None, typer.Option(help="The file in which answers are kept, for --cache.")] = None,
    episode_s: Annotated[float, typer.Option(min=1, max=86_400, help="An episode takes no longer.")] = 900.0,
    shard: Annotated[
        str | None,
        typer.Option(help="Fly only share i of n, counted from 1: i/n. `bench merge` puts all n folders together."),
    ] = None,
    database: Annotated[
        str | None,
        typer.Option(
            envvar=DATABASE_VARIABLE,
            help="postgresql://...: queue the episodes there, for `logisticsvln worker` on each machine.",
        ),
    ] = None,
    subtask: Annotated[Subtask | None, typer.Option(help="Fly nothing; ask one model role alone.")] = None,
    requests: Annotated[
        list[Path] | None,
        typer.Option(help="Of the subtask parse: labelled requests (JSON lines) instead of a task set; repeatable."),
    ] = None,
    offline: Annotated[
        list[Path] | None,
        typer.Option(help="Fly nothing; ask the models of --backend (by commas; human) what these records asked."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Fly a task set and print the figures. A run that was interrupted or killed goes on with the same command."""
    if context.invoked_subcommand is not None:
        stop_where_given(context)
        return
    console = Console(stderr=True)
    noise = {
        "miss_rate": miss_rate,
        "false_claim_rate": false_claim_rate,
        "floor_miscount_rate": floor_miscount_rate,
        "box_jitter": box_jitter,
        "refusal_rate": refusal_rate,
        "noise_seed": float(noise_seed),
    }
    if backend != "oracle" and any(noise.values()):
        stop(f"only the oracle's answers can be disturbed, not those of {backend!r}: add --backend oracle", WRONG_INPUT)
    if recording is not None and cache == "off":
        stop("--recording keeps answers, --cache off keeps none: leave one out", WRONG_INPUT)
    if offline:
        from command_line.offline import ask_offline  # brings a web server, which no flight needs

        kept = gateway_settings(cache or ("on" if recording else "off"), recording, {})
        place = out or Path("runs") / f"offline-{time.strftime('%Y%m%d-%H%M%S')}"
        ask_offline(offline, backend, limit, workers or 4, kept, place, console, as_json=as_json)
        return
    model = model_name("backend", backend)
    share = read_shard(shard, out, flies=subtask is None)
    if database is not None:
        given = {
            "--shard": shard is not None,
            "--workers": workers is not None,
            "--recording": recording is not None,
            "--pictures": pictures != "none",
            "--trajectories": trajectories,
            "--subtask": subtask is not None,
        }
        stop_where_queued([name for name, there in given.items() if there])
    if requests:
        if subtask != "parse" or any(given is not None for given in (tasks, seed, count, limit)):
            stop("--requests is for --subtask parse, and takes the place of a task set", WRONG_INPUT)
        kept = gateway_settings(cache or ("on" if recording else "off"), recording, {})
        cores = one_core_each(process_environment())
        stop_without_models(kept, parsing=None if parser is None else model_name("parser", parser))
        score_requests(requests, parser, workers or 1, cores, kept, console, out, as_json=as_json)
        return
    try:
        mission = mission_settings(
            viewpoint=viewpoint,
            choice=choice,
            floors=floors,
            sightings=sightings,
            drift=drift,
            parser=parser,
            max_steps=max_steps,
            rig=rig,
            image_size=image_size,
            sensors=sensors,
            seed=mission_seed,
        )
        task_set = chosen_tasks(tasks, seed, count, console)
    except ValidationError as error:
        stop(first_problem(error), WRONG_INPUT)
    except ValueError as error:
        stop(str(error), WRONG_INPUT)
    disturbed = noise if backend == "oracle" else {}
    mode = cache or ("on" if recording or backend not in ("embedded", "oracle") else "off")
    gateway = gateway_settings(mode, recording, disturbed)
    stop_without_models(gateway, seeing=backend, parsing=mission.parser_model)
    try:
        chosen = without_objects(task_set()) if absent else task_set()
        flown = spread(chosen.tasks, limit)
        some = share_of(flown, share)
    except ValueError as error:
        stop(str(error), WRONG_INPUT)
    except (CannotGenerate, SimulatorFault) as error:
        stop(f"the tasks could not be made: {error}", FAILED)
    except KeyboardInterrupt:
        stop("interrupted before the first flight", INTERRUPTED)
    settings = RunSettings(
        tasks=chosen.name,
        checksum=chosen.checksum,
        count=len(flown),
        backend=model,
        mission=mission,
        oracle=disturbed,
        workers=workers or os.cpu_count() or 1,
        versions=versions(),
        shard=share,
        customer=customer,
        faults=SensorFaults(rate=fault_rate, seed=fault_seed) if fault_rate else None,
    )
    cores = one_core_each(process_environment())
    if subtask is not None:
        ask_alone(subtask, some, settings, cores, gateway, console, out, as_json=as_json)
        return
    place = out or Path("runs") / f"bench-{time.strftime('%Y%m%d-%H%M%S')}"
    try:
        folder = RunFolder(place, settings, some)
    except BadFolder as error:
        stop(str(error), WRONG_INPUT)
    job = Job(
        folder=str(place.absolute()),
        logs="",
        mission=settings.mission,
        backend=backend,
        environment=cores,
        gateway=gateway,
        pictures="all" if trajectories else pictures,
        trajectories=trajectories,
        customer=customer,
        faults=settings.faults,
        episode_s=episode_s,
    )
    with folder, ExitStack() as stack:
        queue = None
        if database is not None:
            opened = stack.enter_context(closing(open_database(database)))
            queue = EpisodeQueue(opened, place, program_of(settings.versions), console.print)
        summary = _fly(folder, job, settings, console, queue)
    if as_json:
        typer.echo(json.dumps(summary.model_dump(mode="json"), ensure_ascii=False))
    else:
        print_summary(Console(), summary, str(place))
    if summary.infrastructure:
        stop(
            f"{summary.infrastructure} of {summary.tasks} episodes say nothing about {backend}: a model or a service "
            f"was out of reach ({_first_reason(folder)}); the same command with --out {place} flies them again",
            FAILED,
        )


def _first_reason(folder: RunFolder) -> str:
    """Of the first episode that says nothing, why not."""
    record = next(record for record in folder.in_order() if not record.judged)
    return record.error or (record.result.message if record.result is not None else "no reason is known")


def _fly(folder: RunFolder, job: Job, settings: RunSettings, console: Console, queue: EpisodeQueue | None) -> Summary:
    title = f"{settings.tasks}, {settings.backend}, {settings.mission.viewpoint.policy}"
    before = len(folder.records)
    if before:
        console.print(f"{folder.path}: {before} of {len(folder.tasks)} results are there already", highlight=False)
    view = LiveProgress(console, title) if console.is_terminal else PlainProgress(console, title)
    with view:
        if queue is None:
            run = Run(folder, job, settings.workers, view.show)
            flown = run.fly()
        else:
            run = queue.run(folder, job, view.show)
            flown = queue.serve(run.fly())
        try:
            asyncio.run(interruptible(flown, lambda: console.print("stopping", highlight=False)))
            return run.conclude()
        except (asyncio.CancelledError, KeyboardInterrupt):
            run.conclude()
            stop(
                f"interrupted after {len(folder.records)} of {len(folder.tasks)} results; the same command with "
                f"--out {folder.path} goes on",
                INTERRUPTED,
            )
        except (CannotRun, OSError, SQLAlchemyError) as error:
            stop(f"the run broke off after {len(folder.records)} results: {error}", FAILED)
