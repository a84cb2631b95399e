"""`logisticsvln bench` as a real process with real services: killed, interrupted, robbed of a service."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from contracts.base import Name
from tests.vld.evaluation_kit import a_task
from vld.records import Task
from vld.tasks import lines_of

SMALL = ("--backend", "oracle", "--image-size", "128", "--max-steps", "2")
CLOCK = {"wall_s", "render_s", "model_s"}


def tasks(count: int) -> list[Task]:
    return [a_task(f"t-{n:02d}", facade=(0, 0, 1)[n % 3]) for n in range(count)]


def write(folder: Path, count: int) -> Path:
    path = folder / "tasks.jsonl"
    path.write_bytes(lines_of(tasks(count)))
    return path


def start(*arguments: str | Path, folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "vld.cli", "bench", *map(str, arguments), "--out", str(folder), "--json"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def results(folder: Path) -> list[Name]:
    try:
        lines = (folder / "results.jsonl").read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return []
    return [json.loads(line)["task"] for line in lines if line.endswith("}")]


def wait_for(what: Callable[[], bool], limit_s: float = 120.0) -> None:
    give_up = time.monotonic() + limit_s
    while not what():
        assert time.monotonic() < give_up, "waited too long"
        time.sleep(0.02)


def descendants(pid: int) -> set[int]:
    found: set[int] = set()
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
    grown = {pid}
    while grown:
        grown = {child for child, parent in parents.items() if parent in grown} - found
        found |= grown
    return found


def alive(pid: int) -> bool:
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def tables(folder: Path) -> dict[str, object]:
    """The summary without what a clock says."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    for role in summary["model_calls"].values():
        del role["seconds"], role["latency_s"]
    return {name: value for name, value in summary.items() if name not in CLOCK}


def fly_through_kills(folder: Path, set_of_tasks: Path, count: int, kills: int, seed: int) -> None:
    chance = random.Random(seed)
    at = sorted(chance.sample(range(count), kills))
    for n in at:
        run = start("--tasks", set_of_tasks, *SMALL, "--workers", "1", folder=folder)
        while len(results(folder)) < n or len(descendants(run.pid)) < 5:
            assert run.poll() is None, "the run ended before it was killed"
            time.sleep(0.02)
        time.sleep(chance.uniform(0.0, 1.0))
        theirs = descendants(run.pid)
        run.kill()
        run.communicate()
        wait_for(lambda theirs=theirs: not any(map(alive, theirs)), 60)  # type: ignore[misc]
        assert len(results(folder)) == len(set(results(folder)))
    run = start("--tasks", set_of_tasks, *SMALL, "--workers", "1", folder=folder)
    out, err = run.communicate(timeout=1200)
    assert run.returncode == 0, err
    assert json.loads(out)["tasks"] == count


@pytest.mark.parametrize(("count", "kills"), [(4, 1), pytest.param(60, 10, marks=pytest.mark.slow)])
def test_a_run_killed_at_random_ends_with_the_tables_of_one_left_alone(tmp_path: Path, count: int, kills: int) -> None:
    set_of_tasks = write(tmp_path, count)
    fly_through_kills(tmp_path / "killed", set_of_tasks, count, kills, seed=11)
    clean = start("--tasks", set_of_tasks, *SMALL, "--workers", "2", folder=tmp_path / "clean")
    _, err = clean.communicate(timeout=1200)
    assert clean.returncode == 0, err
    assert sorted(results(tmp_path / "killed")) == sorted(t.id for t in tasks(count))
    assert tables(tmp_path / "killed") == tables(tmp_path / "clean")


def test_a_service_that_dies_costs_its_episode_and_is_started_again(tmp_path: Path) -> None:
    run = start("--tasks", write(tmp_path, 4), *SMALL, "--workers", "1", folder=tmp_path / "run")
    wait_for(lambda: len(results(tmp_path / "run")) >= 1)
    sims = [p for p in descendants(run.pid) if "services.sim" in (Path("/proc") / str(p) / "cmdline").read_text()]
    # halted first, so that it dies during an episode and not between two
    os.kill(sims[0], signal.SIGSTOP)
    time.sleep(1.5)
    os.kill(sims[0], signal.SIGKILL)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 0, err
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["tasks"] == summary["success"]["n"] == 4
    records = [json.loads(line) for line in (tmp_path / "run" / "results.jsonl").read_text().splitlines()]
    broken = [r for r in records if r["error"]]
    assert [(r["error"], r["reason"]) for r in broken] == [("sim ended with code -9 during the episode", "unreachable")]
    assert summary["outcomes"]["unreachable"] == 1
    assert summary["success"]["k"] >= 1


def test_an_interrupted_run_says_how_to_go_on_and_leaves_nothing_running(tmp_path: Path) -> None:
    run = start("--tasks", write(tmp_path, 30), *SMALL, "--workers", "1", folder=tmp_path / "run")
    wait_for(lambda: len(results(tmp_path / "run")) >= 1)
    theirs = descendants(run.pid)
    run.send_signal(signal.SIGINT)
    _, err = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "goes on" in err
    assert not any(map(alive, theirs))
    assert (tmp_path / "run" / "summary.json").is_file()
