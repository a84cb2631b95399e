"""The embedded model's own work, by two networks whose answers are known: see `tiny_networks`."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.geometry import Box
from contracts.vlm_gateway import MarkedPoint
from services.vlm_gateway.embedded.exported import NAMER_FILE, Calibration, Proposing
from services.vlm_gateway.embedded.model import DARK, EmbeddedModel, brightened
from services.vlm_gateway.embedded.seen import Still
from services.vlm_gateway.embedded.words import OutOfVocabulary
from tests.services.vlm_gateway.tiny_networks import STRIDE, THING_PX, street, write_networks

Picture = NDArray[np.uint8]


class Counted:
    """A picture that says how often it was decoded."""

    def __init__(self, rgb: Picture, key: str) -> None:
        self._rgb, self._key = rgb, key
        self.decoded = 0

    @property
    def key(self) -> str:
        return self._key

    @property
    def focal_px(self) -> float | None:
        return None

    def rgb(self) -> Picture:
        self.decoded += 1
        return self._rgb


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_networks(tmp_path_factory.mktemp("weights"))


@pytest.fixture
def model(folder: Path) -> EmbeddedModel:
    return EmbeddedModel(folder)


def box_at(row: int, column: int, side: int = 320) -> tuple[float, float, float, float]:
    x, y = column * STRIDE, row * STRIDE
    return x / side, y / side, (x + THING_PX) / side, (y + THING_PX) / side


def edges(box: Box) -> tuple[float, float, float, float]:
    return box.x_min, box.y_min, box.x_max, box.y_max


CROWD = {(5, 5): "red target", (5, 20): "red plate", (20, 5): "blue target", (20, 30): "green plate"}


@pytest.mark.parametrize("place", CROWD, ids=str)
def test_the_thing_of_that_class_and_colour_is_found_among_its_like(
    model: EmbeddedModel, place: tuple[int, int]
) -> None:
    colour, kind = CROWD[place].split()
    found = model.find_object([Still(street(CROWD))], f"the {colour} {kind}")
    assert [s.confidence >= found.claim for s in found.sightings] == [True]
    np.testing.assert_allclose(edges(found.sightings[0].box), box_at(*place), atol=0.02)


def test_a_wider_picture_is_looked_at_with_as_many_pixels_a_degree(model: EmbeddedModel) -> None:
    """The same street in the left half of a picture with the same focal length, half its size in pixels."""
    crowd = street(CROWD)
    height, width = crowd.shape[:2]
    wide = cv2.copyMakeBorder(crowd, 0, 0, 0, width, cv2.BORDER_REPLICATE)
    half = np.asarray(cv2.resize(wide, (width, height // 2), interpolation=cv2.INTER_AREA), np.uint8)
    (usual,) = model.find_object([Still(crowd, width / 2)], "red plate").sightings
    (seen,) = model.find_object([Still(half, width / 4)], "red plate").sightings
    assert seen.box.x_min == pytest.approx(usual.box.x_min / 2, abs=0.02)
    assert seen.box.x_max == pytest.approx(usual.box.x_max / 2, abs=0.02)
    assert seen.box.y_max == pytest.approx(usual.box.y_max, abs=0.03)


def test_without_a_colour_all_of_the_class_are_meant_and_a_synonym_is_as_good(model: EmbeddedModel) -> None:
    found = model.find_object([Still(street(CROWD))], "dart board")
    assert len(found.sightings) == 2


def test_what_is_not_there_is_not_claimed(model: EmbeddedModel) -> None:
    assert model.find_object([Still(street(CROWD))], "green target").sightings == ()
    assert model.find_object([Still(street({}))], "green target").sightings == ()


def test_what_the_model_has_no_word_for_is_said_and_not_guessed(model: EmbeddedModel) -> None:
    with pytest.raises(OutOfVocabulary):
        model.find_object([Still(street(CROWD))], "red gramophone")


def test_views_are_told_apart_and_the_surest_comes_first(model: EmbeddedModel) -> None:
    pictures = [street({}), street({(5, 5): "red plate"}), street({(20, 20): "red plate", (5, 5): "blue plate"})]
    found = model.find_object([Still(p) for p in pictures], "red dish")
    assert sorted(s.view_index for s in found.sightings) == [1, 2]
    confidences = [s.confidence for s in found.sightings]
    assert confidences == sorted(confidences, reverse=True)


def test_the_confidence_is_the_calibrated_one(folder: Path, tmp_path: Path) -> None:
    sure = EmbeddedModel(folder).find_object([Still(street(CROWD))], "red plate").sightings[0].confidence
    modest = Calibration(score=(0.0, 1.0), probability=(0.0, 0.5))
    doubtful = EmbeddedModel(write_networks(tmp_path, calibration=modest))
    found = doubtful.find_object([Still(street(CROWD))], "red plate")
    assert sure > 0.9
    assert found.sightings[0].confidence == pytest.approx(0.5, abs=0.05)
    assert found.sightings[0].confidence < found.claim


def test_a_second_question_about_a_picture_looks_at_no_pixel_again(model: EmbeddedModel) -> None:
    views = [Counted(street(CROWD, rows=(10, 25)), f"picture {k}") for k in range(5)]
    assert model.find_object(views, "red plate").sightings
    assert model.find_object(views, "blue target").sightings
    assert model.count_floors(views[0]).count == 2
    assert model.building_box(views[0]) is not None
    assert [view.decoded for view in views] == [1] * 5


def test_only_pictures_not_seen_before_are_looked_at(model: EmbeddedModel) -> None:
    old, new = Counted(street(CROWD), "old"), Counted(street({(5, 5): "red plate"}), "new")
    model.count_floors(old)
    found = model.find_object([old, new, old], "red plate")
    assert sorted(s.view_index for s in found.sightings) == [0, 1, 2]
    assert (old.decoded, new.decoded) == (2, 1)  # the floors need no crops: these are cut when a thing is asked for


def test_what_is_remembered_is_bounded(folder: Path) -> None:
    model = EmbeddedModel(folder, remembered=2)
    views = [Counted(street({}), f"picture {k}") for k in range(3)]
    for view in (*views, views[2], views[0]):
        model.count_floors(view)
    assert [view.decoded for view in views] == [2, 1, 1]


def test_floors_are_the_rows_of_windows_with_their_places(model: EmbeddedModel) -> None:
    seen = model.count_floors(Still(street({}, rows=(8, 18, 28, 38), roof=4)))
    assert seen.count == 4
    np.testing.assert_allclose(seen.rows, [(r + 0.5) / 40 for r in (8, 18, 28, 38)], atol=0.01)


@pytest.mark.parametrize("share", [0.12, 0.3, 1.0])
def test_a_dark_picture_is_brightened_and_a_bright_one_left_as_it_is(share: float) -> None:
    rgb = np.asarray(share * np.random.default_rng(1).uniform(0, 255, (60, 80, 3)), np.uint8)
    seen = brightened(rgb)
    if share == 1.0:
        assert seen is rgb
        return
    assert float(seen.mean()) == pytest.approx(DARK, abs=8.0)
    darker_first = np.argsort(rgb, axis=None, kind="stable")
    assert (np.diff(seen.reshape(-1)[darker_first].astype(int)) >= 0).all()


def test_in_a_picture_that_is_all_but_black_nothing_is_brightened() -> None:
    black = np.zeros((40, 40, 3), np.uint8)
    black[0, 0] = 255
    assert brightened(black) is black


def test_rows_beyond_the_building_are_no_floors(model: EmbeddedModel) -> None:
    assert model.count_floors(Still(street({}, rows=(), roof=40))).count == 0


def test_the_building_is_what_is_not_sky(model: EmbeddedModel) -> None:
    seen = model.building_box(Still(street({}, roof=10)))
    assert seen is not None
    np.testing.assert_allclose(edges(seen.box), (0.0, 0.25, 1.0, 1.0), atol=0.01)
    assert model.building_box(Still(street({}, roof=40))) is None


def test_a_picture_of_another_size_and_shape_gives_the_same_boxes(model: EmbeddedModel) -> None:
    large = np.repeat(np.repeat(street(CROWD), 2, axis=0), 2, axis=1)
    np.testing.assert_allclose(
        edges(model.find_object([Still(large)], "red plate").sightings[0].box), box_at(5, 20), atol=0.02
    )
    low = street(CROWD)[:200]
    box = model.find_object([Still(low)], "red plate").sightings[0].box
    left, top, right, bottom = box_at(5, 20)
    np.testing.assert_allclose(edges(box), (left, top * 1.6, right, bottom * 1.6), atol=0.03)


def test_no_more_proposals_are_named_than_the_settings_allow(tmp_path: Path) -> None:
    model = EmbeddedModel(write_networks(tmp_path, proposing=Proposing(threshold=0.7, limit=2)))
    things = {(row, column): "red plate" for row in (3, 15, 27) for column in (3, 15, 27)}
    assert len(model.find_object([Still(street(things))], "red plate").sightings) == 2


@pytest.mark.parametrize(
    ("distances_m", "label"), [((10, 10, 10, 10, 10), "e"), ((10, 10, 10, 9, 1.5), "d"), ((10, 10, 10, 2, 1.5), "c")]
)
def test_the_way_hugs_the_facade_unless_it_is_short(
    model: EmbeddedModel, distances_m: tuple[float, ...], label: str
) -> None:
    points = [
        MarkedPoint(label=name, x=k / 6, y=0.5, distance_m=d)
        for k, (name, d) in enumerate(zip("abcde", distances_m, strict=True), start=1)
    ]
    on_the_right = street({}, roof=40)
    on_the_right[:, 200:] = 128
    assert model.choose_direction(Still(on_the_right), points) == label


def test_a_building_on_the_left_is_hugged_on_the_left(model: EmbeddedModel) -> None:
    points = [MarkedPoint(label=name, x=k / 6, y=0.5, distance_m=5) for k, name in enumerate("abcde", start=1)]
    on_the_left = street({}, roof=40)
    on_the_left[:, :120] = 128
    assert model.choose_direction(Still(on_the_left), points) == "a"


def test_it_says_how_large_it_is_and_from_where_on_it_claims(model: EmbeddedModel) -> None:
    assert 0.0 < float(str(model.about["megabytes"])) < 20.0
    assert model.about["claim"] == model.exported.claim


def test_files_that_are_missing_or_broken_are_told(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"model\.json"):
        EmbeddedModel(tmp_path)
    broken = write_networks(tmp_path / "broken")
    (broken / NAMER_FILE).write_bytes(b"no network")
    with pytest.raises(ValueError, match=r"namer\.onnx is no network"):
        EmbeddedModel(broken)


def test_seeing_needs_no_training_framework() -> None:
    code = (
        "import sys, services.vlm_gateway.embedded.model; "
        "print(sorted({'torch', 'onnx', 'services.sim', 'evaluation', 'training'} & set(sys.modules)))"
    )
    environment = {k: v for k, v in os.environ.items() if not k.startswith("COV")}
    said = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
