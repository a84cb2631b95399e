"""The model as it ships, on pictures of the shipped samples; what is in them is in `labels.jsonl` beside them."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from contracts.base import Wire
from contracts.geometry import Box, Pose
from contracts.sim import TruthView
from services.vlm_gateway.embedded.model import EmbeddedModel
from services.vlm_gateway.embedded.seen import Still
from services.vlm_gateway.embedded.words import OutOfVocabulary

FOLDER = Path(__file__).parents[2] / "data" / "embedded"


class LabelledView(Wire):
    """One picture of a sample; `frontal`: squarely before the facade, as when floors are counted."""

    picture: str
    scene: str
    seed: int
    frontal: bool
    pose: Pose
    truth: TruthView


LABELS = [LabelledView.model_validate_json(line) for line in (FOLDER / "labels.jsonl").read_text().splitlines()]
GOALS = {v.scene: o for v in LABELS for o in v.truth.objects if o.goal}


@pytest.fixture(scope="module")
def model() -> EmbeddedModel:
    return EmbeddedModel()


def picture(view: LabelledView) -> Still:
    bgr = cv2.imread(str(FOLDER / view.picture))
    assert bgr is not None
    return Still(np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8))


def middle_in(claimed: Box, thing: Box) -> bool:
    x, y = (claimed.x_min + claimed.x_max) / 2, (claimed.y_min + claimed.y_max) / 2
    return thing.x_min <= x <= thing.x_max and thing.y_min <= y <= thing.y_max


@pytest.mark.parametrize("view", [v for v in LABELS if v.frontal], ids=lambda v: v.picture)
def test_floors_and_the_building_are_read_from_a_frontal_picture(model: EmbeddedModel, view: LabelledView) -> None:
    shot = picture(view)
    seen = model.count_floors(shot)
    assert seen.count == len(view.truth.floor_rows)
    np.testing.assert_allclose(seen.rows, sorted(view.truth.floor_rows), atol=0.02)
    building = model.building_box(shot)
    truth = view.truth.building_box
    assert building is not None
    assert truth is not None
    assert (building.box.y_min, building.box.y_max) == pytest.approx((truth.y_min, truth.y_max), abs=0.08)


@pytest.mark.parametrize("view", [v for v in LABELS if v.frontal], ids=lambda v: v.picture)
def test_floors_of_a_dark_facade_are_counted_too(model: EmbeddedModel, view: LabelledView) -> None:
    dark = Still(np.asarray(picture(view).rgb() * 0.12, np.uint8))
    assert model.count_floors(dark).count == len(view.truth.floor_rows)


@pytest.mark.parametrize("view", [v for v in LABELS if not v.frontal], ids=lambda v: v.picture)
def test_the_goal_is_claimed_where_it_is(model: EmbeddedModel, view: LabelledView) -> None:
    goal = GOALS[view.scene]
    found = model.find_object([picture(view)], f"{goal.colour} {goal.kind.replace('_', ' ')}")
    best = found.sightings[0]
    assert best.confidence >= found.claim
    assert middle_in(best.box, goal.box)


def test_the_view_that_shows_the_thing_is_named(model: EmbeddedModel) -> None:
    scene = [v for v in LABELS if v.scene == "green-flower-pot"]
    views = sorted(scene, key=lambda v: any(o.goal for o in v.truth.objects))
    seen = model.find_object([picture(v) for v in views], "the green flower pot").sightings
    assert seen[0].view_index == len(views) - 1


@pytest.mark.parametrize("view", LABELS, ids=lambda v: v.picture)
@pytest.mark.parametrize("phrase", ["purple teddy bear", "pink armchair", "orange traffic cone"])
def test_nothing_is_claimed_where_nothing_of_the_kind_is(model: EmbeddedModel, view: LabelledView, phrase: str) -> None:
    found = model.find_object([picture(view)], phrase)
    assert [s for s in found.sightings if s.confidence >= found.claim] == []


def test_an_unknown_thing_is_refused_and_not_guessed(model: EmbeddedModel) -> None:
    with pytest.raises(OutOfVocabulary, match="grand piano"):
        model.find_object([picture(LABELS[0])], "green grand piano")


def test_a_blank_picture_holds_neither_floors_nor_things(model: EmbeddedModel) -> None:
    sky = Still(np.full((800, 800, 3), (150, 190, 230), np.uint8))
    assert model.count_floors(sky).count == 0
    assert model.find_object([sky], "red kite").sightings == ()


def test_a_smaller_picture_is_understood_too(model: EmbeddedModel) -> None:
    view = next(v for v in LABELS if v.picture == "temple-vase-goal.jpg")
    smaller = Still(np.asarray(cv2.resize(picture(view).rgb(), (600, 600), interpolation=cv2.INTER_AREA), np.uint8))
    goal = GOALS[view.scene]
    assert middle_in(model.find_object([smaller], "blue vase").sightings[0].box, goal.box)
