"""The shipped set is what it says it is, and what the generator makes; requests are filled with what the task wants."""

from collections import Counter
from collections.abc import Iterator

import pytest

from contracts.scene import Air, Wind
from evaluation.scene_generator.building_plans import SKETCHES
from evaluation.scene_generator.footprints import difficulty_of
from evaluation.sim_client import SimClient, own_simulator
from evaluation.task_set.generate import MAX_TASKS, make_task, wanted_tasks
from evaluation.task_set.proof import NotSolvable, prove
from evaluation.task_set.requests import Fill, filled, in_words, ordinal, templates
from evaluation.task_set.shortest import FIRST, OWN_CLEARANCE_M, SECOND, ways
from evaluation.task_set.task_counts import count_tasks
from evaluation.task_set.task_files import TaskSet, load, shipped_set_of
from tests.evaluation.evaluation_kit import a_task


@pytest.fixture(scope="module")
def simulator() -> Iterator[SimClient]:
    with own_simulator() as client:
        yield client


@pytest.fixture(scope="module")
def shipped() -> TaskSet:
    return load("vld-300")


def test_the_shipped_set_has_the_promised_spread(shipped: TaskSet) -> None:
    found = count_tasks(shipped)
    assert (found.tasks, found.buildings) == (300, len(SKETCHES)) == (300, 22)
    assert set(found.building_kind.values()) & {0} == set() == set(found.category.values()) & {0}
    assert found.difficulty["hard"] >= 45
    assert min(found.difficulty.values()) >= 45
    assert found.highest_building_floors == 24
    assert len(found.footprint) >= 5
    assert len(found.sky) == 4
    assert min(found.decoys.values()) >= 60
    assert 100 <= found.with_neighbours <= 250


def test_the_shipped_set_keeps_to_the_seeds_of_the_test_set(shipped: TaskSet) -> None:
    assert all(200_000 <= task.seed <= 299_999 for task in shipped.tasks)
    assert len({task.seed for task in shipped.tasks}) == 300


def test_the_tasks_of_a_building_share_its_document(shipped: TaskSet) -> None:
    documents: dict[str, set[str]] = {}
    for task in shipped.tasks:
        one = "".join(b.model_dump_json() for b in task.scene.buildings)
        documents.setdefault(task.building, set()).add(one)
    assert {len(d) for d in documents.values()} == {1}


def test_no_other_thing_of_the_building_fits_the_request_on_that_floor(shipped: TaskSet) -> None:
    for task in shipped.tasks:
        assert task.difficulty == difficulty_of(task.corners)
        twins = [
            o
            for o in task.scene.objects
            if o.id != task.scene.goal
            and (o.kind, o.colour) == (task.object_kind, task.object_colour)
            and o.place.at == "window"
            and o.place.building == task.scene.target
        ]
        assert all(o.place.at == "window" and abs(o.place.floor - task.floor) >= 4 for o in twins)


def test_the_generator_makes_the_shipped_tasks_again(shipped: TaskSet, simulator: SimClient) -> None:
    catalogue = simulator.catalogue()
    for number in (85, 210):
        assert (
            make_task(wanted_tasks(200_000, 300)[number - 1], "vld-300", simulator, catalogue)
            == shipped.tasks[number - 1]
        )


def test_a_delivery_that_cannot_be_made_is_not_proved(simulator: SimClient) -> None:
    task = a_task()
    assert prove(task.scene, simulator, SECOND).way.clearance_m == OWN_CLEARANCE_M
    goal = task.scene.objects[0]
    hidden = task.scene.model_copy(update={"objects": (goal.model_copy(update={"scale": 0.5}),)})
    wall = next(b for b in task.scene.buildings if b.id == "neighbour")
    moved = wall.model_copy(
        update={"footprint": tuple(p.model_copy(update={"x": p.x - 61.5, "y": p.y - 13.0}) for p in wall.footprint)}
    )
    shut = hidden.model_copy(update={"buildings": (task.scene.buildings[0], moved)})
    with pytest.raises(NotSolvable):
        prove(shut, simulator, SECOND)


def test_wind_and_sensors_that_err_do_not_make_a_delivery_impossible(simulator: SimClient) -> None:
    scene = a_task().scene
    storm = Air(wind=Wind(speed_m_s=12.0, towards=1.5708, gusts_m_s=3.0))
    rough = scene.model_copy(update={"air": storm, "sensors": "d435"})
    assert prove(rough, simulator, SECOND) == prove(scene, simulator, SECOND)


def test_a_task_is_of_the_shipped_set_whose_name_its_own_begins_with() -> None:
    assert [shipped_set_of(name) for name in ("vld-real-196", "vld-300-007", "s5-001")] == [
        "vld-real",
        "vld-300",
        "vld-300",
    ]


def test_the_shortest_way_round_a_corner_is_known_by_hand() -> None:
    straight = next(iter(ways(a_task().scene, SECOND)))
    # 9 m before the wall at x 10, the middle window at x 10, success from 3 m on
    assert straight.horizontal_m == pytest.approx(9.0 - 2.95, abs=0.3)
    lengths = [way.horizontal_m for way in ways(a_task(facade=1).scene, FIRST)]
    assert lengths == sorted(lengths)
    assert lengths[0] > straight.horizontal_m + 10.0


def test_difficulties_and_categories_are_spread_over_any_number_of_tasks() -> None:
    for number in (1, 4, 40, 300):
        wanted = wanted_tasks(7, number)
        assert [w.number for w in wanted] == list(range(1, number + 1))
    tally = Counter(w.category for w in wanted_tasks(7, 300))
    assert len(tally) == 8
    assert min(tally.values()) > 20
    with pytest.raises(ValueError, match="1 to"):
        wanted_tasks(7, MAX_TASKS + 1)


def test_every_template_can_be_filled_and_says_floor_and_object() -> None:
    fill = Fill(floor=12, thing="orange umbrella", decoy_floor=3, decoy="red kite", parcel="soup")
    for template in templates():
        request = filled(template, fill)
        assert "{" not in request
        assert "orange umbrella" in request
        assert any(word in request for word in ("12", "twelve", "twelfth"))
        assert "a orange" not in request


@pytest.mark.parametrize(
    ("number", "word", "place"),
    [(1, "one", "first"), (12, "twelve", "twelfth"), (20, "twenty", "twentieth"), (23, "twenty-three", "twenty-third")],
)
def test_numbers_in_words(number: int, word: str, place: str) -> None:
    assert (in_words(number), ordinal(number)) == (word, place)
