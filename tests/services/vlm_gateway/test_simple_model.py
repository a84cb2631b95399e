"""The shipped model on pictures of the shipped samples; what is in them is in `labels.jsonl` beside them."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from contracts.labelled import LABELS_FILE, LabelledView
from contracts.vlm_gateway import MarkedPoint
from services.vlm_gateway.embedded.evaluate import meets, overlap
from services.vlm_gateway.embedded.seen import Still
from services.vlm_gateway.embedded.simple import SimpleModel as EmbeddedModel
from services.vlm_gateway.embedded.words import OutOfVocabulary

FOLDER = Path(__file__).parents[2] / "data" / "embedded"
LABELS = [LabelledView.model_validate_json(line) for line in (FOLDER / LABELS_FILE).read_text().splitlines()]
GOALS = {v.scene: o for v in LABELS for o in v.truth.objects if o.goal}


@pytest.fixture(scope="module")
def model() -> EmbeddedModel:
    return EmbeddedModel()


def picture(view: LabelledView) -> Still:
    bgr = cv2.imread(str(FOLDER / view.picture))
    assert bgr is not None
    return Still(np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8))


@pytest.mark.parametrize("view", [v for v in LABELS if v.frontal], ids=lambda v: v.picture)
def test_floors_and_the_building_are_read_from_a_frontal_picture(model: EmbeddedModel, view: LabelledView) -> None:
    rgb = picture(view)
    seen = model.count_floors(rgb)
    assert seen.count == len(view.truth.floor_rows)
    assert list(seen.rows) == sorted(seen.rows)
    np.testing.assert_allclose(seen.rows, sorted(view.truth.floor_rows), atol=0.04)
    building = model.building_box(rgb)
    truth = view.truth.building_box
    assert building is not None
    assert truth is not None
    assert overlap((building.box.y_min, building.box.y_max), (truth.y_min, truth.y_max)) > 0.8


@pytest.mark.parametrize("view", [v for v in LABELS if not v.frontal], ids=lambda v: v.picture)
def test_the_goal_is_found_where_it_is(model: EmbeddedModel, view: LabelledView) -> None:
    goal = GOALS[view.scene]
    best = model.find_object([picture(view)], f"{goal.colour} {goal.kind.replace('_', ' ')}").sightings[0]
    assert best.view_index == 0
    assert meets(best.box, goal.box)


def test_the_view_that_shows_the_thing_is_named(model: EmbeddedModel) -> None:
    scene = [v for v in LABELS if v.scene == "green-flower-pot"]
    views = sorted(scene, key=lambda v: any(o.goal for o in v.truth.objects))
    seen = model.find_object([picture(v) for v in views], "the green flower pot").sightings
    assert seen[0].view_index == len(views) - 1


@pytest.mark.parametrize("view", LABELS, ids=lambda v: v.picture)
@pytest.mark.parametrize("phrase", ["purple teddy bear", "pink armchair", "orange traffic cone"])
def test_nothing_is_claimed_where_nothing_of_the_kind_is(model: EmbeddedModel, view: LabelledView, phrase: str) -> None:
    assert model.find_object([picture(view)], phrase).sightings == ()


def test_an_unknown_thing_is_refused_and_not_guessed(model: EmbeddedModel) -> None:
    with pytest.raises(OutOfVocabulary, match="grand piano"):
        model.find_object([picture(LABELS[0])], "green grand piano")


def test_a_blank_picture_holds_neither_floors_nor_things(model: EmbeddedModel) -> None:
    sky = Still(np.full((800, 800, 3), (150, 190, 230), np.uint8))
    assert model.count_floors(sky).count == 0
    assert model.find_object([sky], "red kite").sightings == ()


def test_the_way_hugs_the_facade_unless_it_is_short(model: EmbeddedModel) -> None:
    rgb = picture(LABELS[0])

    def chosen(*distances_m: float) -> str:
        points = [
            MarkedPoint(label=label, x=k / 6, y=0.5, distance_m=d)
            for k, (label, d) in enumerate(zip("abcde", distances_m, strict=True), start=1)
        ]
        return model.choose_direction(rgb, points)

    assert chosen(10, 10, 10, 10, 10) == "e"
    assert chosen(10, 10, 10, 9, 1.5) == "d"
    assert chosen(10, 10, 10, 2, 1.5) == "c"


def test_a_smaller_picture_is_understood_too(model: EmbeddedModel) -> None:
    view = next(v for v in LABELS if v.picture == "temple-vase-goal.jpg")
    smaller = Still(np.asarray(cv2.resize(picture(view).rgb(), (600, 600), interpolation=cv2.INTER_AREA), np.uint8))
    goal = GOALS[view.scene]
    assert meets(model.find_object([smaller], "blue vase").sightings[0].box, goal.box)
