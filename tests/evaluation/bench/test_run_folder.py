"""A run's folder: results land whole, a killed run goes on, and nothing is lost, doubled or mixed up."""

import multiprocessing
import resource
from pathlib import Path

import pytest

from contracts.orchestrator import MissionSettings
from evaluation.bench.folder import BadFolder, RunFolder, read_records, read_settings, read_tasks, read_wall_s
from evaluation.bench.run_settings import RunSettings
from evaluation.bench.table import row, write_parquet
from evaluation.metrics.episode import EpisodeRecord
from evaluation.task_set.task import Task
from tests.evaluation.evaluation_kit import a_record, a_result, a_task, delivered, run_settings

TASKS = [a_task(f"t-{n}") for n in range(1, 5)]


def settings(**more: object) -> RunSettings:
    fields: dict[str, object] = {
        "tasks": "by hand",
        "checksum": "0" * 64,
        "count": len(TASKS),
        "backend": "oracle",
        "mission": MissionSettings(),
        "workers": 1,
        "versions": {"python": "3"},
    }
    return RunSettings.model_validate(fields | more)


def record(task: Task, **more: object) -> EpisodeRecord:
    fields: dict[str, object] = {
        "task": task.id,
        "reason": "success",
        "result": a_result(),
        "started": "2026-01-01T00:00:00Z",
        "wall_s": 3.0,
    }
    return EpisodeRecord.model_validate(fields | more)


def test_a_result_is_there_for_the_next_session(tmp_path: Path) -> None:
    with RunFolder(tmp_path, settings(), TASKS) as first:
        first.add(record(TASKS[2]), 4.0)
    with RunFolder(tmp_path, settings(workers=2, versions={}), TASKS) as again:
        assert [task.id for task in again.pending] == ["t-1", "t-2", "t-4"]
        again.add(record(TASKS[0]), 2.0)
        assert [r.task for r in again.in_order()] == ["t-1", "t-3"]
    assert read_wall_s(tmp_path) == pytest.approx(6.0)
    assert [r.task for r in read_records(tmp_path)] == ["t-1", "t-3"]


def test_the_same_set_from_another_path_goes_on(tmp_path: Path) -> None:
    with RunFolder(tmp_path, settings(tasks="mine.jsonl"), TASKS) as first:
        first.add(record(TASKS[0]), 1.0)
    with RunFolder(tmp_path, settings(tasks="/elsewhere/mine.jsonl"), TASKS) as again:
        assert len(again.pending) == 3
    with pytest.raises(BadFolder, match="checksum"):
        RunFolder(tmp_path, settings(checksum="1" * 64), TASKS)


def test_an_episode_at_which_the_infrastructure_failed_is_flown_again(tmp_path: Path) -> None:
    away = a_result("model_unreachable")
    with RunFolder(tmp_path, settings(), TASKS) as first:
        first.add(record(TASKS[0]), 1.0)
        first.add(record(TASKS[1], reason="unreachable", result=away), 1.0)
        assert [task.id for task in first.pending] == ["t-3", "t-4"], "not at once: whatever is away still is"
    assert [r.task for r in read_records(tmp_path)] == ["t-1", "t-2"]
    with RunFolder(tmp_path, settings(), TASKS) as again:
        assert [task.id for task in again.pending] == ["t-2", "t-3", "t-4"]
        again.add(record(TASKS[1]), 1.0)
    assert [(r.task, r.reason) for r in read_records(tmp_path)] == [("t-1", "success"), ("t-2", "success")]


@pytest.mark.parametrize("kept", [0, 1, 40])
def test_a_line_cut_off_by_a_kill_is_flown_again(tmp_path: Path, kept: int) -> None:
    with RunFolder(tmp_path, settings(), TASKS) as first:
        first.add(record(TASKS[0]), 1.0)
    whole = (tmp_path / "results.jsonl").read_bytes()
    (tmp_path / "results.jsonl").write_bytes(whole + record(TASKS[1]).model_dump_json().encode()[:kept])
    assert [r.task for r in read_records(tmp_path)] == ["t-1"]
    with RunFolder(tmp_path, settings(), TASKS) as again:
        assert [task.id for task in again.pending] == ["t-2", "t-3", "t-4"]
        again.add(record(TASKS[1]), 1.0)
    assert [r.task for r in read_records(tmp_path)] == ["t-1", "t-2"]


