"""`logisticsvln bench --offline`: recorded looks asked again, of models and of people."""

import asyncio
import json
import tempfile
import tomllib
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NoReturn

import typer
from pydantic import BaseModel, Field, ValidationError
from rich.console import Console
from rich.table import Table

from command_line.bench_setup import model_name
from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, bar, interruptible, stop
from command_line.preflight import stop_without_models
from contracts.base import ModelName
from contracts.errors import first_problem
from evaluation.offline.agreement import OfflineSummary, Price, RaterFigures, summarize_offline
from evaluation.offline.answers import AnswerFile, ask_all
from evaluation.offline.human_desk import serve_desk
from evaluation.offline.questions import Given, NoQuestions, RecordedQuestion, recorded_questions
from evaluation.offline.truth import true_answers
from evaluation.sim_client import SimulatorFault, own_simulator
from evaluation.spread import spread
from launcher.processes import CannotStart, Processes, free_ports
from mission.clients import Services
from mission.ports import PortError
from mission.record import BadRecord, write_whole
from mission.wording import counted
from service_kit.connections import Connections
from service_kit.settings import process_environment

HUMAN, TRUTH = "human", "truth"
SUMMARY = "offline.json"


def ask_offline(
    places: list[Path],
    backends: str,
    limit: int | None,
    at_once: int,
    gateway: Mapping[str, str],
    out: Path,
    console: Console,
    *,
    as_json: bool,
) -> None:
    """Asks every model (and `human`) of `backends`, names by commas, what was asked in these records; what is answered
    already in `out` is not asked again."""
    names = list(dict.fromkeys(model_name("backend", name.strip()) for name in backends.split(",")))
    if "oracle" in names:
        stop("the oracle looks at no picture; what is true is told beside the others in any case", WRONG_INPUT)
    models = [name for name in names if name != HUMAN]
    try:
        questions = spread(recorded_questions(places), limit)
        prices = prices_of(process_environment().get("GATEWAY_CONFIG"))
    except (NoQuestions, ValueError, OSError) as error:
        stop(str(error), WRONG_INPUT)
    for model in models:
        stop_without_models(gateway, seeing=model)
    answers: dict[str, Mapping[str, Given]] = {}
    troubles: list[str] = []
    try:
        with ExitStack() as files:
            answers[TRUTH] = _truth(questions, files.enter_context(AnswerFile(out, TRUTH)), console)
            for name in names:
                file = files.enter_context(AnswerFile(out, name))
                answers[name] = file.given
                if name == HUMAN:
                    _ask_person(questions, file, console)
                else:
                    _ask_model(name, questions, file, at_once, gateway, console)
                troubles += [f"{name}: {file.trouble}"] if file.trouble is not None else []
    except (asyncio.CancelledError, KeyboardInterrupt):
        stop(f"interrupted; the same command goes on with what is not answered in {out}", INTERRUPTED)
    except NoQuestions as error:
        stop(str(error), WRONG_INPUT)
    except ExceptionGroup as group:
        _stop_of(group)
    except (CannotStart, SimulatorFault, PortError, BadRecord, OSError) as error:
        stop(str(error), FAILED)
    told = answers | _in_flight(questions)
    summary = summarize_offline(questions, {name: given for name, given in told.items() if given}, prices)
    write_whole(out / SUMMARY, summary.model_dump_json(indent=1) + "\n")
    if as_json:
        typer.echo(json.dumps(summary.model_dump(mode="json"), ensure_ascii=False))
    else:
        print_offline(Console(), summary, out)
    silent = sum(f.unreachable for by_who in summary.figures.values() for f in by_who.values())
    if silent:
        why = "; ".join(troubles)
        stop(f"{counted(silent, 'question')} without an answer ({why}); the same command asks again", FAILED)


class _Priced(BaseModel):
    """What stands about prices in a model's part of the gateway's configuration; the gateway reads the rest."""

    usd_per_million_prompt: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)
    usd_per_million_completion: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)


class _Priceable(BaseModel):
    models: dict[str, _Priced] = {}


