import numpy as np
import pytest

from services.sim.geometry.textures import SIZE, UnknownTexture, base_textures


def test_layer_0_is_plain_white() -> None:
    textures = base_textures()
    assert textures.layer("plain") == 0
    assert (textures.images[0] == 255).all()


def test_an_unknown_texture_names_those_there_are() -> None:
    with pytest.raises(UnknownTexture, match="brick"):
        base_textures().layer("velvet")


def test_pictures_are_added_after_the_base_layers_and_keep_their_colours() -> None:
    red = np.zeros((20, 30, 3), np.uint8)
    red[..., 0] = 200
    base = base_textures()
    more = base.with_pictures([("poster", red)])
    assert more.layer("poster") == len(base.names)
    assert more.layer("brick") == base.layer("brick")
    assert (more.images[-1] == [200, 0, 0]).all()
    assert more.tile_m[-1] == 1.0


def test_two_textures_of_one_name_are_refused() -> None:
    picture = np.zeros((4, 4, 3), np.uint8)
    with pytest.raises(ValueError, match="brick"):
        base_textures().with_pictures([("brick", picture)])


@pytest.mark.parametrize("name", ["plaster", "brick", "concrete", "stone", "roof_tile", "grass", "leaves", "asphalt"])
def test_tiled_layers_repeat_without_a_seam(name: str) -> None:
    image = base_textures().images[base_textures().layer(name)].astype(np.float64)
    inside = np.abs(np.diff(image, axis=1)).mean(axis=(0, 2))
    seam = np.abs(image[:, 0] - image[:, -1]).mean()
    assert seam <= inside.max() + 2.0
    assert image.shape == (SIZE, SIZE, 3)
