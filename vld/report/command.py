"""`logisticsvln report` and `compare`: runs in, one HTML page or one table out."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from orchestrator.console import WRONG_INPUT, stop
from orchestrator.record import write_whole
from vld.bench.folder import BadFolder
from vld.report.comparison import HEADS, cells, compared, markdown
from vld.report.page import build_page
from vld.report.runs import load_runs

MAX_RUNS = 8


def report(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs, as `bench --out` writes them.")],
    out: Annotated[Path | None, typer.Option(help="The page; without it `report.html` in the first run.")] = None,
    megabytes: Annotated[int, typer.Option(min=0, max=500, help="How much room pictures may take.")] = 24,
) -> None:
    """One self-contained HTML page: the paper's tables with ours beside them, figures, and every failure."""
    _check_count(runs)
    page_path = out or runs[0] / "report.html"
    try:
        page = build_page(load_runs(runs), megabytes * 1_000_000)
        write_whole(page_path, page)
    except BadFolder as error:
        stop(str(error), WRONG_INPUT)
    except OSError as error:
        stop(f"the report can't be written to {page_path}: {error.strerror}", WRONG_INPUT)
    typer.echo(str(page_path))


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs; the others are tested against the first.")],
    as_json: Annotated[bool, typer.Option("--json", help="One object: each run's figures and tests.")] = False,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="The table as Markdown.")] = False,
) -> None:
    """Runs side by side, with paired tests against the first: McNemar's for success, a paired bootstrap for SPL."""
    _check_count(runs)
    if as_json and as_markdown:
        stop("--json and --markdown exclude each other", WRONG_INPUT)
    try:
        arms = compared(load_runs(runs))
    except ValueError as error:
        stop(str(error), WRONG_INPUT)
    if as_json:
        typer.echo(arms.model_dump_json(indent=2))
    elif as_markdown:
        typer.echo(markdown(arms))
    else:
        # a column an arm: eleven figures side by side are wider than a terminal
        heads, *rows = zip(HEADS, *map(cells, arms.arms), strict=True)
        table = Table(*heads, box=None, padding=(0, 2))
        for row in rows:
            table.add_row(*row)
        Console().print(table, highlight=False)


def _check_count(runs: list[Path]) -> None:
    if len(runs) > MAX_RUNS:
        stop(f"at most {MAX_RUNS} runs lie beside each other, not {len(runs)}", WRONG_INPUT)
