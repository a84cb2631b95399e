"""`logisticsvln bench --subtask parse --requests FILE`: a parser over labelled requests, its figures printed."""

import asyncio
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, interruptible, stop
from command_line.subtask import progress_of
from contracts.base import ModelName
from evaluation.labelled_requests.ask import ask_parser
from evaluation.labelled_requests.read import BadRequests, FiledRequest, read_requests
from evaluation.labelled_requests.scores import AskedRequest, Group, RequestScores, misses, score
from evaluation.metrics.summary import Rate
from launcher.processes import CannotStart, Processes, free_ports
from mission.clients import Services
from mission.ports import PortError
from mission.record import write_whole
from service_kit.connections import Connections
from service_kit.settings import process_environment

SERVICES = ("vlm_gateway", "llm_parser")
WIDE = 140
FEWEST_OF_TAG = 8
"""Tags with fewer requests are left to the JSON: their intervals say nothing."""


def score_requests(
    files: Sequence[Path],
    model: ModelName | None,
    at_a_time: int,
    environment: Mapping[str, str],
    gateway: Mapping[str, str],
    console: Console,
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    """The command: starts a parser (and a gateway, where a model needs one), asks, prints; with `out` writes
    `OUT/requests.json` and what was missed to `OUT/misses.jsonl`."""
    try:
        requests = read_requests(files)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs:
            began = time.perf_counter()
            work = _ask(requests, model, at_a_time, environment, gateway, Path(logs), console)
            asked = asyncio.run(interruptible(work))
        scores = score(asked, at_a_time=at_a_time, wall_s=time.perf_counter() - began)
        told = scores.model_dump_json()
        if out is not None:
            write_whole(out / "requests.json", told + "\n")
            write_whole(out / "misses.jsonl", "".join(miss.model_dump_json() + "\n" for miss in misses(asked)))
    except BadRequests as error:
        stop(str(error), WRONG_INPUT)
    except (CannotStart, PortError) as error:
        stop(str(error), FAILED)
    except OSError as error:
        stop(f"{out} can't be written: {error.strerror}", WRONG_INPUT)
    except (KeyboardInterrupt, asyncio.CancelledError):
        stop("interrupted before the last request: nothing is told of a part", INTERRUPTED)
    if as_json:
        typer.echo(json.dumps(json.loads(told), ensure_ascii=False))
    else:
        console = Console()
        # rows of three intervals; a pipe has no width of its own to keep to
        print_request_scores(console if console.is_terminal else Console(width=WIDE), scores)
    if scores.calls.unreachable:
        stop(
            f"{scores.calls.unreachable} of {len(asked)} requests are left out of the figures: the model was out of "
            "reach",
            FAILED,
        )


async def _ask(
    requests: Sequence[FiledRequest],
    model: ModelName | None,
    at_a_time: int,
    environment: Mapping[str, str],
    gateway: Mapping[str, str],
    logs: Path,
    console: Console,
) -> list[AskedRequest]:
    """Raises CannotStart, PortError."""
    surroundings = process_environment() | dict(environment)
    group = Processes(free_ports(SERVICES), logs, environment=surroundings, extra={"vlm_gateway": dict(gateway)})
    tokens = Connections.read(surroundings).tokens
    async with group, Services(group.addresses, tokens) as services:
        with progress_of(console, "requests", len(requests), "requests") as progress:
            parser = services.ports().parser
            return await ask_parser(parser, requests, model=model, at_a_time=at_a_time, told=progress.show)


def print_request_scores(console: Console, scores: RequestScores) -> None:
    """The three outcomes by file and by tag, floor and object apart."""
    answered = "" if scores.ms_mean is None else f", {scores.ms_mean:.1f} ms a request"
    console.print(
        f"parse by {scores.model or 'nobody'}: {scores.all.requests} requests{answered}"
        + (f", {scores.at_a_time} at a time" if scores.at_a_time > 1 else ""),
        highlight=False,
    )
    outcomes = _table("", "n", "right", "asks", "silently wrong")
    fields = _table("", "n", "floor", "object", "object, word for word")
    groups = {Path(file).name if _names_differ(scores) else file: group for file, group in scores.files.items()}
    if len(groups) > 1:
        groups["all"] = scores.all
    for name, group in groups.items():
        outcomes.add_row(name, str(group.requests), *map(_cell, (group.right, group.asks, group.silently_wrong)))
        fields.add_row(name, str(group.requests), *map(_cell, (group.floor, group.object, group.object_exact)))
    tags = _table("tag, least right first", "n", "right", "asks", "silently wrong")
    for name, group in sorted(scores.tags.items(), key=_rightness):
        if group.requests >= FEWEST_OF_TAG:
            tags.add_row(name, str(group.requests), *map(_cell, (group.right, group.asks, group.silently_wrong)))
    for table in (outcomes, fields, tags):
        if table.row_count:
            console.print(table, highlight=False)
    calls = scores.calls
    console.print(
        f"calls {calls.calls}  unreadable {calls.unreadable}  refused {calls.refused}  unreachable {calls.unreachable}",
        highlight=False,
    )


def _names_differ(scores: RequestScores) -> bool:
    return len({Path(file).name for file in scores.files}) == len(scores.files)


def _rightness(item: tuple[str, Group]) -> tuple[float, str]:
    return item[1].right.rate or 0.0, item[0]


def _table(*columns: str) -> Table:
    table = Table(box=None, padding=(0, 2), title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number == 0 else "right", no_wrap=number > 0, overflow="fold")
    return table


def _cell(rate: Rate) -> str:
    if rate.rate is None or rate.low is None or rate.high is None:
        return "n/a"
    return f"{100 * rate.rate:.1f} % [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"
