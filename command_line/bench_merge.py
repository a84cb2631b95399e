"""`logisticsvln bench merge`: the folders of all shards into that of one run."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from command_line.bench_summary import print_summary
from command_line.console import WRONG_INPUT, stop
from evaluation.bench.folder import BadFolder
from evaluation.bench.merge import merge as merge_shards


def merge(
    shards: Annotated[list[Path], typer.Argument(help="The folders of all shards, in any order.", metavar="RUN")],
    out: Annotated[Path, typer.Option(help="The folder of the whole run; it is made.")],
    unfinished: Annotated[
        bool, typer.Option("--unfinished", help="Also of shards that were not flown to their end.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Put the shards of a run together, and print its figures: those of a run that flew all tasks in one place."""
    try:
        summary = merge_shards(shards, out, unfinished=unfinished)
    except BadFolder as error:
        stop(str(error), WRONG_INPUT)
    except OSError as error:
        stop(f"the run can't be written to {out}: {error.strerror or error}", WRONG_INPUT)
    if as_json:
        typer.echo(json.dumps(summary.model_dump(mode="json"), ensure_ascii=False))
    else:
        print_summary(Console(), summary, str(out))
