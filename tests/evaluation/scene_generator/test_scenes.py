import math

import pytest

from contracts.scene import Scene, WindowPlace
from contracts.scene_layout import window_slot, window_slots
from contracts.sim import Catalogue, CatalogueEntry
from evaluation.scene_generator.footprints import (
    corners_between,
    difficulty_of,
    distance_to_outline,
    outline,
    outlines_gap,
    points,
)
from evaluation.scene_generator.placement import FLOOR_DECOY_APART
from evaluation.scene_generator.random_specs import random_spec
from evaluation.scene_generator.scene_plan import (
    DecoySpec,
    FootprintSpec,
    GoalSpec,
    SceneSpec,
    Surroundings,
    UnbuildableScene,
)
from evaluation.scene_generator.scenes import build_scene, scene_difficulty

COLOURS = ("red", "green", "blue", "yellow")
CATALOGUE = Catalogue(
    entries=(
        CatalogueEntry(
            kind="flower_pot", category="containers", phrase="flower pot", synonyms=(), colours=COLOURS,
            places=("sill", "balcony"), size_m=(0.4, 0.4, 0.6),
        ),
        CatalogueEntry(
            kind="duck", category="toys", phrase="duck", synonyms=(), colours=COLOURS, places=("sill",),
            size_m=(0.4, 0.4, 0.5),
        ),
        CatalogueEntry(
            kind="chair", category="furniture", phrase="chair", synonyms=(), colours=COLOURS, places=("balcony",),
            size_m=(0.6, 0.6, 1.0),
        ),
        CatalogueEntry(
            kind="poster", category="posters", phrase="poster", synonyms=(), colours=("green",),
            places=("pane", "wall"), size_m=(0.8, 0.02, 1.0),
        ),
    )
)  # fmt: skip
RECTANGLE = SceneSpec(
    name="block", kind="low_rise", footprint=FootprintSpec(width_m=24, depth_m=14), floors=6,
    goal=GoalSpec(kind="flower_pot", colour="green", floor=5, corners=1),
)  # fmt: skip


def walls(scene: Scene, building_id: str) -> tuple[tuple[float, float], ...]:
    return tuple((p.x, p.y) for p in scene.building(building_id).footprint)


@pytest.mark.parametrize(
    ("shape", "facades", "area"),
    [("rectangle", 4, 480.0), ("l", 6, 300.0), ("u", 8, 400.0), ("t", 8, 300.0), ("plus", 12, 0.0),
     ("octagon", 8, 745.58)],
)  # fmt: skip
def test_every_plan_runs_counterclockwise_and_encloses_its_area(shape: str, facades: int, area: float) -> None:
    size = {"octagon": 30.0}.get(shape, 24.0 if shape == "rectangle" else 30.0 if shape == "u" else 20.0)
    spec = FootprintSpec.model_validate(
        {"shape": shape, "width_m": size, "depth_m": 20.0, "arm_m": 20.0 / 2 if shape != "plus" else 200 / 15}
    )
    corners = outline(spec)
    twice = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    expected = {"u": 30 * 10 + 2 * 10 * 10, "plus": 2 * 20 * (200 / 15) - (200 / 15) ** 2}.get(shape, area)
    assert len(corners) == facades
    assert twice / 2 == pytest.approx(expected, rel=1e-4)


def test_a_clockwise_lap_meets_the_facades_in_falling_order() -> None:
    assert [corners_between(4, 0, k, "clockwise") for k in (0, 3, 2, 1)] == [0, 1, 2, 3]
    assert corners_between(4, 0, 1) == 1
    assert corners_between(8, 6, 1, "counterclockwise") == 3
    with pytest.raises(ValueError, match=r"facades 0\.\.3, not 0 and 4"):
        corners_between(4, 0, 4)


def test_difficulty_has_the_papers_bounds() -> None:
    assert [difficulty_of(n) for n in range(6)] == ["easy", "easy", "moderate", "moderate", "hard", "hard"]
    octagon = RECTANGLE.model_copy(
        update={"footprint": FootprintSpec(shape="octagon"), "goal": RECTANGLE.goal.model_copy(update={"corners": 4})}
    )
    assert scene_difficulty(octagon) == "hard"


def test_a_scene_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    first, again, other = (build_scene(RECTANGLE, seed, CATALOGUE) for seed in (5, 5, 6))
    assert first == again
    assert first.objects != other.objects


def test_more_trees_do_not_move_the_objects() -> None:
    bare = RECTANGLE.model_copy(update={"surroundings": Surroundings(trees=0)})
    assert build_scene(bare, 5, CATALOGUE).objects == build_scene(RECTANGLE, 5, CATALOGUE).objects


def test_the_goal_hangs_behind_as_many_corners_of_a_clockwise_lap_as_asked() -> None:
    for corners in range(4):
        spec = RECTANGLE.model_copy(update={"goal": RECTANGLE.goal.model_copy(update={"corners": corners})})
        scene = build_scene(spec, 1, CATALOGUE)
        place = next(o for o in scene.objects if o.id == scene.goal).place
        assert isinstance(place, WindowPlace)
        assert corners_between(4, 0, place.facade, "clockwise") == corners
        assert place.floor == 5


