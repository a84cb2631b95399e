"""`logisticsvln report` and `compare`: runs in, one HTML page or one table out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import WRONG_INPUT, stop
from contracts.base import Wire
from evaluation.bench.folder import BadFolder
from evaluation.metrics.breakdown import GroupingName
from evaluation.report import by_group
from evaluation.report.by_group import grouped
from evaluation.report.comparison import HEADS, cells, compared
from evaluation.report.markup import markdown
from evaluation.report.page import build_page
from evaluation.report.runs import load_runs
from mission.record import write_whole

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
    by: Annotated[
        GroupingName | None, typer.Option(help="Each kind of task apart, without tests; one run will do.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One object: each run's figures and tests.")] = False,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="The table as Markdown.")] = False,
) -> None:
    """Runs side by side, with paired tests against the first: McNemar's for success, a paired bootstrap for SPL."""
    _check_count(runs)
    if as_json and as_markdown:
        stop("--json and --markdown exclude each other", WRONG_INPUT)
    try:
        loaded = load_runs(runs)
        if by is not None:
            groups = grouped(loaded, by)
            _show(groups, by_group.heads(groups), by_group.rows(groups), as_json, as_markdown)
            return
        arms = compared(loaded)
    except ValueError as error:
        stop(str(error), WRONG_INPUT)
    _show(arms, HEADS, [cells(arm) for arm in arms.arms], as_json, as_markdown, upright=True)


def _show(
    found: Wire,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    as_json: bool,
    as_markdown: bool,
    *,
    upright: bool = False,
) -> None:
    """`upright`: on the screen a column a row, because so many figures side by side are wider than a terminal."""
    if as_json:
        typer.echo(found.model_dump_json(indent=2))
        return
    if as_markdown:
        typer.echo(markdown([heads, *rows]))
        return
    if upright:
        heads, *rows = zip(heads, *rows, strict=True)
    table = Table(*heads, box=None, padding=(0, 2))
    for row in rows:
        table.add_row(*row)
    Console().print(table, highlight=False)


def _check_count(runs: list[Path]) -> None:
    if len(runs) > MAX_RUNS:
        stop(f"at most {MAX_RUNS} runs lie beside each other, not {len(runs)}", WRONG_INPUT)
