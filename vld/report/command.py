"""`logisticsvln report`: runs in, one HTML page out."""

from pathlib import Path
from typing import Annotated, NoReturn

import typer

from orchestrator.record import write_whole
from vld.bench.folder import BadFolder
from vld.report.page import build_page
from vld.report.runs import load_runs

WRONG_INPUT = 2
MAX_RUNS = 8


def report(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs, as `bench --out` writes them.")],
    out: Annotated[Path | None, typer.Option(help="The page; without it `report.html` in the first run.")] = None,
    megabytes: Annotated[int, typer.Option(min=0, max=500, help="How much room pictures may take.")] = 24,
) -> None:
    """One self-contained HTML page: the paper's tables with ours beside them, figures, and every failure."""
    if len(runs) > MAX_RUNS:
        _wrong(f"a report holds at most {MAX_RUNS} runs, not {len(runs)}")
    page_path = out or runs[0] / "report.html"
    try:
        page = build_page(load_runs(runs), megabytes * 1_000_000)
        write_whole(page_path, page)
    except BadFolder as error:
        _wrong(str(error))
    except OSError as error:
        _wrong(f"the report can't be written to {page_path}: {error.strerror}")
    typer.echo(str(page_path))


def _wrong(message: str) -> NoReturn:
    typer.echo(f"logisticsvln: {' '.join(message.split())}", err=True)
    raise typer.Exit(WRONG_INPUT)
