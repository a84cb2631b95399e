"""`logisticsvln evaluate`: renders what is missing, asks one vision model, prints its figures, writes its card."""

import asyncio
import json
import tempfile
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import TypeAdapter, ValidationError
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, bar, stop
from command_line.preflight import stop_without_models
from contracts.errors import first_problem
from contracts.orchestrator import SightingSettings
from contracts.sim import Catalogue
from evaluation.bench.folder import BadFolder
from evaluation.model_evaluation.asking import Answers, Asker
from evaluation.model_evaluation.card import card, told
from evaluation.model_evaluation.cases import CATALOGUE_FILE, FIRST_SEED, STRANGE_SEED, Case, read_cases
from evaluation.model_evaluation.drawing import draw_curves, draw_mistakes
from evaluation.model_evaluation.judged import judged
from evaluation.model_evaluation.mistakes import taken_for, tiles
from evaluation.model_evaluation.pictures import render
from evaluation.model_evaluation.scores import Scores, score
from evaluation.report.runs import Run, load_runs
from evaluation.sim_client import SimulatorFault, own_simulator
from launcher.processes import CannotStart, Processes, free_ports
from mission.clients import Services
from mission.ports import PortError
from mission.record import write_whole
from service_kit.connections import Connections
from service_kit.settings import process_environment

PICTURES = Path("~/.cache/logisticsvln/evaluation")
ABOUT = "about.json"
"""Beside the answers: what the gateway says of the model."""
_ABOUT: TypeAdapter[dict[str, Any]] = TypeAdapter(dict[str, Any])
CARD, CURVES, SHEET = "model-card.md", "model-card.png", "model-card-mistakes.png"
MAX_TASKS = 5_000
UNCACHED = {"CACHE_MODE": "off"}


