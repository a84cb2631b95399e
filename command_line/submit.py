"""`logisticsvln submit`: a run as a row of the leaderboard, and whether its answers give what it claims."""

import asyncio
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from command_line.bench_setup import gateway_settings, one_core_each, versions
from command_line.console import FAILED, INTERRUPTED, WRONG_INPUT, bar, interruptible, stop
from evaluation.bench.folder import BadFolder
from evaluation.bench.run import CannotRun
from evaluation.bench.run_settings import RunSettings
from evaluation.report.comparison import rate
from evaluation.report.markup import percent
from evaluation.report.runs import label_of
from evaluation.spread import spread
from evaluation.submission.claims import Finding, Submission, examine, read_submission
from evaluation.submission.outcomes import digest
from evaluation.submission.replay import Replayed, fly_again
from service_kit.settings import process_environment

RECORDING, CONFIG = "recording.sqlite", "gateway.toml"
"""In a run's folder: the answers that its model gave, and the gateway's configuration that it was asked with."""
HEADS = ("arm", "tasks", "success", "horizontal SPL", "steps", "wrong claims", "collisions", "seed", "code", "digest")


def submit(
    run: Annotated[Path, typer.Argument(help="A run's folder.")],
    check: Annotated[bool, typer.Option("--check", help="Fly it again with the answers that it recorded.")] = False,
    recording: Annotated[
        Path | None,
        typer.Option(help="The recorded answers, a cache's file or a .vlmrec.", show_default=f"RUN/{RECORDING}"),
    ] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="Fly only so many again, evenly over the run.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, max=64, help="Processes that fly.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
) -> None:
    """Print a run's row for the leaderboard; with --check, verify that its table is what its answers give."""
    try:
        submission = read_submission(run)
        findings = examine(submission)
    except (BadFolder, ValueError) as error:
        stop(str(error), WRONG_INPUT)
    sound = all(finding.ok for finding in findings)
    replayed = _replayed(submission, recording, limit, workers) if check and sound else []
    if as_json:
        typer.echo(json.dumps(_told(submission, findings, replayed, checked=check), ensure_ascii=False))
    else:
        _print(submission, findings, replayed, checked=check)
    if not sound:
        stop(f"{run} does not hold what it claims", FAILED)
    wrong = sum(flight.ending != "same" for flight in replayed)
    if wrong:
        why = other_versions(submission.settings.versions, versions())
        told = f"; which may be why: it was flown with {why}" if why else ""
        stop(f"{wrong} of {len(replayed)} flights are not what {run} claims, or could not be flown again{told}", FAILED)


def other_versions(flown: Mapping[str, str], here: Mapping[str, str]) -> str:
    """What a run was flown with that is otherwise here; empty where all is the same."""
    other = [name for name in sorted({*flown, *here}) if flown.get(name) != here.get(name)]
    return ", ".join(f"{name} {flown.get(name, 'none')[:10]} (here {here.get(name, 'none')[:10]})" for name in other)


def leaderboard_row(run: Submission) -> tuple[str, ...]:
    """Under `HEADS`."""
    own, settings = run.summary, run.settings
    code = settings.versions.get("commit", "")[:10] or settings.versions.get("logisticsvln", "unknown")
    return (
        label_of(settings),
        f"{settings.tasks}, {own.tasks}",
        rate(own.success),
        percent(own.spl.horizontal),
        "n/a" if own.average_steps is None else f"{own.average_steps:.1f}",
        rate(own.recognition_fail),
        str(own.collisions),
        _seeds(settings),
        code,
        digest(run.records)[:16],
    )


def _seeds(settings: RunSettings) -> str:
    noise = settings.oracle.get("noise_seed")
    return f"{settings.mission.seed}" + (f", noise {noise:g}" if noise and any(settings.oracle.values()) else "")


