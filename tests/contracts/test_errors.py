"""What a validation problem says to people."""

import pytest
from pydantic import ValidationError

from contracts.cameras import BadRig, Rig, parse_rig, pinhole_camera
from contracts.errors import first_problem, what_is_wrong

TWICE = "rig twice: names of cameras must be unique"
CAMERA = '[[cameras]]\nname = "a"\nwidth = 64\nheight = 64\nhorizontal_fov_deg = 90\n'


def test_a_sentence_of_ours_is_told_without_the_librarys_words_before_it() -> None:
    front = pinhole_camera("front", 64, 64, horizontal_fov_deg=90.0)
    with pytest.raises(ValidationError) as refused:
        Rig(name="twice", cameras=(front, front))
    assert what_is_wrong(refused.value.errors()[0]).startswith(TWICE)
    assert first_problem(refused.value).startswith(TWICE)


def test_a_rig_file_that_is_wrong_says_so_in_our_words() -> None:
    with pytest.raises(BadRig, match=f"^my.toml is not a rig: {TWICE}"):
        parse_rig('name = "twice"\n' + CAMERA + CAMERA, "my.toml")
