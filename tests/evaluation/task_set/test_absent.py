"""Tasks whose object is not there, and how a search that finds nothing is judged."""

import math

import pytest

from contracts.orchestrator import Stop
from evaluation.metrics.coverage import absence, windows_seen
from evaluation.metrics.summary import summarize
from evaluation.metrics.taxonomy import reason_of
from evaluation.task_set.absent import without_object, without_objects
from evaluation.task_set.task_files import lines_of, read
from tests.evaluation.evaluation_kit import a_record, a_result, a_task, a_verdict, stops

BARE = without_object(a_task("t-1"))
UP, LEFT, DOWN, RIGHT = math.pi / 2, math.pi, -math.pi / 2, 0.0
ROUND = stops(
    (5.0, -6.0, UP), (15.0, -6.0, UP), (26.0, 6.0, LEFT), (15.0, 18.0, DOWN), (5.0, 18.0, DOWN), (-6.0, 6.0, RIGHT)
)
NOTHING = a_result("object_not_found", stops=ROUND, inspected_share=0.99)


def test_the_object_is_gone_and_the_request_still_asks_for_it() -> None:
    task = a_task("t-1")
    assert (BARE.absent, task.absent) == (True, False)
    assert not BARE.scene.objects
    assert BARE.request == task.request
    assert without_object(BARE) == BARE


def test_a_set_without_objects_is_a_set_of_its_own() -> None:
    whole = read(lines_of([a_task("t-1"), a_task("t-2")]), "two")
    bare = without_objects(whole)
    assert [task.id for task in bare.tasks] == ["t-1-absent", "t-2-absent"]
    assert bare.checksum != whole.checksum
    assert bare.name == "two, absent"


def test_not_found_is_the_right_end_and_any_claim_the_wrong_one() -> None:
    assert reason_of(BARE, NOTHING) == "success"
    unjudged = a_verdict().model_copy(update={"judged": False, "right_window": None})
    assert reason_of(BARE, a_result("delivered", unjudged)) == "wrong_object"
    assert reason_of(BARE, a_result("floor_not_found", final_height_m=None)) == "floor"
    assert reason_of(a_task("t-1"), NOTHING) != "success"


def test_a_lap_sees_every_window_and_one_stop_those_before_it() -> None:
    assert all(windows_seen(BARE, a_record(BARE, NOTHING)))
    one = windows_seen(BARE, a_record(BARE, a_result("object_not_found", stops=ROUND[:1])))
    assert 0 < sum(one) < len(one) / 2
    away = stops((5.0, -6.0, DOWN))
    assert not any(windows_seen(BARE, a_record(BARE, a_result("object_not_found", stops=away)))[1:2])
    assert not any(windows_seen(BARE, a_record(BARE, None)))


def test_the_first_look_counts_where_the_floors_were_counted_and_earlier_stops_do_not() -> None:
    floors = tuple(stop.model_copy(update={"phase": "floors"}) for stop in ROUND[:2])
    whole, without_first = stops_seen(ROUND), stops_seen(ROUND[1:])
    assert sum(without_first) < sum(whole)
    assert stops_seen(floors[:1] + ROUND[1:], 6) == whole
    assert stops_seen(floors[:1] + ROUND[1:], 5) == without_first
    assert stops_seen(floors + ROUND[2:], 5) == without_first
    assert stops_seen(floors[:1], 1) == stops_seen(ROUND[:1])


def stops_seen(places: tuple[Stop, ...], looks: int | None = None) -> list[bool]:
    result = a_result("object_not_found", stops=places, exploration_steps=len(places) if looks is None else looks)
    return windows_seen(BARE, a_record(BARE, result))


def test_the_summary_tells_how_searches_for_nothing_ended_and_gives_them_no_spl() -> None:
    other = without_object(a_task("t-2"))
    tasks = {task.id: task for task in (BARE, other)}
    unjudged = a_verdict().model_copy(update={"judged": False, "right_window": None})
    summary = summarize(tasks, [a_record(BARE, NOTHING), a_record(other, a_result("delivered", unjudged))], 1.0)
    assert summary.absent is not None
    assert (summary.absent.not_found.k, summary.absent.claimed.k) == (1, 1)
    assert summary.absent.windows_seen.rate == pytest.approx(0.5)
    assert summary.absent.inspected_share == pytest.approx(0.99)
    assert summary.spl.horizontal is None
    assert summary.ideal_lap_spl is None


def test_a_run_in_which_nothing_is_missing_says_nothing_of_absence() -> None:
    task = a_task("t-1")
    assert absence({task.id: task}, [a_record(task, NOTHING)]) is None
