"""What `bench` works out of its options before anything is flown."""

import importlib.metadata
import platform
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import typer
from pydantic import TypeAdapter, ValidationError
from rich.console import Console

from command_line.console import WRONG_INPUT, stop
from command_line.tasks import generated
from contracts.base import ModelName
from contracts.errors import first_problem
from evaluation.bench.queue_database import BadDatabase, QueueDatabase
from evaluation.bench.shard import Shard
from evaluation.task_set.generate import wanted_tasks
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import TaskSet, load

_PACKAGES = ("logisticsvln", "numpy", "opencv-python-headless", "moderngl", "pybullet", "pydantic", "aiohttp")


DATABASE_VARIABLE = "BENCH_DATABASE_URL"
_MODEL_NAME: TypeAdapter[ModelName] = TypeAdapter(ModelName)


def chosen_tasks(tasks: str | None, seed: int | None, count: int | None, console: Console) -> Callable[[], TaskSet]:
    """The set, or what makes a fresh one, which takes long; that raises CannotGenerate or SimulatorFault. Raises
    BadTasks, ValueError."""
    if (seed is None) != (count is None):
        raise ValueError("a fresh set needs both --seed and --count")
    if seed is not None and count is not None:
        if tasks is not None:
            raise ValueError("give either --tasks or --seed and --count")
        wanted_tasks(seed, count)
        fresh_seed, fresh_count = seed, count
        return lambda: generated(fresh_seed, fresh_count, console)
    loaded = load(tasks or "vld-300")
    return lambda: loaded


def model_name(option: str, text: str) -> ModelName:
    """What an option calls a model; ends the command where no model can be called so."""
    try:
        return _MODEL_NAME.validate_python(text)
    except ValidationError as error:
        stop(f"--{option} {text!r}: {first_problem(error)}", WRONG_INPUT)


def read_shard(text: str | None, out: Path | None, *, flies: bool) -> Shard | None:
    """The share of `--shard`; ends the command where there is no such share, or it makes no sense with the rest."""
    if text is None:
        return None
    if not flies:
        stop("--shard shares flights out, and --subtask flies nothing: leave one out", WRONG_INPUT)
    if out is None:
        stop("a shard needs a folder of its own by which it is taken up again: add --out", WRONG_INPUT)
    try:
        return Shard.parse(text)
    except ValidationError as error:
        stop(f"--shard: {first_problem(error)}", WRONG_INPUT)
    except ValueError as error:
        stop(f"--shard: {error}", WRONG_INPUT)


def stop_where_queued(given: Sequence[str]) -> None:
    """Ends the command where options are given that make no sense for a run that others fly."""
    if given:
        stop(f"with --database other machines fly: leave {', '.join(given)} out", WRONG_INPUT)


def open_database(url: str) -> QueueDatabase:
    """The database of `--database`; ends the command where it can't be used."""
    try:
        return QueueDatabase(url)
    except BadDatabase as error:
        stop(f"--database: {error}", WRONG_INPUT)


def share_of(tasks: list[Task], shard: Shard | None) -> list[Task]:
    """Raises ValueError for a share without tasks."""
    if shard is None:
        return tasks
    if not shard.share(tasks):
        raise ValueError(f"shard {shard} of {len(tasks)} tasks has none; make at most {len(tasks)} shards of them")
    return shard.share(tasks)


def gateway_settings(mode: str, recording: Path | None, noise: Mapping[str, float]) -> dict[str, str]:
    """The gateway's environment: its cache, and what disturbs its oracle."""
    settings = {"CACHE_MODE": mode}
    if recording is not None:
        settings["CACHE_PATH"] = str(recording.absolute())
    return settings | {f"ORACLE_{name.upper()}": f"{value:g}" for name, value in noise.items()}


def one_core_each(environment: Mapping[str, str]) -> dict[str, str]:
    """Workers share the machine by processes, not by threads: each renderer and each numerical library keeps to one
    core, unless the environment says otherwise."""
    names = ("LP_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
    return {name: environment.get(name, "1") for name in names}


def versions() -> dict[str, str]:
    """Of Python, the packages that may change a result, and, in a checkout, the commit."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    if commit := _commit(Path(__file__).parent.parent):
        found["commit"] = commit
    return found


def _commit(checkout: Path) -> str | None:
    """Its hash, with `-dirty` where tracked files were changed; null where it is none, or git can't say."""
    if not (checkout / ".git").exists():
        return None
    command = ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip() or None


def stop_where_given(context: typer.Context) -> None:
    """Ends the command where options of `bench` itself stand before a subcommand, which takes none of them."""
    given = [name for name in context.params if str(context.get_parameter_source(name)).endswith(".COMMANDLINE")]
    if given:
        options = ", ".join(f"--{'json' if name == 'as_json' else name.replace('_', '-')}" for name in given)
        stop(f"{context.invoked_subcommand} takes its own options, after its name; {options} is none", WRONG_INPUT)
