"""`logisticsvln bench` as a real process with real services: killed, interrupted, robbed of a service."""

import json
import multiprocessing
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
from evaluation.task_set.task import Task
from evaluation.task_set.task_files import lines_of
from tests.ending import WITH_THE_TESTS
from tests.evaluation.bench.made_up_run import COUNT, Doom, fly_made_up
from tests.evaluation.evaluation_kit import a_task
from tests.postgres import Postgres

SMALL = ("--backend", "oracle", "--image-size", "128", "--max-steps", "2")
CLOCK = {"wall_s", "render_s", "model_s"}


def tasks(count: int) -> list[Task]:
    return [a_task(f"t-{n:02d}", facade=(0, 0, 1)[n % 3]) for n in range(count)]


def write(folder: Path, count: int) -> Path:
    path = folder / "tasks.jsonl"
    path.write_bytes(lines_of(tasks(count)))
    return path


def start(*arguments: str | Path, folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "command_line", "bench", *map(str, arguments), "--out", str(folder), "--json"]
    command = [*WITH_THE_TESTS, *command]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def results(folder: Path) -> list[Name]:
    try:
        lines = (folder / "results.jsonl").read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return []
    return [json.loads(line)["task"] for line in lines if line.endswith("}")]


def wait_for(what: Callable[[], bool], limit_s: float = 280.0) -> None:
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
            assert run.poll() is None, f"the run ended before it was killed: {run.communicate()[1]}"
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


@pytest.mark.slow
def test_a_run_killed_ten_times_ends_with_the_tables_of_one_left_alone(tmp_path: Path) -> None:
    set_of_tasks = write(tmp_path, 60)
    fly_through_kills(tmp_path / "killed", set_of_tasks, 60, 10, seed=11)
    clean = start("--tasks", set_of_tasks, *SMALL, "--workers", "2", folder=tmp_path / "clean")
    _, err = clean.communicate(timeout=1200)
    assert clean.returncode == 0, err
    assert sorted(results(tmp_path / "killed")) == sorted(t.id for t in tasks(60))
    assert tables(tmp_path / "killed") == tables(tmp_path / "clean")


