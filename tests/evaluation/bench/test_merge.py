"""A run flown in shards is, put together, the run flown in one process; shards that are not one run are refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from command_line.main import app
from evaluation.bench.folder import BadFolder, RunFolder, read_records, read_settings, read_tasks
from evaluation.bench.merge import merge
from evaluation.bench.shard import MAX_SHARDS, Shard
from evaluation.report.runs import load_run
from evaluation.task_set.task_files import lines_of
from tests.evaluation.bench.made_up_run import COUNT, SETTINGS, TASKS, fly_made_up
from tests.evaluation.evaluation_kit import a_record, a_task

OF = 3


def shards(folder: Path, of: int = OF) -> list[Path]:
    """Flies a run's shards, each into a folder of its own; the folders."""
    paths = [folder / f"shard-{number}" for number in range(1, of + 1)]
    for number, path in enumerate(paths, start=1):
        fly_made_up(path, workers=20, shard=Shard(number=number, of=of))
    return paths


def a_shard(path: Path, number: int, of: int = 2, left_out: int = 0, **changed: object) -> Path:
    """One shard whose results are made up at once, but for the last `left_out`."""
    shard = Shard(number=number, of=of)
    share = shard.share(TASKS)
    with RunFolder(path, SETTINGS.model_copy(update={"shard": shard, **changed}), share) as folder:
        for task in share[: len(share) - left_out]:
            folder.add(a_record(task, None, error="made up"), 1.0)
    return path


def without_clock(folder: Path) -> str:
    """summary.json but for the line that says how long the run took."""
    lines = (folder / "summary.json").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(' "wall_s"')]
    assert len(kept) == len(lines) - 1
    return "\n".join(kept)


def test_three_shards_put_together_are_byte_for_byte_the_run_of_one_process(tmp_path: Path) -> None:
    fly_made_up(tmp_path / "whole", workers=20)
    parts = shards(tmp_path)
    assert [len(read_tasks(path).tasks) for path in parts] == [COUNT // OF] * OF
    merged = CliRunner().invoke(app, ["bench", "merge", *map(str, reversed(parts)), "--out", str(tmp_path / "merged")])
    assert merged.exit_code == 0, merged.output
    assert "success rate" in merged.stdout
    for same in ("results.parquet", "tasks.jsonl.zst"):
        assert (tmp_path / "merged" / same).read_bytes() == (tmp_path / "whole" / same).read_bytes(), same
    assert without_clock(tmp_path / "merged") == without_clock(tmp_path / "whole")
    tables = [
        CliRunner().invoke(app, ["compare", str(tmp_path / name), "--by", "difficulty", "--markdown"]).stdout
        for name in ("merged", "whole")
    ]
    assert tables[0] == tables[1]
    assert read_records(tmp_path / "merged") == read_records(tmp_path / "whole")
    settings = read_settings(tmp_path / "merged")
    wanted = SETTINGS.model_copy(update={"workers": OF, "renderer": "tiny"})
    assert settings.model_dump() == wanted.model_dump()
    assert list(tmp_path.glob("*.part")) == []


def test_a_shard_is_taken_up_again_as_a_run_is_and_says_which_share_it_is(tmp_path: Path) -> None:
    folder = a_shard(tmp_path / "one", 2, left_out=10)
    assert (read_settings(folder).shard, load_run(folder).label.endswith("shard 2/2")) == (Shard(number=2, of=2), True)
    with pytest.raises(BadFolder, match="shard"):
        a_shard(folder, 1)
    fly_made_up(folder, workers=1, shard=Shard(number=2, of=2))
    assert len(read_records(folder)) == COUNT // 2


def _missing(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1, 4), a_shard(tmp / "c", 3, 4)]


def _doubled(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1), a_shard(tmp / "b", 2), a_shard(tmp / "c", 2)]


def _other_number(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1, 2), a_shard(tmp / "b", 2, 3)]


def _other_backend(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1), a_shard(tmp / "b", 2, backend="embedded")]


def _other_set(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1), a_shard(tmp / "b", 2, checksum="1" * 64)]


def _other_commit(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1), a_shard(tmp / "b", 2, versions={"python": "3", "commit": "abc"})]


def _other_renderer(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1, renderer="gl"), a_shard(tmp / "b", 2, renderer="tiny")]


def _unfinished(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1), a_shard(tmp / "b", 2, left_out=7)]


def _whole_run(tmp: Path) -> list[Path]:
    fly_made_up(tmp / "b", workers=20)
    return [a_shard(tmp / "a", 1), tmp / "b"]


def _no_run(tmp: Path) -> list[Path]:
    return [a_shard(tmp / "a", 1), tmp / "b"]


def _damaged(tmp: Path) -> list[Path]:
    parts = [a_shard(tmp / "a", 1), a_shard(tmp / "b", 2)]
    (parts[1] / "tasks.jsonl.zst").write_bytes(lines_of(Shard(number=2, of=2).share(TASKS)[:-1]))
    return parts


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (_missing, "missing of 4 shards: 2/4, 4/4; name their folders too"),
        (_doubled, "shard 2/2 is given twice: {tmp}/b and {tmp}/c"),
        (_other_number, "{tmp}/a is shard 1/2 and {tmp}/b shard 2/3: they are not of one run"),
        (_other_backend, "they differ in backend"),
        (_other_set, "they differ in checksum"),
        (_other_commit, "they differ in versions: commit"),
        (_other_renderer, "they differ in renderer"),
        (_unfinished, "{tmp}/b is not finished: shard 2/2 has 23 of 30 results; the command that began it goes on"),
        (_whole_run, "{tmp}/b is no shard but a run of its own (it was flown without --shard)"),
        (_no_run, "{tmp}/b holds no run"),
        (_damaged, "{tmp}/b is damaged: shard 2/2 of 60 tasks has 30, and there is a result of task t-59"),
    ],
)
def test_what_is_not_all_shards_of_one_run_is_refused_with_the_reason_and_nothing_is_written(
    tmp_path: Path, made: Callable[[Path], list[Path]], said: str
) -> None:
    parts = made(tmp_path)
    refused = CliRunner().invoke(app, ["bench", "merge", *map(str, parts), "--out", str(tmp_path / "merged")])
    assert refused.exit_code == 2
    assert said.format(tmp=tmp_path) in refused.stderr
    assert not (tmp_path / "merged").exists()


