"""What the catalogue promises about its classes: names, sizes, sound meshes, errors that help."""

from collections import Counter
from typing import get_args

import numpy as np
import pytest

from contracts.sim import CatalogueEntry
from services.sim.catalogue import (
    CATALOGUE,
    COLOURS,
    UnknownClass,
    UnknownColour,
    build,
    entries,
    poster_layers,
)
from services.sim.catalogue.sheet import catalogue_textures
from services.sim.geometry.mesh import Mesh
from services.sim.geometry.scene_mesh import UnknownObject
from services.sim.geometry.textures import TextureSet

STANDING = {"sill", "balcony", "free"}
MOUNTED = {"wall", "pane"}
HANGING = {"hang"}

each_entry = pytest.mark.parametrize("entry", entries(), ids=lambda entry: entry.kind)


@pytest.fixture(scope="module")
def textures() -> TextureSet:
    return catalogue_textures()


def test_there_are_at_least_48_classes_and_five_in_each_of_the_papers_categories() -> None:
    counts = Counter(entry.category for entry in entries())
    assert len(entries()) >= 48
    assert set(counts) == set(get_args(CatalogueEntry.model_fields["category"].annotation))
    assert min(counts.values()) >= 5


def test_most_classes_come_in_four_or_more_colours_and_all_colours_have_a_name() -> None:
    assert sum(len(entry.colours) >= 4 for entry in entries()) >= 0.9 * len(entries())
    assert {colour for entry in entries() for colour in entry.colours} == set(COLOURS)


def test_no_two_classes_share_a_kind_or_anything_they_are_called() -> None:
    kinds = [entry.kind for entry in entries()]
    names = [name.casefold() for entry in entries() for name in (entry.phrase, *entry.synonyms)]
    assert len(set(kinds)) == len(kinds)
    assert [name for name, n in Counter(names).items() if n > 1] == []


def test_at_least_six_posters_and_a_picture_for_each_of_them() -> None:
    posters = [entry for entry in entries() if entry.category == "posters"]
    assert len(posters) >= 6
    assert len(poster_layers()) == len(posters)
    for _, picture in poster_layers():
        assert picture.dtype == np.uint8
        assert picture.std() > 20


@each_entry
def test_a_class_stands_or_is_mounted_or_hangs_so_that_its_origin_is_never_in_doubt(entry: CatalogueEntry) -> None:
    assert entry.places
    assert any(set(entry.places) <= mount for mount in (STANDING, MOUNTED, HANGING))
    if "sill" in entry.places:
        assert max(entry.size_m[1:]) <= 1.35


@each_entry
def test_a_class_is_as_large_as_it_says_and_visible_from_afar(entry: CatalogueEntry, textures: TextureSet) -> None:
    assert 0.3 <= max(entry.size_m) <= 1.6
    low, high = build(entry.kind, entry.colours[0], textures).bounds
    assert high - low == pytest.approx(np.array(entry.size_m), abs=0.011)


@each_entry
def test_the_origin_is_where_the_places_say(entry: CatalogueEntry, textures: TextureSet) -> None:
    low, high = build(entry.kind, entry.colours[0], textures).bounds
    middle = (low + high) / 2
    assert middle[1] == pytest.approx(0, abs=1e-4)
    if set(entry.places) <= MOUNTED:
        assert (low[0], middle[2]) == pytest.approx((0, 0), abs=1e-4)
    else:
        assert middle[0] == pytest.approx(0, abs=1e-4)
        assert (high[2] if set(entry.places) <= HANGING else low[2]) == pytest.approx(0, abs=1e-4)


@each_entry
def test_every_colour_gives_a_light_and_sound_mesh(entry: CatalogueEntry, textures: TextureSet) -> None:
    for colour in entry.colours:
        mesh = build(entry.kind, colour, textures)
        assert 0 < mesh.triangle_count <= 600
        for values in (mesh.positions, mesh.normals, mesh.uv):
            assert np.isfinite(values).all()
        assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-3)
        assert mesh.faces.max() < mesh.vertex_count
        assert (_facing(mesh) > 0).all(), "faces must run counter-clockwise about their normals"


@each_entry
def test_a_closed_thing_is_not_inside_out(entry: CatalogueEntry, textures: TextureSet) -> None:
    mesh = build(entry.kind, entry.colours[0], textures)
    a, b, c = (mesh.positions[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 > 0


def test_the_same_question_gives_the_same_bytes(textures: TextureSet) -> None:
    for entry in entries():
        question = (entry.kind, entry.colours[0], textures)
        assert _bytes(build(*question)) == _bytes(build.__wrapped__(*question)), entry.kind


def test_an_unknown_class_is_told_the_nearest_one_and_all_others(textures: TextureSet) -> None:
    with pytest.raises(UnknownClass, match=r"'flowerpot' \(did you mean 'flower_pot'\?\)") as caught:
        build("flowerpot", "red", textures)
    assert isinstance(caught.value, UnknownObject)
    assert all(entry.kind in str(caught.value) for entry in CATALOGUE.entries)


def test_an_unknown_colour_is_told_which_ones_the_class_comes_in(textures: TextureSet) -> None:
    with pytest.raises(UnknownColour, match=r"'whit' \(did you mean 'white'\?\); it comes in white$"):
        build("snowman", "whit", textures)


def test_a_silly_name_gets_no_suggestion(textures: TextureSet) -> None:
    with pytest.raises(UnknownClass) as caught:
        build("zzzzqqqq", "red", textures)
    assert "did you mean" not in str(caught.value)


def _facing(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.positions[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces].sum(axis=1, dtype=np.float64))


def _bytes(mesh: Mesh) -> bytes:
    arrays = (mesh.positions, mesh.normals, mesh.uv, mesh.colours, mesh.layer, mesh.faces)
    return b"".join(array.tobytes() for array in arrays)
