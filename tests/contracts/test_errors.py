"""What a validation problem says to people."""

from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from contracts.base import Rgb
from contracts.cameras import BadRig, Rig, parse_rig, pinhole_camera
from contracts.errors import first_problem, what_is_wrong
from contracts.scene import Scene
from orchestrator import sample_library

TWICE = "rig twice: names of cameras must be unique"
CAMERA = '[[cameras]]\nname = "a"\nwidth = 64\nheight = 64\nhorizontal_fov_deg = 90\n'


def test_a_sentence_of_ours_is_told_without_the_librarys_words_before_it() -> None:
    front = pinhole_camera("front", 64, 64, horizontal_fov_deg=90.0)
    with pytest.raises(ValidationError) as refused:
        Rig(name="twice", cameras=(front, front))
    assert what_is_wrong(refused.value.errors()[0]).startswith(TWICE)
    assert first_problem(refused.value).startswith(TWICE)


@pytest.mark.parametrize(
    ("place", "field", "said"),
    [
        (("objects", 0), "color", "objects.0.color: there is no such field (did you mean 'colour'?)"),
        (
            ("objects", 0, "place"),
            "flor",
            "objects.0.place.window.flor: there is no such field (did you mean 'floor'?)",
        ),
        (("objects", 0), "flor", "objects.0.flor: there is no such field"),
        (("start",), "yew", "start.yew: there is no such field (did you mean 'yaw'?)"),
        ((), "building", "building: there is no such field (did you mean 'buildings'?)"),
    ],
)
def test_a_field_that_there_is_not_is_told_with_the_nearest_beside_it(
    place: tuple[str | int, ...], field: str, said: str
) -> None:
    document = sample_library.load("green-flower-pot").scene.model_dump(mode="json")
    within: Any = document
    for part in place:
        within = within[part]
    within[field] = 1
    with pytest.raises(ValidationError) as refused:
        Scene.model_validate(document)
    assert first_problem(refused.value) == said


def test_a_colour_in_capitals_is_told_how_to_be_written() -> None:
    with pytest.raises(ValidationError) as refused:
        TypeAdapter(Rgb).validate_python("#C03A2B")
    assert first_problem(refused.value) == "write the colour as #rrggbb in lower case, such as #c03a2b, not '#C03A2B'"


def test_a_rig_file_that_is_wrong_says_so_in_our_words() -> None:
    with pytest.raises(BadRig, match=f"^my.toml is not a rig: {TWICE}"):
        parse_rig('name = "twice"\n' + CAMERA + CAMERA, "my.toml")
