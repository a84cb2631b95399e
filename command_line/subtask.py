"""`logisticsvln bench --subtask …`: workers with services of their own, one role asked, its figures printed."""

import asyncio
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table

from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, Printed, Redrawn, bar, interruptible, stop
from evaluation.bench.run_settings import RunSettings
from evaluation.metrics.summary import Rate
from evaluation.subtasks.figures import Subtask, SubtaskScores
from evaluation.subtasks.question_pool import CannotAsk, ask_all
from evaluation.subtasks.run import Plan, scored
from evaluation.subtasks.worker import AskJob
from evaluation.task_set.task import Task
from mission.record import write_whole

LINE_EVERY_S = 15.0


def ask_alone(
    subtask: Subtask,
    tasks: Sequence[Task],
    settings: RunSettings,
    environment: Mapping[str, str],
    gateway: Mapping[str, str],
    console: Console,
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    """The command: asks, prints the figures (or one JSON object), and with `out` writes it to `OUT/SUBTASK.json`.
    `environment` goes to all services, `gateway` to that one."""
    mission = settings.mission
    plan = Plan(settings.backend, mission.parser_model, settings=mission)
    try:
        if out is not None:  # before hours of questions, not after them
            out.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=out):
                pass
    except OSError as error:
        stop(f"{out} can't be written: {error.strerror}", WRONG_INPUT)
    try:
        with tempfile.TemporaryDirectory(prefix="logisticsvln-") as logs:
            job = AskJob(subtask=subtask, plan=plan, logs=logs, environment=dict(environment), gateway=dict(gateway))
            scores = _examine(job, tasks, settings.workers, console)
        told = json.dumps(scores.model_dump(mode="json"), ensure_ascii=False)
        if out is not None:
            write_whole(out / f"{subtask}.json", told + "\n")
    except CannotAsk as error:
        stop(str(error), FAILED)
    except OSError as error:
        stop(f"{out} can't be written: {error.strerror}", FAILED)
    except (KeyboardInterrupt, asyncio.CancelledError):
        stop("interrupted before the last question: nothing is told of a part", INTERRUPTED)
    if as_json:
        typer.echo(told)
    else:
        print_scores(Console(), scores)
    if missing := scores.model_calls.unreachable:
        asked = scores.questions + missing
        stop(f"{missing} of {asked} questions are left out of the figures: the model was out of reach", FAILED)


def _examine(job: AskJob, tasks: Sequence[Task], workers: int, console: Console) -> SubtaskScores:
    """Raises CannotAsk; asyncio.CancelledError where it was interrupted."""
    began = time.perf_counter()
    title = f"{job.subtask}, {job.plan.backend}"
    with progress_of(console, title, len(tasks), "tasks") as progress:
        asked = asyncio.run(interruptible(ask_all(job, tasks, workers, progress.show)))
    return scored(job.subtask, job.plan, asked, time.perf_counter() - began)


def print_scores(console: Console, scores: SubtaskScores) -> None:
    """A subtask's figures on a terminal."""
    skipped = f", {scores.skipped} stops skipped" if scores.skipped else ""
    console.print(
        f"{scores.subtask} by {scores.model or scores.backend}: {scores.questions} questions over {scores.tasks} "
        f"tasks{skipped}, {scores.wall_s:.0f} s",
        highlight=False,
    )
    main = Table(box=None, padding=(0, 2), show_header=False)
    for name, rate in scores.rates.items():
        main.add_row(name.replace("_", " "), *_cells(rate))
    for name, value in scores.values.items():
        main.add_row(name.replace("_", " "), "", "n/a" if value is None else f"{value:.2f}")
    console.print(main, highlight=False)
    for title, group in scores.groups.items():
        table = Table(box=None, padding=(0, 2), show_header=False, title=title, title_justify="left")
        for name, rate in group.items():
            table.add_row(name.replace("_", " ").strip(), *_cells(rate))
        if group:
            console.print(table, highlight=False)
    calls, waits = scores.model_calls, scores.model_calls.latency_s
    console.print(
        f"calls {calls.calls}  from cache {calls.cache_hits}  unreadable {calls.unreadable}  refused {calls.refused}  "
        f"unreachable {calls.unreachable}  "
        + ("" if waits.p50 is None else f"p50 {waits.p50:.3f} s  p95 {waits.p95:.3f} s  p99 {waits.p99:.3f} s"),
        highlight=False,
        soft_wrap=True,
    )


def _cells(rate: Rate) -> tuple[str, str, str]:
    if rate.rate is None or rate.low is None or rate.high is None:
        return f"{rate.k}/{rate.n}", "n/a", ""
    return f"{rate.k}/{rate.n}", f"{100 * rate.rate:.1f} %", f"[{100 * rate.low:.1f}, {100 * rate.high:.1f}]"


def progress_of(console: Console, title: str, total: int, what: str) -> "_Bar | _Lines":
    """A bar on a terminal, else a line now and then."""
    return _Bar(console, title, total) if console.is_terminal else _Lines(console, title, total, what)


class _Bar(Redrawn):
    """A bar that is redrawn in place."""

    def __init__(self, console: Console, title: str, total: int) -> None:
        self._bar = bar(console)
        super().__init__(self._bar)
        self._job = self._bar.add_task(title, total=total)

    def show(self, done: int) -> None:
        self._bar.update(self._job, completed=done)


class _Lines(Printed):
    """One line at most every `LINE_EVERY_S`, and one at the end."""

    def __init__(self, console: Console, title: str, total: int, what: str) -> None:
        self._what = what
        self._console = console
        self._title = title
        self._total = total
        self._said = time.monotonic()

    def show(self, done: int) -> None:
        if time.monotonic() - self._said < LINE_EVERY_S and done < self._total:
            return
        self._said = time.monotonic()
        self._console.print(f"{self._title}: {done}/{self._total} {self._what}", highlight=False, soft_wrap=True)