def test_decoys_are_what_they_are_called() -> None:
    spec = RECTANGLE.model_copy(
        update={
            "floors": 10,
            "decoys": tuple(DecoySpec.model_validate({"like": k}) for k in ("colour", "kind", "floor", "neighbour")),
            "surroundings": Surroundings(neighbours="street"),
        }
    )
    scene = build_scene(spec, 3, CATALOGUE)
    colour, kind, floor, neighbour = (next(o for o in scene.objects if o.id == f"decoy-{n}") for n in (1, 2, 3, 4))
    assert (colour.kind, colour.colour != "green") == ("flower_pot", True)
    assert (kind.kind != "flower_pot", kind.colour) == (True, "green")
    assert (floor.kind, floor.colour) == (neighbour.kind, neighbour.colour) == ("flower_pot", "green")
    assert isinstance(floor.place, WindowPlace)
    assert abs(floor.place.floor - 5) >= FLOOR_DECOY_APART
    assert isinstance(neighbour.place, WindowPlace)
    assert neighbour.place.building != scene.target


@pytest.mark.parametrize("seed", range(16))
def test_random_scenes_are_sound(seed: int) -> None:
    scene = build_scene(random_spec(CATALOGUE, seed), seed, CATALOGUE)
    target = walls(scene, scene.target)
    start = (scene.start.position.x, scene.start.position.y)
    assert 5.0 <= distance_to_outline(start, target) <= 10.0
    for tree in scene.ground.trees:
        apart = distance_to_outline((tree.position.x, tree.position.y), target)
        assert apart - tree.crown_m >= 15.0 or (tree.kind == "shrub" and tree.height_m <= 1.0 and apart > tree.crown_m)
    for point in [c.position for c in scene.ground.cars] + list(scene.ground.lamps):
        assert distance_to_outline((point.x, point.y), target) >= 13.0
    for other in scene.buildings:
        if other.id != scene.target:
            assert outlines_gap(walls(scene, other.id), target) >= 22.0
    spots = [
        (o.place.building, o.place.facade, o.place.floor, o.place.column)
        for o in scene.objects
        if isinstance(o.place, WindowPlace)
    ]
    assert len(spots) == len(set(spots)) == len(scene.objects)
    for thing in scene.objects:
        assert isinstance(thing.place, WindowPlace)
        entry = next(e for e in CATALOGUE.entries if e.kind == thing.kind)
        place = thing.place
        slot = window_slot(scene.building(place.building), place.facade, place.floor, place.column)
        assert place.on in entry.places
        assert thing.colour in entry.colours
        assert (place.on == "balcony") == (slot.balcony is not None)


def test_random_plans_cover_every_kind_every_shape_and_every_difficulty() -> None:
    specs = [random_spec(CATALOGUE, seed) for seed in range(48)]
    assert {s.kind for s in specs} == {"low_rise", "high_rise", "villa", "cultural"}
    assert {s.footprint.shape for s in specs} == {"rectangle", "l", "u", "t", "plus", "octagon"}
    assert {scene_difficulty(s) for s in specs} == {"easy", "moderate", "hard"}
    assert {s.surroundings.neighbours for s in specs} == {"none", "street", "ring"}


def test_a_rotated_scene_is_the_same_scene_turned() -> None:
    plain = build_scene(RECTANGLE, 2, CATALOGUE)
    turned = build_scene(RECTANGLE.model_copy(update={"rotation": math.pi / 2}), 2, CATALOGUE)
    assert turned.start.position.x == pytest.approx(-plain.start.position.y, abs=0.01)
    assert turned.start.yaw == pytest.approx(math.pi, abs=1e-3) or turned.start.yaw == pytest.approx(-math.pi, abs=1e-3)
    assert len(window_slots(turned.building("target"))) == len(window_slots(plain.building("target")))
    assert turned.building("target").footprint == points(outline(RECTANGLE.footprint), math.pi / 2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"goal": GoalSpec(kind="piano", colour="green", floor=2)}, "the catalogue has no 'piano'"),
        ({"goal": GoalSpec(kind="duck", colour="pink", floor=2)}, "comes in red, green, blue, yellow"),
        ({"goal": GoalSpec(kind="duck", colour="red", floor=9)}, "the goal wants floor 9"),
        ({"goal": GoalSpec(kind="chair", colour="red", floor=2)}, "no free window takes a chair"),
        ({"start_facade": 7}, r"facades 0\.\.3, not 7"),
        ({"pagoda": True, "footprint": FootprintSpec(shape="t", width_m=30, depth_m=20)}, "convex"),
        (
            {"footprint": FootprintSpec(shape="u", width_m=24, depth_m=20, arm_m=8), "start_facade": 4},
            "choose an outer facade",
        ),
    ],
)
def test_a_plan_that_cannot_stand_is_refused_with_its_reason(change: dict[str, object], said: str) -> None:
    with pytest.raises(UnbuildableScene, match=said):
        build_scene(RECTANGLE.model_copy(update=change), 1, CATALOGUE)
