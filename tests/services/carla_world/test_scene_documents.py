"""Documents that say where scenes lie in CARLA, and those that say it wrong."""

from pathlib import Path

import pytest

from service_kit.errors import BadQuestion
from services.carla_world.frames import Origin
from services.carla_world.scene_documents import SceneDocuments

WHOLE = """
map = "Town10HD_Opt"
weather = "ClearNoon"
roof_m = 45.0
underground_m = -20.0

[origin]
x_m = -47.5
y_m = 20.0
z_m = 0.2

[[props]]
object = "goal"
blueprint = "static.prop.plantpot04"
position = { x = 3.0, y = -6.2, z = 9.9 }
yaw = 1.57
"""


def test_a_document_is_found_by_the_scenes_name(tmp_path: Path) -> None:
    (tmp_path / "street.toml").write_text(WHOLE)
    found = SceneDocuments(tmp_path).find("street")
    assert (found.map, found.frame) == ("Town10HD_Opt", Origin(-47.5, 20.0, 0.2))
    assert found.props[0].object == "goal"


def test_a_map_is_enough(tmp_path: Path) -> None:
    (tmp_path / "street.toml").write_text('map = "Town01"\n')
    assert SceneDocuments(tmp_path).find("street").frame == Origin()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "map"),
        ("map = 7", "map"),
        ('map = "Town01"\nroof = 3', "roof"),
        ('map = "Town01"\n[origin]\nx_m = nan', "origin.x_m"),
        ('map = "../../etc"', "map"),
        ("map = ", "not TOML"),
    ],
)
def test_a_document_that_is_none_is_refused_by_what_is_wrong_in_it(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "street.toml").write_text(text)
    with pytest.raises(BadQuestion, match=said) as refusal:
        SceneDocuments(tmp_path).find("street")
    assert "street.toml" in refusal.value.message


@pytest.mark.parametrize("name", ["elsewhere", "../street", ""])
def test_a_scene_without_one_is_refused_with_those_that_have_one(tmp_path: Path, name: str) -> None:
    (tmp_path / "street.toml").write_text(WHOLE)
    with pytest.raises(BadQuestion, match="there are: street"):
        SceneDocuments(tmp_path).find(name)