def test_no_task_gets_two_results(tmp_path: Path) -> None:
    with RunFolder(tmp_path, settings(), TASKS) as folder:
        folder.add(record(TASKS[0]), 1.0)
        with pytest.raises(ValueError, match="t-1 has a result already"):
            folder.add(record(TASKS[0]), 1.0)
    line = (tmp_path / "results.jsonl").read_bytes()
    (tmp_path / "results.jsonl").write_bytes(line * 2)
    with pytest.raises(BadFolder, match="two results"):
        RunFolder(tmp_path, settings(), TASKS)


def test_a_second_process_is_kept_out(tmp_path: Path) -> None:
    with RunFolder(tmp_path, settings(), TASKS), pytest.raises(BadFolder, match="another process"):
        RunFolder(tmp_path, settings(), TASKS)
    RunFolder(tmp_path, settings(), TASKS).close()


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"backend": "embedded"}, "backend"),
        ({"checksum": "1" * 64}, "checksum"),
        ({"oracle": {"miss_rate": 0.1}}, "oracle"),
    ],
)
def test_another_run_is_not_mixed_in(tmp_path: Path, more: dict[str, object], named: str) -> None:
    RunFolder(tmp_path, settings(), TASKS).close()
    with pytest.raises(BadFolder, match=named):
        RunFolder(tmp_path, settings(**more), TASKS)


def test_the_folder_holds_the_tasks_and_the_settings_of_the_run(tmp_path: Path) -> None:
    with RunFolder(tmp_path, settings(), TASKS) as folder:
        folder.note("tiny", {"preset": "none"})
    assert read_tasks(tmp_path).tasks == tuple(TASKS)
    assert read_settings(tmp_path) == settings(renderer="tiny", model={"preset": "none"})


def test_a_folder_without_a_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadFolder, match="holds no run"):
        read_records(tmp_path)


def test_the_table_has_a_row_for_a_broken_episode_too(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    broken = record(TASKS[1], reason="error", result=None, error="it broke")
    tasks = {task.id: task for task in TASKS}
    assert write_parquet(tmp_path / "r.parquet", tasks, [record(TASKS[0]), broken])
    rows = pq.read_table(tmp_path / "r.parquet").to_pylist()
    assert [(r["task"], r["success"], r["error"], r["steps"]) for r in rows] == [
        ("t-1", True, None, 4),
        ("t-2", False, "it broke", None),
    ]
    assert rows[0] == row(TASKS[0], record(TASKS[0]))
    # a column without any value keeps its type, so that tables of two runs can be put together
    assert write_parquet(tmp_path / "one.parquet", tasks, [broken])
    assert pq.read_schema(tmp_path / "one.parquet") == pq.read_schema(tmp_path / "r.parquet")


def _add_on_a_full_disk(path: Path) -> None:
    """In a process of its own, whose files may not grow beyond what the folder needs to begin."""
    tasks = [a_task("t-1")]
    with RunFolder(path, run_settings(tasks), tasks) as folder:
        resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))
        with pytest.raises(OSError, match="File too large"):
            folder.add(a_record(tasks[0], delivered()), 1.0)


def test_a_result_that_a_full_disk_did_not_take_is_pending_and_closing_says_nothing_more(tmp_path: Path) -> None:
    child = multiprocessing.get_context("fork").Process(target=_add_on_a_full_disk, args=(tmp_path / "run",))
    child.start()
    child.join(60)
    assert child.exitcode == 0
    tasks = [a_task("t-1")]
    assert 0 < (tmp_path / "run" / "results.jsonl").stat().st_size <= 200
    with RunFolder(tmp_path / "run", run_settings(tasks), tasks) as folder:
        assert [task.id for task in folder.pending] == ["t-1"]