def _replayed(run: Submission, recording: Path | None, limit: int | None, workers: int | None) -> list[Replayed]:
    """Ends the command where the answers are not there, or nothing can be flown."""
    console = Console(stderr=True)
    tasks = spread(list(run.tasks.values()), limit)
    environment = process_environment()
    try:
        with tempfile.TemporaryDirectory(prefix="logisticsvln-") as scratch, bar(console) as progress:
            gateway = _gateway(run, recording, Path(scratch))
            job = progress.add_task("flying again", total=len(tasks))
            again = fly_again(
                run,
                tasks,
                Path(scratch) / "run",
                gateway,
                one_core_each(environment) | _no_keys(gateway),
                workers or os.cpu_count() or 1,
                lambda standing: progress.update(job, completed=standing.done),
            )
            return asyncio.run(interruptible(again))
    except (asyncio.CancelledError, KeyboardInterrupt):
        stop("interrupted; nothing is known of the flights", INTERRUPTED)
    except (CannotRun, OSError) as error:
        stop(f"the flights could not be made again: {error}", FAILED)


def _gateway(run: Submission, recording: Path | None, scratch: Path) -> dict[str, str]:
    """The gateway's settings: the oracle tells the truth again, the embedded model is asked again where nothing is
    recorded, and what any other model said is read from a copy of its recording."""
    settings = run.settings
    if settings.backend == "oracle":
        return gateway_settings("off", None, settings.oracle)
    source = recording or run.folder / RECORDING
    if recording is None and not source.is_file():
        if settings.backend == "embedded" and settings.mission.parser_model is None:
            return gateway_settings("off", None, {})
        stop(
            f"{run.folder} has no {RECORDING}, the answers of {settings.backend}; name it with --recording, or fly the "
            f"run with --recording {source}",
            WRONG_INPUT,
        )
    copy = scratch / RECORDING
    if not source.is_file():
        stop(f"there is no recording {source}", WRONG_INPUT)
    if source.suffix == ".vlmrec":
        _unpack(source, copy)
    else:
        for part in source.parent.glob(source.name + "*"):  # with the log that the database may have beside it
            shutil.copyfile(part, copy.with_name(part.name.replace(source.name, copy.name, 1)))
    config = run.folder / CONFIG
    own = {"GATEWAY_CONFIG": str(config.absolute())} if config.is_file() else {}
    return gateway_settings("replay", copy, {}) | own


def _unpack(recording: Path, into: Path) -> None:
    """Ends the command where the file is damaged."""
    command = [sys.executable, "-m", "services.vlm_gateway.recording", "import", str(recording)]
    environment = process_environment() | {"CACHE_PATH": str(into), "REDIS_URL": "", "CACHE_MAX_MB": "1048576"}
    done = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    if done.returncode:
        stop(done.stderr.removeprefix("recording: "), WRONG_INPUT)


def _no_keys(gateway: dict[str, str]) -> dict[str, str]:
    """Whoever checks has not got the keys of the models, and needs none: nobody is asked."""
    if "GATEWAY_CONFIG" not in gateway:
        return {}
    path = Path(gateway["GATEWAY_CONFIG"])
    try:
        models = tomllib.loads(path.read_text(encoding="utf-8")).get("models", {})
        names = {str(model["api_key_env"]) for model in models.values() if "api_key_env" in model}
    except (ValueError, AttributeError, TypeError) as error:
        stop(f"{path} is no configuration of a gateway: {error}", WRONG_INPUT)
    return dict.fromkeys(names, "replayed")


def _told(run: Submission, findings: list[Finding], replayed: list[Replayed], *, checked: bool) -> dict[str, object]:
    return {
        "run": str(run.folder),
        "row": dict(zip(HEADS, leaderboard_row(run), strict=True)),
        "digest": digest(run.records),
        "settings": run.settings.model_dump(mode="json"),
        "findings": [finding._asdict() for finding in findings],
        "checked": checked,
        "replayed": [flight._asdict() for flight in replayed],
    }


def _print(run: Submission, findings: list[Finding], replayed: list[Replayed], *, checked: bool) -> None:
    for finding in findings:
        typer.echo(f"{'ok ' if finding.ok else 'NOT'}  {finding.about}: {finding.said}")
    if replayed:
        same = sum(flight.ending == "same" for flight in replayed)
        typer.echo(f"{'ok ' if same == len(replayed) else 'NOT'}  flown again: {same} of {len(replayed)} are the same")
        for flight in replayed:
            if flight.ending != "same":
                typer.echo(f"     {flight.task} {flight.ending}: {flight.said}")
    elif not checked:
        typer.echo("     not flown again: add --check")
    typer.echo(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}\n| {' | '.join(leaderboard_row(run))} |")
