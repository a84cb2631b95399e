"""Arms side by side, and their tests, on results counted by hand."""

import json
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from command_line.main import app
from evaluation.report.comparison import HEADS, same_tasks
from evaluation.report.page import build_page
from evaluation.report.runs import load_runs
from evaluation.task_set.task import Task
from tests.evaluation.evaluation_kit import a_record, a_result, a_run, a_task, a_verdict, delivered

TASKS = [a_task(f"t-{i:02d}") for i in range(12)]

CENTRE = {"policy": "paper", "choice": "centre"}


def flown(path: Path, won: set[int], count: int = len(TASKS), **mission: object) -> Path:
    """The tasks with these numbers delivered, all others at a wrong window."""
    missed = a_result("wrong_window", a_verdict(right=False))
    records = [a_record(task, delivered() if i in won else missed) for i, task in enumerate(TASKS[:count])]
    return a_run(path, TASKS, records, **mission)


def asked(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["compare", *map(str, arguments)])


@pytest.fixture
def arms(tmp_path: Path) -> list[Path]:
    """The first wins 0-5, the second 4-11, but flew only 0-9: 4 to 2 on the tasks of both."""
    return [
        flown(tmp_path / "a", set(range(6))),
        flown(tmp_path / "b", set(range(4, 12)), 10, viewpoint=CENTRE),
    ]


def test_each_run_is_tested_against_the_first_on_the_tasks_of_both(arms: list[Path]) -> None:
    first, second = json.loads(asked(*arms, "--json").stdout)["arms"]
    assert first["against_first"] is None
    assert (first["summary"]["success"]["k"], second["summary"]["success"]["k"]) == (6, 6)
    test = second["against_first"]
    assert (test["tasks"], test["both"], test["only_run"], test["only_baseline"], test["neither"]) == (10, 2, 4, 4, 0)
    assert test["success_p"] == 1.0
    assert test["success"]["mean"] == 0.0


def test_a_gain_over_the_first_is_positive(tmp_path: Path) -> None:
    shown = asked(
        flown(tmp_path / "a", {1}),
        flown(tmp_path / "b", set(range(12)), viewpoint=CENTRE),
        "--json",
    )
    test = json.loads(shown.stdout)["arms"][1]["against_first"]
    assert (test["only_run"], test["only_baseline"]) == (11, 0)
    assert test["success_p"] == pytest.approx(2 / 2**11)
    assert test["horizontal_spl"]["low"] > 0


def test_a_pair_has_the_same_signs_in_compare_and_in_the_report(tmp_path: Path) -> None:
    worse, better = flown(tmp_path / "a", {1}), flown(tmp_path / "b", set(range(12)), viewpoint=CENTRE)
    gained = json.loads(asked(worse, better, "--json").stdout)["arms"][1]["against_first"]
    cells = asked(worse, better, "--markdown").stdout.splitlines()[3].split(" | ")
    page = build_page(load_runs([worse, better]))
    line = page[page.index('id="compared"') :].split("<tr>")[2].partition("</tr>")[0]
    assert gained["success"]["mean"] > 0
    assert gained["horizontal_spl"]["mean"] > 0
    spl = cells[HEADS.index("horizontal SPL gained")]
    assert spl.startswith("+")
    assert spl in line
    assert line.index("key r1") < line.index("key r0")
    lost = json.loads(asked(better, worse, "--json").stdout)["arms"][1]["against_first"]
    assert lost["horizontal_spl"]["mean"] == -gained["horizontal_spl"]["mean"]


def test_success_has_one_test_and_its_difference_an_interval(arms: list[Path]) -> None:
    test = json.loads(asked(*arms, "--json").stdout)["arms"][1]["against_first"]
    assert set(test["success"]) == {"mean", "low", "high"}
    assert (test["success_p"], 0.0 <= test["horizontal_spl_p"] <= 1.0) == (1.0, True)


def named(prefix: str) -> list[Task]:
    """Twelve tasks that differ, drawn under a name."""
    return [a_task(f"{prefix}-{i:02d}", seed=i, floor=2 + i % 3) for i in range(12)]


def test_a_set_is_known_by_its_tasks_whatever_it_was_called(tmp_path: Path) -> None:
    first = a_run(tmp_path / "a", named("mine"), [a_record(task, delivered()) for task in named("mine")])
    other = named("s5")
    lost = [a_record(task, delivered() if i < 3 else a_result("object_not_found")) for i, task in enumerate(other)]
    test = json.loads(asked(first, a_run(tmp_path / "b", other, lost), "--json").stdout)["arms"][1]["against_first"]
    assert (test["tasks"], test["both"], test["only_baseline"]) == (12, 3, 9)


def test_a_task_that_is_in_a_set_twice_is_paired_once() -> None:
    pairs = same_tasks({"a": "x", "b": "x", "c": "y"}, {"b": "x", "d": "x", "e": "x", "f": "z"})
    assert pairs == {"b": "b", "d": "a"}


def test_the_table_has_a_line_an_arm(arms: list[Path]) -> None:
    lines = asked(*arms, "--markdown").stdout.splitlines()
    assert len(lines) == 4
    assert len({line.count("|") for line in lines}) == 1
    assert "6/12 50.0 % (25.4–74.6)" in lines[2]
    assert "| 4 : 4 | 1.000 |" in lines[3]


def test_the_screen_has_a_column_an_arm(arms: list[Path]) -> None:
    shown = asked(*arms)
    assert shown.exit_code == 0
    assert "6/12 50.0 %" in shown.stdout
    assert "6/10 60.0 %" in shown.stdout


@pytest.mark.parametrize(("more", "said"), [([], "two runs or more"), (["--json", "--markdown"], "exclude each other")])
def test_what_cannot_be_compared_is_said_in_one_line(arms: list[Path], more: list[str], said: str) -> None:
    refused = asked(*(arms if more else arms[:1]), *more)
    assert refused.exit_code == 2
    assert said in refused.stderr
    assert refused.stderr.count("\n") == 1


def test_runs_without_a_common_task_are_no_comparison(tmp_path: Path) -> None:
    other = [a_task("t-00", floor=2)]
    runs = (flown(tmp_path / "a", {1}), a_run(tmp_path / "b", other, [a_record(other[0], delivered())]))
    refused = asked(*runs)
    assert refused.exit_code == 2
    assert "no task in common" in refused.stderr


def test_each_kind_of_task_stands_apart(tmp_path: Path) -> None:
    tasks = [a_task(f"t-{i}", floor=2 if i < 4 else 5) for i in range(6)]
    missed = a_result("wrong_window", a_verdict(right=False))
    records = [a_record(task, missed if i in {0, 4, 5} else delivered()) for i, task in enumerate(tasks)]
    run = a_run(tmp_path / "a", tasks, records)
    low, high = json.loads(asked(run, "--by", "floor", "--json").stdout)["runs"][0]["groups"].items()
    assert [(name, g["success"]["k"], g["success"]["n"]) for name, g in (low, high)] == [("1-3", 3, 4), ("4-6", 0, 2)]
    assert low[1]["spl"]["horizontal"] > high[1]["spl"]["horizontal"] == 0.0
    lines = asked(run, run, "--by", "floor", "--markdown").stdout.splitlines()
    assert len(lines) == 4
    assert lines[2].startswith("| 1-3 | 3/4 75.0 %")
    assert {line.count("|") for line in lines} == {4}
    assert "3/4 75.0 %" in asked(run, "--by", "floor").stdout
    assert "'floor'" in asked(run, "--by", "colour").stderr