def test_a_shard_that_is_just_flown_is_refused(tmp_path: Path) -> None:
    parts = [a_shard(tmp_path / "a", 1), a_shard(tmp_path / "b", 2)]
    share = Shard(number=2, of=2)
    with (
        RunFolder(parts[1], SETTINGS.model_copy(update={"shard": share}), share.share(TASKS)),
        pytest.raises(BadFolder, match="another process flies the run"),
    ):
        merge(parts, tmp_path / "merged")


def test_shards_that_are_not_finished_are_merged_where_that_is_wanted_and_the_run_can_be_flown_to_its_end(
    tmp_path: Path,
) -> None:
    parts, out = [a_shard(tmp_path / "a", 1, left_out=2), a_shard(tmp_path / "b", 2, left_out=7)], tmp_path / "merged"
    done = CliRunner().invoke(app, ["bench", "merge", *map(str, parts), "--out", str(out), "--unfinished", "--json"])
    assert done.exit_code == 0, done.output
    told: dict[str, Any] = json.loads(done.stdout)
    assert (told["tasks"], told["planned"]) == (COUNT - 9, COUNT)
    fly_made_up(out, workers=2)
    assert {record.task for record in read_records(out)} == {task.id for task in TASKS}


def test_an_episode_that_says_nothing_leaves_its_shard_unfinished(tmp_path: Path) -> None:
    parts = [a_shard(tmp_path / "a", 1), a_shard(tmp_path / "b", 2, left_out=1)]
    share = Shard(number=2, of=2)
    with RunFolder(parts[1], SETTINGS.model_copy(update={"shard": share}), share.share(TASKS)) as folder:
        folder.add(a_record(folder.pending[0], None, error="away", reason="unreachable"), 1.0)
    with pytest.raises(BadFolder, match="has 29 of 30 results"):
        merge(parts, tmp_path / "merged")


def test_pictures_come_along(tmp_path: Path) -> None:
    parts = [a_shard(tmp_path / "a", 1), a_shard(tmp_path / "b", 2, left_out=1)]
    share = Shard(number=2, of=2)
    with RunFolder(parts[1], SETTINGS.model_copy(update={"shard": share}), share.share(TASKS)) as folder:
        last = folder.pending[0].id
        folder.add(a_record(folder.pending[0], None, error="lost", folder=f"episodes/{last}"), 1.0)
    (parts[1] / "episodes" / last).mkdir(parents=True)
    (parts[1] / "episodes" / last / "summary.png").write_bytes(b"picture")
    merge(parts, tmp_path / "merged")
    assert (tmp_path / "merged" / "episodes" / last / "summary.png").read_bytes() == b"picture"


def test_a_folder_with_something_in_it_is_not_merged_into(tmp_path: Path) -> None:
    parts = [a_shard(tmp_path / "a", 1), a_shard(tmp_path / "b", 2)]
    with pytest.raises(BadFolder, match="is there already"):
        merge(parts, parts[0])
    (tmp_path / "empty").mkdir()
    assert merge(parts, tmp_path / "empty").tasks == COUNT


@pytest.mark.parametrize("count", [1, 7, 60])
@pytest.mark.parametrize("of", [1, 2, 7])
def test_the_shares_of_a_set_are_all_of_it_once(count: int, of: int) -> None:
    shares = [Shard(number=number, of=of).share(range(count)) for number in range(1, of + 1)]
    assert sorted(n for share in shares for n in share) == list(range(count))
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--shard", "0/3"), "there is no shard 0/3: of 3 the first is 1/3 and the last 3/3"),
        (("--shard", "4/3"), "there is no shard 4/3"),
        (("--shard", "3"), "'3' is no shard; write i/n"),
        (("--shard", f"1/{MAX_SHARDS + 1}"), "--shard: of: "),
        (("--shard", "2/3", "--subtask", "floors"), "leave one out"),
        (
            ("--shard", "2/3", "--limit", "1", "merge", "a"),
            "after its name; --shard, --limit is none",
        ),
    ],
)
def test_a_shard_that_makes_no_sense_is_refused_before_anything_starts(
    tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    (tmp_path / "tasks.jsonl").write_bytes(lines_of([a_task("t-1")]))
    out = ("--out", str(tmp_path / "run"))
    options = (*options, *out) if "merge" in options else ("--tasks", str(tmp_path / "tasks.jsonl"), *out, *options)
    refused = CliRunner().invoke(app, ["bench", *options])
    assert refused.exit_code == 2
    assert said in " ".join(refused.stderr.split())
    assert not (tmp_path / "run").exists()


def test_a_shard_without_a_folder_of_its_own_could_not_be_taken_up_again(tmp_path: Path) -> None:
    refused = CliRunner().invoke(app, ["bench", "--shard", "1/3"])
    assert (refused.exit_code, "add --out" in refused.stderr) == (2, True)
