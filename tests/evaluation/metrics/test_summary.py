"""A run's figures as one object, and two runs compared, by hand."""

import json

import pytest

from evaluation.metrics.comparison import compare
from evaluation.metrics.summary import summarize
from tests.evaluation.evaluation_kit import a_record, a_result, a_task, a_verdict, delivered

TASKS = {f"t-{i}": a_task(f"t-{i}") for i in range(4)}
RECORDS = [
    a_record(TASKS["t-2"], None, error="the simulator ended\nand more"),
    a_record(TASKS["t-0"], delivered()),
    a_record(TASKS["t-1"], a_result("wrong_window", a_verdict(right=False))),
]


def test_the_object_has_the_keys_that_were_promised() -> None:
    told = json.loads(summarize(TASKS, RECORDS, 9.0).model_dump_json())
    assert told["tasks"] == 3
    for name, k, n in (("success", 1, 3), ("floor_fail", 1, 3), ("recognition_fail", 1, 2)):
        assert (told[name]["k"], told[name]["n"]) == (k, n)
        assert told[name]["rate"] == pytest.approx(k / n, abs=1e-6)
        assert told[name]["low"] < told[name]["rate"] < told[name]["high"]
    # 10 of 20 m on the plan, 12 of 24 m in space, one success of three tasks
    assert told["spl"] == {"horizontal": pytest.approx(0.5 / 3, abs=1e-6), "spatial": pytest.approx(0.5 / 3, abs=1e-6)}
    assert told["average_steps"] == 4.0
    assert told["collisions"] == 0
    assert told["outcomes"] == {"success": 1, "wrong_object": 1, "error": 1}
    assert told["model_calls"]["recognition"]["calls"] == 6
    assert (told["wall_s"], told["render_s"], told["model_s"]) == (9.0, 3.0, 1.5)


def test_further_figures_stand_beside_them() -> None:
    summary = summarize(TASKS, RECORDS, 9.0)
    assert summary.planned == 4
    assert summary.floor_fail_half_floor.k == 1
    assert [point.success.k for point in summary.success_curve] == [1, 1, 1, 1, 1]
    assert summary.groups.difficulty["easy"].n == 3
    assert summary.errors == {"the simulator ended": 1}


def test_a_failure_of_infrastructure_has_a_column_of_its_own_and_is_in_no_rate() -> None:
    away = a_record(TASKS["t-3"], a_result("model_unreachable", floor=None, object=None, final_height_m=None))
    told = json.loads(summarize(TASKS, [*RECORDS, away], 9.0).model_dump_json())
    without = json.loads(summarize(TASKS, RECORDS, 9.0).model_dump_json())
    assert (told["tasks"], told["infrastructure"], without["infrastructure"]) == (4, 1, 0)
    assert told["outcomes"] == without["outcomes"] | {"unreachable": 1}
    rates = ("success", "floor_fail", "floor_fail_half_floor", "recognition_fail", "spl", "success_curve", "groups")
    assert {name: told[name] for name in rates} == {name: without[name] for name in rates}


def test_figures_do_not_depend_on_the_order_of_records() -> None:
    assert summarize(TASKS, RECORDS, 9.0) == summarize(TASKS, RECORDS[::-1], 9.0)


def test_a_run_without_episodes_has_no_rates() -> None:
    summary = summarize(TASKS, [], 0.0)
    assert summary.tasks == 0
    assert summary.success.rate is None
    assert summary.spl.horizontal is None
    assert summary.average_steps is None
    assert summary.outcomes == {}


def test_a_record_twice_or_of_another_set_is_refused() -> None:
    with pytest.raises(ValueError, match="more than one record of task t-0"):
        summarize(TASKS, [RECORDS[1], RECORDS[1]], 1.0)
    with pytest.raises(ValueError, match="t-9"):
        summarize(TASKS, [a_record(a_task("t-9"), delivered())], 1.0)


def test_two_runs_are_compared_on_the_tasks_that_both_flew() -> None:
    tasks = {f"t-{i}": a_task(f"t-{i}") for i in range(16)}
    lost = a_result("object_not_found")
    run = [a_record(task, delivered()) for task in tasks.values()]
    baseline = [a_record(task, delivered() if i < 2 else lost) for i, task in enumerate(tasks.values()) if i < 12]
    found = compare(tasks, run, baseline)
    assert (found.tasks, found.both, found.only_run, found.only_baseline, found.neither) == (12, 2, 10, 0, 0)
    # ten fair coins all on one side: 2 / 2^10
    assert found.success_p == pytest.approx(2 / 1024)
    assert found.success.mean == pytest.approx(10 / 12)
    # each success has SPL 10/20
    assert found.horizontal_spl.mean == pytest.approx(5 / 12)
    assert found.horizontal_spl.low is not None
    assert found.horizontal_spl.low > 0.0


def test_a_task_at_which_the_infrastructure_failed_is_not_compared() -> None:
    away = [a_record(task, a_result("service_unreachable", final_height_m=None)) for task in TASKS.values()]
    there = [a_record(task, delivered()) for task in TASKS.values()]
    assert compare(TASKS, there, away).tasks == 0
    assert compare(TASKS, there, [*there[:3], away[3]]).tasks == 3


def test_a_handful_of_tasks_gives_a_difference_but_no_interval() -> None:
    found = compare(TASKS, RECORDS, RECORDS)
    assert found.tasks == 3
    assert found.horizontal_spl.mean == 0.0
    assert (found.horizontal_spl.low, found.horizontal_spl.high, found.horizontal_spl_p) == (None, None, None)


def test_runs_without_a_task_in_common_tell_nothing() -> None:
    found = compare(TASKS, RECORDS[:1], RECORDS[1:2])
    assert (found.tasks, found.success_p, found.success.mean, found.horizontal_spl_p) == (0, 1.0, None, None)
