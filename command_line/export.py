"""`logisticsvln export`: a run's flights in the formats of LeRobot, Rerun, MCAP and COCO."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import TaskID

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, bar, stop
from evaluation.bench.folder import BadFolder
from evaluation.export.episodes import CannotExport
from evaluation.export.formats import Exported, FormatName
from evaluation.export.formats import export as export_run
from mission.wording import counted


def export(
    run: Annotated[Path, typer.Argument(help="A run's folder, flown with `bench --trajectories`.")],
    form: Annotated[FormatName, typer.Option("--format", help="What is written.")],
    out: Annotated[
        Path | None, typer.Option(help="The new folder.", show_default="beside the run, named by the format")
    ] = None,
    only_successes: Annotated[bool, typer.Option("--only-successes", help="Leave out flights that failed.")] = False,
    limit: Annotated[int | None, typer.Option(min=1, help="Only the first flights.")] = None,
) -> None:
    """Write the flights of a run as a dataset or as recordings to look at: one record a stop, depth without loss."""
    console = Console(stderr=True)
    place = out or place_beside(run, form)
    try:
        with bar(console) as progress:
            job: TaskID = progress.add_task(f"writing {place}", total=None)
            done = export_run(
                run,
                place,
                form,
                only_successes=only_successes,
                limit=limit,
                told=lambda done, of: progress.update(job, completed=done, total=of),
            )
    except (BadFolder, CannotExport) as error:
        stop(str(error), WRONG_INPUT)
    except OSError as error:
        stop(f"{error.filename or place}: {error.strerror or error}; nothing of {place} is kept", FAILED)
    except KeyboardInterrupt:
        stop("interrupted; nothing is kept", INTERRUPTED)
    typer.echo(f"{place}: {counted(done.episodes, 'flight')}{_left_out(done)}")
    if done.damaged:
        for name, why in done.damaged.items():
            typer.echo(f"  {name}: {why}", err=True)
        stop(f"{len(done.damaged)} flights are damaged and left out", FAILED)


def place_beside(run: Path, form: FormatName) -> Path:
    """The export's usual place; of `.` and the like as well."""
    named = run if run.name not in ("", "..") else run.resolve()
    return named.parent / f"{named.name}-{form}"


def _left_out(done: Exported) -> str:
    """Of each reason, how many flights were left out for it."""
    reasons: dict[str, int] = {}
    for why in done.left_out.values():
        reasons[why] = reasons.get(why, 0) + 1
    return "".join(f"; {count} left out: {why}" for why, count in reasons.items())
