"""`logisticsvln worker`: flies what `bench --database` has queued, on as many machines as there are."""

import asyncio
import os
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from command_line.bench_setup import DATABASE_VARIABLE, open_database, versions
from command_line.console import FAILED, interruptible, stop
from evaluation.bench.queue_database import program_of
from evaluation.bench.queue_worker import Post
from evaluation.bench.queue_worker_process import keep_working
from evaluation.bench.run import CannotRun
from evaluation.bench.worker_pool import run_workers

MAX_WORKERS = 64


def worker(
    database: Annotated[
        str, typer.Option(envvar=DATABASE_VARIABLE, help="postgresql://... in which `bench --database` queues.")
    ],
    workers: Annotated[
        int | None, typer.Option(min=1, max=MAX_WORKERS, help="Processes that fly.", show_default="one a core")
    ] = None,
    logs: Annotated[Path, typer.Option(help="Where the services' logs go.")] = Path("runs/worker-logs"),
) -> None:
    """Fly episodes that `bench --database` has queued, until Ctrl-C. What is under way then, others fly."""
    open_database(database).close()
    console, program, count = Console(), program_of(versions()), workers or os.cpu_count() or 1
    console.print(f"workers of program {program}: {count}; Ctrl-C ends them", highlight=False)
    folder = logs / time.strftime("%Y%m%d-%H%M%S")

    async def work(number: int) -> None:
        post = Post(database=database, program=program, logs=str((folder / str(number)).absolute()))
        await keep_working(post, lambda said: console.print(said, highlight=False, markup=False))

    try:
        asyncio.run(interruptible(run_workers(work, count), lambda: console.print("stopping", highlight=False)))
    except (asyncio.CancelledError, KeyboardInterrupt):
        return
    except (CannotRun, OSError) as error:
        stop(str(error), FAILED)