def prices_of(config: str | None) -> dict[str, Price]:
    """Of the gateway's models that have one. Raises ValueError where the file can't be read as such."""
    if not config:
        return {}
    try:
        found = _Priceable.model_validate(tomllib.loads(Path(config).read_text(encoding="utf-8")))
    except ValidationError as error:
        raise ValueError(f"GATEWAY_CONFIG: {config}: {first_problem(error)}") from None
    except OSError as error:
        raise ValueError(f"GATEWAY_CONFIG: {config}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"GATEWAY_CONFIG: {config} is no TOML: {error}") from None
    prices = {a: Price(m.usd_per_million_prompt, m.usd_per_million_completion) for a, m in found.models.items()}
    return {alias: price for alias, price in prices.items() if any(price)}


def _in_flight(questions: list[RecordedQuestion]) -> dict[str, Mapping[str, Given]]:
    """What was answered then, by who did."""
    found: dict[str, dict[str, Given]] = {}
    for question in questions:
        found.setdefault(f"{question.recorded_by}, flown", {})[question.id] = question.recorded
    return dict(found)


def _truth(questions: list[RecordedQuestion], file: AnswerFile, console: Console) -> dict[str, Given]:
    """What is known of it already, and the rest from the scenes built again."""
    pending = [question for question in file.pending(questions) if question.pose is not None]
    if pending:
        with own_simulator() as simulator, bar(console) as progress:
            job = progress.add_task("what is true", total=len(pending))

            def told(answer: Given) -> None:
                file.add(answer)
                progress.advance(job)

            true_answers(pending, simulator, told)
    return file.given


def _ask_model(
    name: ModelName,
    questions: list[RecordedQuestion],
    file: AnswerFile,
    at_once: int,
    gateway: Mapping[str, str],
    console: Console,
) -> None:
    pending = file.pending(questions)
    if not pending:
        return
    with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs, bar(console) as progress:
        job = progress.add_task(f"asking {name}", total=len(pending))

        async def ask() -> None:
            environment = process_environment()
            ports = free_ports(("vlm_gateway",))
            extra = {"vlm_gateway": dict(gateway)}
            async with (
                Processes(ports, Path(logs), environment=environment, extra=extra) as group,
                Services(group.addresses, Connections.read(environment).tokens) as services,
            ):
                vision = services.ports().vision
                await ask_all(vision, name, questions, file, at_once, lambda: progress.advance(job))

        asyncio.run(interruptible(ask()))


def _ask_person(questions: list[RecordedQuestion], file: AnswerFile, console: Console) -> None:
    if not file.pending(questions):
        return
    port = free_ports(("vlm_gateway",))["vlm_gateway"]
    left = counted(len(file.pending(questions)), "question")
    console.print(f"{left} for a person at http://127.0.0.1:{port}/ (Ctrl-C: go on later)", highlight=False)
    asyncio.run(interruptible(serve_desk(port, questions, file)))
    if pending := len(file.pending(questions)):
        stop(f"the page was closed with {counted(pending, 'question')} left; the same command goes on", INTERRUPTED)


def _stop_of(group: ExceptionGroup[Exception]) -> NoReturn:
    first: BaseException = group
    while isinstance(first, ExceptionGroup):
        first = first.exceptions[0]
    stop(str(first), WRONG_INPUT if isinstance(first, NoQuestions) else FAILED)


def print_offline(console: Console, summary: OfflineSummary, out: Path) -> None:
    """Of each kind of question what each took, and the agreement of each with each."""
    for kind, count in summary.questions.items():
        taken = Table(box=None, padding=(0, 1), title=f"{kind}: {counted(count, 'question')}", title_justify="left")
        taken.add_column("", overflow="fold")  # narrow terminals fold names, never figures
        for head in ("answered", "declined", "unreadable", "p50 s", "p95 s", "tokens", "US $"):
            taken.add_column(head, no_wrap=True)
        for who, figures in summary.figures[kind].items():
            taken.add_row(who, *_taken(figures))
        console.print(taken, highlight=False)
        agreed = Table("", *summary.agreement[kind], box=None, padding=(0, 1), title="agreement", title_justify="left")
        for who, row in summary.agreement[kind].items():
            agreed.add_row(who, *[f"{found.k}/{found.n}" for found in row.values()])
        console.print(agreed, highlight=False)
    console.print(f"answers and figures in {out}", highlight=False, soft_wrap=True)


def _taken(figures: RaterFigures) -> tuple[str, ...]:
    waits = ("n/a" if w is None else f"{w:.2f}" for w in (figures.latency_p50_s, figures.latency_p95_s))
    return (
        f"{figures.answered}/{figures.asked}",
        f"{figures.refused}",
        f"{figures.unreadable}",
        *waits,
        f"{figures.prompt_tokens}+{figures.completion_tokens}",
        "n/a" if figures.usd is None else f"{figures.usd:.4f}",
    )
