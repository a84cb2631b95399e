"""Streets to train on: the same for the same seed, sound, and never of a look that is held out."""

import math
from itertools import pairwise

import numpy as np
import pytest

from contracts.scene import Scene, WindowPlace
from contracts.scene_layout import facades, floor_outline, window_slot
from evaluation.scene_generator.footprints import distance_to_outline
from services.sim.catalogue import CATALOGUE, build
from services.sim.geometry.textures import base_textures
from training.looks import HELD_OUT_SKY, HELD_OUT_STRETCH, HELD_OUT_WALL, STRETCH, varied
from training.render import FIT_SEEDS, VALIDATION_SEEDS, colour_numbers, kind_numbers
from training.stops import NEAREST_M, looks
from training.streets import street

SEEDS = range(12)


def walls_of(scene: Scene) -> set[str]:
    return {b.style.wall for b in scene.buildings}


def test_the_same_seed_gives_the_same_street_and_another_another() -> None:
    assert street(CATALOGUE, 5) == street(CATALOGUE, 5)
    assert street(CATALOGUE, 5).scene != street(CATALOGUE, 6).scene


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_held_out_is_never_trained_on(seed: int) -> None:
    trained = street(CATALOGUE, seed).scene
    assert HELD_OUT_WALL not in walls_of(trained)
    assert trained.light.sky != HELD_OUT_SKY
    kept = street(CATALOGUE, seed, held_out=True).scene
    assert walls_of(kept) == {HELD_OUT_WALL}
    assert kept.light.sky == HELD_OUT_SKY


@pytest.mark.parametrize("seed", SEEDS)
def test_everything_stands_where_its_class_may(seed: int) -> None:
    scene = street(CATALOGUE, seed).scene
    entries = {e.kind: e for e in CATALOGUE.entries}
    for thing in scene.objects:
        place = thing.place
        assert isinstance(place, WindowPlace)
        assert place.on in entries[thing.kind].places
        assert thing.colour in entries[thing.kind].colours
        slot = window_slot(scene.building(place.building), place.facade, place.floor, place.column)
        assert (place.on != "balcony") or slot.balcony is not None


def test_crowded_streets_have_decoys_of_one_class_and_of_one_colour() -> None:
    crowded = next(
        s for seed in range(30) if (s := street(CATALOGUE, seed, sparse=False)) and len(s.scene.objects) > 60
    )
    looks_of = [(o.kind, o.colour) for o in crowded.scene.objects]
    pairs = list(pairwise(looks_of))
    assert any(a[0] == b[0] and a[1] != b[1] for a, b in pairs)
    assert sum(a[1] == b[1] for a, b in pairs) > len(pairs) * 0.1


@pytest.mark.parametrize("seed", SEEDS)
def test_the_camera_hangs_in_the_open_and_squarely_at_a_wall_for_floors(seed: int) -> None:
    place = street(CATALOGUE, seed)
    target = place.scene.building(place.scene.target)
    views = looks(place, 5, 2, np.random.default_rng(seed))
    assert len(views) >= 4
    for view in views:
        outline = floor_outline(target, 1)
        assert distance_to_outline((view.pose.x, view.pose.y), outline) >= NEAREST_M - 1e-6 or target.setback_m > 0
        assert view.pose.z >= 1.0
    facing = [math.atan2(-wall.normal[1], -wall.normal[0]) for wall in facades(target)]
    for view in views:
        if view.frontal:
            turns = [math.remainder(view.pose.yaw - a, 2 * math.pi) for a in facing]
            assert min(map(abs, turns)) < 0.15


def test_shapes_vary_within_what_is_trained_and_beyond_it_when_held_out() -> None:
    textures = base_textures()
    plain = build("teapot", "red", textures)
    size = np.ptp(plain.positions, axis=0)
    trained = [np.ptp(varied(build, s)("teapot", "red", textures).positions, axis=0) / size for s in range(20)]
    assert np.abs(np.array(trained) - 1).max() <= STRETCH + 1e-4
    assert np.abs(np.array(trained) - 1).max() > STRETCH / 3
    beyond = varied(build, 1, held_out=True)("teapot", "red", textures)
    stretched = np.abs(np.ptp(beyond.positions, axis=0) / size - 1)
    assert (stretched >= HELD_OUT_STRETCH[0] - 1e-4).all()


def test_no_seed_serves_two_purposes_and_every_class_has_its_number() -> None:
    assert set(FIT_SEEDS).isdisjoint(VALIDATION_SEEDS)
    assert max(VALIDATION_SEEDS) < 100_000
    assert sorted(kind_numbers().values()) == list(range(len(CATALOGUE.entries)))
    assert set(colour_numbers()) == {c for e in CATALOGUE.entries for c in e.colours}
