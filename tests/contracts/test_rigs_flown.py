"""Which rigs a mission takes: by name, as a document, scaled; and what is said of one that is none."""

import pytest
from pydantic import ValidationError

from contracts.cameras import BadRig, Rig, default_rig, flyable, pinhole_camera, rig_names, shipped_rig
from contracts.orchestrator import MissionSettings


@pytest.mark.parametrize("name", rig_names())
def test_every_shipped_rig_can_be_flown_by_its_name_and_is_recorded_whole(name: str) -> None:
    settings = MissionSettings.model_validate({"rig": name})
    assert settings.rig == shipped_rig(name)
    assert MissionSettings.model_validate_json(settings.model_dump_json()) == settings


def test_without_a_word_the_rig_is_the_papers_with_pictures_as_it_says() -> None:
    assert MissionSettings().rig_flown == default_rig()


def test_the_image_size_is_the_longer_side_and_the_aspect_stays() -> None:
    (wide,) = MissionSettings.model_validate({"rig": "front-wide", "image_size": 640}).rig_flown.cameras
    assert (wide.width, wide.height) == (640, 360)
    assert wide.right_deg == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("rig", "says"),
    [
        ("front-narrow", "there is no rig 'front-narrow'; there are front-wide, paper-five, paper-five-up"),
        ({"name": "none", "cameras": []}, "at least 1 item"),
        ({"name": "x", "cameras": [{"name": "front", "width": 800}]}, "Field required"),
        (
            Rig(name="aside", cameras=(pinhole_camera("l", 80, 60, horizontal_fov_deg=90.0, heading_deg=-40.0),)),
            "rig aside has no camera that looks ahead",
        ),
        (
            Rig(name="fine", cameras=(pinhole_camera("front", 4000, 3000, horizontal_fov_deg=90.0),)),
            "camera front has 4000 x 3000 pixels; at most 2560000",
        ),
    ],
)
def test_a_rig_that_is_none_is_told_with_what_would_be_right(rig: object, says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        MissionSettings.model_validate({"rig": rig})


def test_a_rig_too_fine_to_be_flown_can_be_flown_smaller() -> None:
    fine = Rig(name="fine", cameras=(pinhole_camera("front", 4000, 3000, horizontal_fov_deg=90.0),))
    with pytest.raises(BadRig, match="4000 x 3000"):
        flyable(fine)
    assert MissionSettings(rig=fine, image_size=1600).rig_flown.cameras[0].height == 1200
