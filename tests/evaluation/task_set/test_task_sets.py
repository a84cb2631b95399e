"""Files of tasks: what is read is what was written, and what is not whole is refused in one line."""

from pathlib import Path

import pytest

from evaluation.task_set.task_files import BadTasks, lines_of, load, packed, read, shipped
from tests.evaluation.evaluation_kit import a_task

TASKS = [a_task("t-1"), a_task("t-2", facade=1)]


@pytest.mark.parametrize("data", [lines_of(TASKS), packed(TASKS)], ids=["plain", "packed"])
def test_a_set_reads_back_as_it_was_written(data: bytes) -> None:
    found = read(data, "by hand")
    assert found.tasks == tuple(TASKS)
    assert found.checksum == read(lines_of(TASKS), "x").checksum
    assert found.task("t-2") == TASKS[1]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "no task"),
        (b"{}\n", "line 1"),
        (lines_of([TASKS[0], TASKS[0]]), "two tasks t-1"),
        (packed(TASKS)[:-10], "not a whole zstd file|line|no task"),
        (b"\xff\xfe", "line 1"),
    ],
)
def test_what_is_no_task_set_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(BadTasks, match=why):
        read(data, "by hand")


def test_an_unknown_task_or_set_is_answered_with_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(BadTasks, match="vld-300"):
        load("vld-301")
    with pytest.raises(BadTasks, match="t-1 to t-2"):
        read(lines_of(TASKS), "by hand").task("t-3")
    with pytest.raises(BadTasks, match="no task set"):
        load(str(tmp_path))


def test_a_shipped_set_that_was_changed_is_refused(tmp_path: Path) -> None:
    (tmp_path / "small.jsonl.zst").write_bytes(packed(TASKS))
    (tmp_path / "small.sha256").write_text(f"{read(packed(TASKS), 'small').checksum}  small.jsonl\n")
    assert shipped("small", tmp_path).tasks == tuple(TASKS)
    (tmp_path / "small.jsonl.zst").write_bytes(packed(TASKS[:1]))
    with pytest.raises(BadTasks, match="was changed"):
        shipped("small", tmp_path)
    (tmp_path / "small.sha256").unlink()
    with pytest.raises(BadTasks, match="reinstall"):
        shipped("small", tmp_path)
