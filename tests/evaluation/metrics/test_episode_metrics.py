"""The figures of episodes, by hand on small cases; and what each says of no episodes at all."""

import pytest

from evaluation.metrics.breakdown import breakdown, floor_group
from evaluation.metrics.collisions import collisions
from evaluation.metrics.floor_localization import floor_fail_rate, half_floor_fail_rate
from evaluation.metrics.model_calls import latency, model_calls
from evaluation.metrics.success import average_steps, recognition_fail_rate, success_curve, success_rate
from tests.evaluation.evaluation_kit import a_record, a_result, a_task, a_verdict, delivered

TASKS = {f"t-{i}": a_task(f"t-{i}") for i in range(6)}


def test_success_counts_broken_episodes_as_failures() -> None:
    records = [
        a_record(TASKS["t-0"], delivered()),
        a_record(TASKS["t-1"], a_result("wrong_window", a_verdict(right=False))),
        a_record(TASKS["t-2"], None, error="the simulator ended"),
    ]
    assert success_rate(records)[:2] == (1, 3)


def test_the_success_curve_grows_with_the_radius_and_never_forgives_anything_else() -> None:
    verdicts = [
        a_verdict(distance_m=1.9),
        a_verdict(distance_m=3.0),
        a_verdict(distance_m=6.5),
        a_verdict(distance_m=1.0, right=False),
        a_verdict(distance_m=1.0, sight=False),
        a_verdict(distance_m=1.0, collided=True),
    ]
    records = [a_record(task, a_result("delivered", v)) for task, v in zip(TASKS.values(), verdicts, strict=True)]
    curve = {point.radius_m: point.success.k for point in success_curve(records)}
    assert curve == {2.0: 1, 3.0: 2, 5.0: 2, 7.0: 3, 10.0: 3}
    assert all(point.success.n == 6 for point in success_curve(records))


def test_a_stop_beside_the_window_does_not_count_at_any_radius() -> None:
    record = a_record(TASKS["t-0"], a_result("not_in_front", a_verdict(in_front=False)))
    assert [point.success.k for point in success_curve([record])] == [0] * 5


def test_average_steps_are_of_successes_only() -> None:
    records = [
        a_record(TASKS["t-0"], delivered(steps=4)),
        a_record(TASKS["t-1"], delivered(steps=9)),
        a_record(TASKS["t-2"], a_result("object_not_found", steps=30)),
    ]
    assert average_steps(records) == 6.5
    assert average_steps(records[2:]) is None


def test_a_floor_is_missed_beyond_seven_metres_or_without_a_height() -> None:
    # the window of floor 3 is at 6 + 0.9 + 0.75 = 7.65 m
    heights = [7.5, 9.2, 14.6, 14.7, None, 0.6]
    records = [
        a_record(task, a_result("object_not_found", final_height_m=h))
        for task, h in zip(TASKS.values(), heights, strict=True)
    ]
    assert floor_fail_rate(TASKS, records)[:2] == (3, 6)
    # half a floor is 1.5 m: 9.2 is 1.55 off
    assert half_floor_fail_rate(TASKS, records)[:2] == (5, 6)


def test_recognition_fails_over_tasks_with_a_claim() -> None:
    records = [
        a_record(TASKS["t-0"], delivered()),
        a_record(TASKS["t-1"], a_result("wrong_window", a_verdict(right=False))),
        a_record(TASKS["t-2"], a_result("not_in_front", a_verdict(distance_m=5.0))),
        a_record(TASKS["t-3"], a_result("object_not_found")),
    ]
    assert recognition_fail_rate(records)[:2] == (1, 3)


def test_collisions_are_counted_once_a_task_wherever_they_show() -> None:
    records = [
        a_record(TASKS["t-0"], a_result("collision")),
        a_record(TASKS["t-1"], a_result("collision", a_verdict(collided=True))),
        a_record(TASKS["t-2"], delivered()),
        a_record(TASKS["t-3"], None, error="broke"),
    ]
    assert collisions(records) == 2


def test_model_calls_add_up_by_role() -> None:
    calls = model_calls([a_record(TASKS["t-0"], delivered()), a_record(TASKS["t-1"], delivered())])
    assert list(calls) == ["recognition"]
    assert (calls["recognition"].calls, calls["recognition"].cache_hits) == (6, 2)
    assert calls["recognition"].prompt_tokens == 60
    assert calls["recognition"].latency_s.n == 4
    assert calls["recognition"].latency_s.p50 == pytest.approx(0.3)


def test_percentiles_of_a_hundred_and_one_calls() -> None:
    found = latency([i / 100 for i in range(101)])
    assert (found.p50, found.p95, found.p99) == (0.5, 0.95, 0.99)


def test_groups_keep_their_order_and_every_task() -> None:
    tasks = {
        "a": a_task("a", difficulty="hard"),
        "b": a_task("b", difficulty="easy"),
        "c": a_task("c", difficulty="hard"),
    }
    records = [a_record(tasks["a"], delivered()), a_record(tasks["b"], delivered()), a_record(tasks["c"], None)]
    found = breakdown(tasks, records, lambda task: task.difficulty, ["easy", "moderate", "hard"])
    assert [(name, rate.k, rate.n) for name, rate in found.items()] == [("easy", 1, 1), ("hard", 1, 2)]


@pytest.mark.parametrize(("floor", "group"), [(1, "1-3"), (3, "1-3"), (4, "4-6"), (5, "4-6")])
def test_floors_fall_into_groups(floor: int, group: str) -> None:
    assert floor_group(a_task(floor=floor)) == group


def test_high_floors_fall_into_groups_too() -> None:
    assert [floor_group(a_task().model_copy(update={"floor": f})) for f in (7, 12, 13, 24)] == [
        *("7-12", "7-12"),
        *("13+", "13+"),
    ]


def test_without_episodes_there_are_no_figures_but_also_no_errors() -> None:
    assert success_rate([]) == (0, 0, None, None, None)
    assert [point.success.n for point in success_curve([])] == [0] * 5
    assert average_steps([]) is None
    assert floor_fail_rate({}, [])[:3] == (0, 0, None)
    assert half_floor_fail_rate({}, [])[:3] == (0, 0, None)
    assert recognition_fail_rate([])[:3] == (0, 0, None)
    assert collisions([]) == 0
    assert model_calls([]) == {}
    assert latency([]).p50 is None
    assert breakdown({}, [], lambda task: task.style) == {}
