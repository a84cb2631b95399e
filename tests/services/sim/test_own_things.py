"""Classes of objects and textures from a folder, without any code."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest

from contracts.cameras import default_rig
from contracts.scene import WindowPlace
from contracts.sim import Catalogue, Episode, Truth
from service_kit.settings import BadSetting
from services.sim.catalogue import registry
from services.sim.catalogue.folder import layer_of, with_own_things
from services.sim.geometry.textures import TextureSet, base_textures
from tests.load.processes import service
from tests.services.sim.conftest import make_yard

PYRAMID = "v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nv 1 4 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 4 3 2 1\n"
THINGS = """
[objects.small_pyramid]
category = "ornaments"
phrase = "pyramid"
colours = ["red", "blue"]
places = ["sill", "free"]
mesh = "pyramid.obj"
up = "y"
height_m = 0.8

[objects.chessboard_poster]
category = "posters"
phrase = "chessboard poster"
colours = ["white"]
places = ["wall"]
picture = "board.png"
width_m = 0.6

[textures]
brick = {picture = "board.png", tile_m = 2.0}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "things.toml").write_text(THINGS)
    (tmp_path / "pyramid.obj").write_text(PYRAMID)
    board = np.kron(np.indices((8, 4)).sum(axis=0) % 2, np.ones((16, 16))).astype(np.uint8) * 255
    cv2.imwrite(str(tmp_path / "board.png"), cv2.merge([board, board, board]))
    return tmp_path


@pytest.fixture(autouse=True)
def as_it_was() -> Iterator[None]:
    """The catalogue is this process's own."""
    before = dict(registry._table)
    yield
    registry._table.clear()
    registry._table.update(before)
    registry.build.cache_clear()


@pytest.fixture(scope="module")
def textures() -> TextureSet:
    return base_textures()


def test_a_mesh_is_made_as_high_as_it_is_said_to_be_and_takes_the_named_colour(
    folder: Path, textures: TextureSet
) -> None:
    taken = with_own_things(folder, textures)
    mesh = registry.build("small_pyramid", "red", taken)
    low, high = mesh.bounds
    assert (high - low).tolist() == pytest.approx([0.4, 0.4, 0.8])
    assert low[2] == 0.0  # it stands on its underside
    assert len({tuple(colour) for colour in mesh.colours.tolist()}) == 1
    entry = next(e for e in registry.listed() if e.kind == "small_pyramid")
    assert (entry.phrase, entry.size_m) == ("pyramid", (0.4, 0.4, 0.8))


def test_a_picture_hangs_in_its_own_proportions_and_textures_are_replaced(folder: Path, textures: TextureSet) -> None:
    taken = with_own_things(folder, textures)
    low, high = registry.build("chessboard_poster", "white", taken).bounds
    assert (high - low).tolist() == pytest.approx([0.03, 0.6, 1.2], abs=1e-3)
    assert taken.images[taken.layer(layer_of("chessboard_poster"))].std() > 100
    brick = taken.layer("brick")
    assert float(taken.tile_m[brick]) == 2.0
    assert not np.array_equal(taken.images[brick], textures.images[brick])


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("mesh = ", "# mesh = "), "give either a mesh or a picture"),
        (('"red", "blue"', '"mauve"'), "there is no colour 'mauve'; there are red"),
        (("height_m = 0.8", ""), "a mesh needs height_m"),
        (('"pyramid.obj"', '"sphere.obj"'), "No such file"),
        (('"pyramid.obj"', '"board.png"'), "board.png is no mesh that can be read"),
        (('picture = "board.png"\nwidth', 'picture = "pyramid.obj"\nwidth'), "pyramid.obj is no picture"),
        (('places = ["wall"]', 'places = ["sill"]'), "a picture can be on wall or pane only"),
        (("small_pyramid", "flower_pot"), "class flower_pot is listed twice"),
        (("brick =", "velvet ="), "there is no texture 'velvet'; there are plain"),
        (("[textures]", "[textures"), "is not TOML"),
    ],
)
def test_what_is_wrong_in_the_folder_is_said(
    folder: Path, textures: TextureSet, change: tuple[str, str], problem: str
) -> None:
    import services.sim.catalogue  # noqa: F401 - lists the classes that are there

    (folder / "things.toml").write_text(THINGS.replace(*change))
    with pytest.raises(BadSetting, match=problem) as raised:
        with_own_things(folder, textures)
    assert "things.toml" in str(raised.value)


def test_a_simulator_with_a_folder_lists_and_shows_what_is_in_it(folder: Path) -> None:
    pot = make_yard().objects[0]
    place = pot.place
    assert isinstance(place, WindowPlace)
    low = place.model_copy(update={"floor": 1})
    thing = pot.model_copy(update={"kind": "small_pyramid", "colour": "red", "place": low})
    with (
        service("services.sim", {"SIM_THINGS": str(folder), "SIM_TRUTH": "on"}) as sim,
        httpx.Client(base_url=sim.url, timeout=120) as http,
    ):
        kinds = {e.kind for e in Catalogue.model_validate_json(http.get("/v1/catalogue").content).entries}
        assert {"small_pyramid", "chessboard_poster", "flower_pot"} <= kinds
        scene = make_yard(objects=(thing,)).model_dump(mode="json")
        episode = Episode.model_validate_json(http.post("/v1/episodes", json={"scene": scene}).content)
        asked = {"cameras": [camera.model_dump() for camera in default_rig().cameras]}
        told = Truth.model_validate_json(http.post(f"/v1/episodes/{episode.id}/truth", json=asked).content)
        assert {t.kind for view in told.views for t in view.objects} == {"small_pyramid"}