def evaluate(
    tasks: Annotated[int, typer.Option(min=1, max=MAX_TASKS, help="Fresh streets, one a seed.")] = 300,
    strange: Annotated[int, typer.Option(min=0, max=MAX_TASKS, help="Streets in looks never trained on.")] = 60,
    first_seed: Annotated[int, typer.Option(min=0, max=2**30, help="Of the fresh streets.")] = FIRST_SEED,
    backend: Annotated[str, typer.Option(help="Who is asked: embedded, or an alias of the gateway.")] = "embedded",
    pictures: Annotated[Path, typer.Option(help="Where pictures are kept: they belong to no model.")] = PICTURES,
    claim_confidence: Annotated[
        float | None, typer.Option(min=0, max=1, help="From which a match is a claim.", show_default="the model's own")
    ] = None,
    card_folder: Annotated[Path | None, typer.Option("--card", help="Write the model card into this folder.")] = None,
    flown: Annotated[list[Path] | None, typer.Option(help="A run of `bench`, for the card; several times.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write answers.json and scores.json into this folder.")] = None,
    answers: Annotated[Path | None, typer.Option(help="Score these answers again; nobody is asked.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Measure a vision model on fresh streets: recall, wrong claims, decoys, floors, unknown things, strange looks."""
    console = Console(stderr=True)
    settings = SightingSettings(claim_confidence=claim_confidence)
    folder = pictures.expanduser()
    seeds = [*range(first_seed, first_seed + tasks), *range(STRANGE_SEED, STRANGE_SEED + strange)]
    try:
        runs = load_runs(flown or [])
        if answers is not None:
            given = Answers.model_validate_json(answers.read_bytes())
            about = _about_beside(answers)
            known = read_cases(folder)
            cases = {seed: known[seed] for seed in sorted({a.seed for a in given.sought})}
        else:
            stop_without_models(UNCACHED, seeing=backend)
            cases = _cases(seeds, folder, console)
            given, about = asyncio.run(_asked(list(cases.values()), folder, backend, console))
        scores = score(cases, given, settings)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            write_whole(out / "answers.json", given.model_dump_json())
            write_whole(out / "scores.json", scores.model_dump_json(indent=1))
            write_whole(out / ABOUT, json.dumps(about))
        if card_folder is not None:
            write_card(card_folder, cases, given, scores, folder, about, runs)
    except KeyError as error:
        stop(f"{folder} has no pictures of street {error}, which the answers are about", WRONG_INPUT)
    except (BadFolder, ValueError) as error:
        stop(str(error), WRONG_INPUT)
    except (CannotStart, SimulatorFault, PortError, OSError) as error:
        stop(str(error), FAILED)
    except KeyboardInterrupt:
        stop("interrupted; the pictures rendered so far are kept", INTERRUPTED)
    if as_json:
        typer.echo(scores.model_dump_json())
    else:
        print_scores(Console(), scores)
    if given.unreachable:
        stop(f"{given.unreachable} questions are left out of the figures: the model was out of reach", FAILED)


def _about_beside(answers: Path) -> dict[str, Any]:
    """What `--out` wrote of the model beside its answers; nothing where it lies elsewhere. Raises ValueError."""
    beside = answers.with_name(ABOUT)
    if not beside.is_file():
        return {}
    try:
        return _ABOUT.validate_json(beside.read_bytes())
    except ValidationError as error:
        raise ValueError(f"{beside} is not what `--out` writes: {first_problem(error)}") from None


def write_card(
    place: Path,
    cases: dict[int, Case],
    answers: Answers,
    scores: Scores,
    pictures: Path,
    about: dict[str, Any],
    runs: Sequence[Run] = (),
) -> None:
    """The card, its curves and its sheet of mistakes. Raises ImportError without matplotlib, OSError."""
    place.mkdir(parents=True, exist_ok=True)
    held = judged(cases, answers, scores.sightings)
    known = [j for j in held if not j.case.strange]
    wrong = tiles(known, {s: c for s, c in cases.items() if not c.strange}, _usual(answers, cases), pictures)
    draw_curves(scores, place / CURVES)
    draw_mistakes(wrong, place / SHEET)
    write_whole(place / CARD, card(scores, taken_for(known), wrong, (CURVES, SHEET), about, runs))


def print_scores(console: Console, scores: Scores) -> None:
    """The figures on a terminal."""
    console.print(
        f"{scores.model}: {scores.questions} questions at {scores.tasks} streets, and {scores.strange} strange ones",
        highlight=False,
    )
    table = Table(box=None, padding=(0, 2), show_header=False)
    for name, rate in scores.rates.items():
        table.add_row(name, told(rate))
    for title, group in scores.groups.items():
        if "by kind" not in title:
            table.add_row("")
            for name, rate in group.items():
                table.add_row(f"{title}: {name}", told(rate))
    console.print(table, highlight=False)
    waits = (scores.first_look_s, scores.next_phrase_s, scores.floor_count_s)
    first, following, floors = ("n/a" if w.p50 is None else f"{1000 * w.p50:.0f} ms" for w in waits)
    console.print(f"five views {first}, another phrase {following}, a floor count {floors}", highlight=False)


def _cases(seeds: Sequence[int], folder: Path, console: Console) -> dict[int, Case]:
    """Those of the folder, the missing ones rendered first. Raises SimulatorFault, OSError."""
    known = read_cases(folder)
    if (folder / CATALOGUE_FILE).is_file() and all(seed in known for seed in seeds):
        return {seed: known[seed] for seed in seeds}
    with own_simulator() as simulator, _bar(console, "rendering", len(seeds)) as advance:
        return render(seeds, folder, simulator, lambda _: advance())


async def _asked(cases: Sequence[Case], folder: Path, backend: str, console: Console) -> tuple[Answers, dict[str, Any]]:
    catalogue = Catalogue.model_validate_json((folder / CATALOGUE_FILE).read_bytes())
    ports = free_ports(("vlm_gateway",))
    environment = process_environment()
    with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs:
        async with Processes(ports, Path(logs), environment=environment, extra={"vlm_gateway": UNCACHED}) as group:
            tokens = Connections.read(environment).tokens
            async with Services(group.addresses, tokens) as services:
                asker = Asker(services.ports().vision, folder, catalogue, backend)
                with _bar(console, f"asking {backend}", len(cases)) as advance:
                    answers = await asker.ask(cases, lambda _: advance())
            return answers, await asyncio.to_thread(_about, group.addresses.vlm_gateway, backend, tokens.vlm_gateway)


def _about(url: str, backend: str, token: str | None) -> dict[str, Any]:
    """What the gateway says of the model; nothing where it says nothing."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        with urllib.request.urlopen(urllib.request.Request(f"{url}/v1/status", headers=headers), timeout=10) as reply:
            about = json.loads(reply.read())["models"][backend]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return about if isinstance(about, dict) else {}


def _usual(answers: Answers, cases: dict[int, Case]) -> Answers:
    return answers.model_copy(
        update={"counted": tuple(c for c in answers.counted if c.seed in cases and not cases[c.seed].strange)}
    )


@contextmanager
def _bar(console: Console, what: str, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar that goes on by one at each call; none where nothing is to do."""
    if total == 0:
        yield lambda: None
        return
    with bar(console) as progress:
        job = progress.add_task(what, total=total)
        yield lambda: progress.advance(job)