@pytest.mark.slow
def test_real_shards_put_together_have_the_tables_of_one_run(tmp_path: Path) -> None:
    set_of_tasks, count, of = write(tmp_path, 6), 6, 3
    arguments = ("--tasks", set_of_tasks, *SMALL, "--workers", "1")
    folders = [tmp_path / "whole", *(tmp_path / f"shard-{number}" for number in range(1, of + 1))]
    for number, folder in enumerate(folders):
        share = ("--shard", f"{number}/{of}") if number else ()
        _, err = start(*arguments, *share, folder=folder).communicate(timeout=600)
        assert len(results(folder)) == (count // of if number else count), err
    merging = [sys.executable, "-m", "command_line", "bench", "merge", *map(str, folders[1:])]
    subprocess.run([*merging, "--out", str(tmp_path / "merged")], check=True, timeout=120, capture_output=True)
    assert tables(tmp_path / "merged") == tables(tmp_path / "whole")
    assert sorted(results(tmp_path / "merged")) == sorted(results(tmp_path / "whole"))


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_run_queued_for_workers_on_two_machines_has_the_tables_of_one_in_a_single_process(
    tmp_path: Path, postgres: Postgres
) -> None:
    set_of_tasks, url = write(tmp_path, 6), postgres.database()
    command = [*WITH_THE_TESTS, sys.executable, "-m", "command_line", "worker", "--database", url, "--workers", "1"]
    machines = [
        subprocess.Popen([*command, "--logs", str(tmp_path / str(n))], stdout=subprocess.PIPE, text=True)
        for n in range(2)
    ]
    try:
        queued = start("--tasks", set_of_tasks, *SMALL, "--database", url, folder=tmp_path / "queued")
        _, err = queued.communicate(timeout=600)
        assert queued.returncode == 0, err
    finally:
        for machine in machines:
            machine.send_signal(signal.SIGINT)
    said = [machine.communicate(timeout=60)[0] for machine in machines]
    assert [machine.returncode for machine in machines] == [0, 0]
    assert all(": success" in words or ": missed" in words for words in said), "both have flown"
    alone = start("--tasks", set_of_tasks, *SMALL, "--workers", "1", folder=tmp_path / "alone")
    _, err = alone.communicate(timeout=600)
    assert alone.returncode == 0, err
    assert tables(tmp_path / "queued") == tables(tmp_path / "alone")
    assert sorted(results(tmp_path / "queued")) == sorted(results(tmp_path / "alone"))


@pytest.mark.timeout(600)
def test_a_made_up_run_killed_ten_times_ends_with_the_tables_of_one_left_alone(tmp_path: Path) -> None:
    # forked from a process that has imported everything: thirteen sessions for the price of one
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload([fly_made_up.__module__])
    chance = random.Random(5)
    ends = []
    for _ in range(10):
        doom = Doom(flights=chance.randrange(5), then_s=chance.uniform(0.0, 0.02))
        run = processes.Process(target=fly_made_up, args=(tmp_path / "killed", 2, doom))
        run.start()
        run.join()
        ends.append(run.exitcode)
        assert len(results(tmp_path / "killed")) == len(set(results(tmp_path / "killed")))
    assert ends.count(-signal.SIGKILL) >= 5, f"too few sessions were killed under way: {ends}"
    for name, workers in (("killed", 3), ("clean", 1)):
        run = processes.Process(target=fly_made_up, args=(tmp_path / name, workers))
        run.start()
        run.join()
        assert run.exitcode == 0
    assert sorted(results(tmp_path / "killed")) == sorted(results(tmp_path / "clean"))
    assert len(results(tmp_path / "clean")) == COUNT
    assert tables(tmp_path / "killed") == tables(tmp_path / "clean")


@pytest.mark.timeout(600)
def test_a_run_interrupted_killed_and_robbed_of_a_service_has_every_result_once(tmp_path: Path) -> None:
    folder, count = tmp_path / "run", 5
    arguments = ("--tasks", write(tmp_path, count), *SMALL, "--workers", "1")

    run = start(*arguments, folder=folder)
    wait_for(lambda: len(results(folder)) >= 1)
    theirs = descendants(run.pid)
    run.send_signal(signal.SIGINT)
    time.sleep(0.2)
    run.send_signal(signal.SIGINT)  # of somebody impatient
    _, err = run.communicate(timeout=180)
    assert run.returncode == 130
    assert "Traceback" not in err
    assert "goes on" in err.splitlines()[-1]
    assert not any(map(alive, theirs)), "an interrupted run leaves services behind"
    assert (folder / "summary.json").is_file()

    run = start(*arguments, folder=folder)
    wait_for(lambda: len(results(folder)) >= 2)
    theirs = descendants(run.pid)
    assert len(theirs) == 5, "a worker and its four services"
    run.kill()
    run.communicate()
    wait_for(lambda: not any(map(alive, theirs)), 60)
    before = results(folder)

    run = start(*arguments, folder=folder)
    wait_for(lambda: len(results(folder)) > len(before))
    sims = [p for p in descendants(run.pid) if "services.sim" in (Path("/proc") / str(p) / "cmdline").read_text()]
    # halted first, so that it dies during an episode and not between two
    os.kill(sims[0], signal.SIGSTOP)
    time.sleep(1.0)
    os.kill(sims[0], signal.SIGKILL)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 1, "an episode that says nothing is no success of the run"
    assert "1 of 5 episodes say nothing about oracle" in err
    assert "sim ended with code -9 during the episode" in err
    assert results(folder)[: len(before)] == before
    assert sorted(results(folder)) == [t.id for t in tasks(count)]
    records = [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()]
    broken = [(r["error"], r["reason"]) for r in records if r["error"]]
    assert broken == [("sim ended with code -9 during the episode", "unreachable")]
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert (summary["tasks"], summary["infrastructure"], summary["success"]["n"]) == (count, 1, count - 1)
    assert summary["outcomes"]["unreachable"] == 1
    assert summary["success"]["k"] >= 1

    run = start(*arguments, folder=folder)
    out, err = run.communicate(timeout=300)
    assert run.returncode == 0, err
    assert sorted(results(folder)) == [t.id for t in tasks(count)]
    assert (json.loads(out)["infrastructure"], json.loads(out)["success"]["n"]) == (0, count)
