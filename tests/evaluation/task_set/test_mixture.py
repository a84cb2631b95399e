"""Mixtures, and what they make of a scene."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import shapely

from contracts.geometry import Point2
from contracts.scene import Car, Ground, Road, Scene, WindowPlace
from evaluation.metrics.breakdown import light_group, sensors_group, weather_group
from evaluation.metrics.taxonomy import reason_of
from evaluation.scene_generator.footprints import distance_to_outline
from evaluation.scene_generator.scene_plan import FootprintSpec, GoalSpec, SceneSpec, UnbuildableScene
from evaluation.task_set.mixture import BadMixture, Mixture, drawn, load_mixture, mixture_names
from evaluation.task_set.real_world import RealScene, real_scene, with_twin
from evaluation.task_set.stranger_requests import stranger_templates
from evaluation.task_set.task_files import lines_of, load, read
from tests.evaluation.evaluation_kit import a_result, a_task, delivered

REAL = load_mixture("vld-real")
SPEC = SceneSpec(
    name="t-1",
    kind="low_rise",
    footprint=FootprintSpec(width_m=20, depth_m=12),
    floors=5,
    goal=GoalSpec(kind="flower_pot", colour="green", floor=3),
)


def one_of(name: str, **choice: str) -> Mixture:
    """The mixture with one choice of some kinds, nothing in a row."""
    fixed = {kind: {value: 1.0} for kind, value in choice.items()}
    return Mixture.model_validate(REAL.model_dump() | {"name": name, "terraced": 0.0} | fixed)


def made(mixture: Mixture, seed: int = 1) -> RealScene:
    return real_scene(a_task().scene, SPEC, mixture, np.random.default_rng(seed))


def test_the_shipped_mixture_is_loaded_by_name() -> None:
    assert mixture_names() == ("vld-real",)
    assert REAL.requests == "strangers"
    assert (REAL.absent, REAL.twins) == (0.1, 0.1)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("d455 = 4", "d405 = 4", "there is no sensor profile 'd405'"),
        ("absent = 0.10", "absent = 0.95", "absent and twins are shares of the same tasks"),
        ("near = 1.5", "beside = 1.5", "start"),
        ("[wind]", "[storm]", "wind"),
    ],
)
def test_a_file_that_is_no_mixture_is_refused_with_what_is_wrong(tmp_path: Path, old: str, new: str, why: str) -> None:
    data = Path("evaluation/task_set/data/vld-real.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(data.replace(old, new))
    with pytest.raises(BadMixture, match=why):
        load_mixture(str(tmp_path / "mine.toml"))


def test_names_are_drawn_by_weight() -> None:
    rng = np.random.default_rng(1)
    tally = Counter(drawn({"a": 3.0, "b": 1.0, "c": 0.0}, rng) for _ in range(2000))
    assert tally["a"] / 2000 == pytest.approx(0.75, abs=0.04)
    assert tally["c"] == 0


def test_starts_are_near_far_turned_or_facing_away() -> None:
    usual = made(one_of("m", start="usual")).scene.start
    near, far = (made(one_of("m", start=start)).scene.start for start in ("near", "far"))
    assert 1.5 <= -near.position.y <= 3.0
    assert 25.0 <= -far.position.y <= 38.0
    assert near.yaw == far.yaw == pytest.approx(usual.yaw)
    for start, low, high in (("oblique", 30, 50), ("away", 150, 180)):
        turned = made(one_of("m", start=start)).scene.start
        off = abs(math.degrees(math.remainder(turned.yaw - usual.yaw, math.tau)))
        assert low <= off <= high
        assert turned.position == usual.position


def test_sensors_light_and_weather_are_part_of_the_scene_and_of_the_breakdown() -> None:
    scene = made(one_of("m", sensors="d435", light="night", weather="fog", wind="gusts", start="usual")).scene
    task = a_task().model_copy(update={"scene": scene})
    assert (sensors_group(task), light_group(task), weather_group(task)) == ("d435", "night", "fog+wind")
    assert scene.light.lit_windows > 0.0
    plain = a_task()
    assert (sensors_group(plain), light_group(plain), weather_group(plain)) == ("perfect", "day", "fair")


def test_the_same_seed_makes_the_same_scene() -> None:
    assert made(REAL, 5) == made(REAL, 5)
    assert len({made(one_of("m", start="usual"), seed).scene.model_dump_json() for seed in range(6)}) > 3


def test_a_house_in_a_row_has_one_like_it_wall_to_wall_on_either_side() -> None:
    row = Mixture.model_validate(one_of("m", start="usual").model_dump() | {"terraced": 1.0})
    scene = made(row).scene
    left, right = scene.building("row-1"), scene.building("row-2")
    home = scene.building("home")
    assert left.windows == right.windows == home.windows
    assert max(p.x for p in left.footprint) == pytest.approx(min(p.x for p in home.footprint), abs=0.05)
    assert min(p.x for p in right.footprint) == pytest.approx(max(p.x for p in home.footprint), abs=0.05)


def test_a_start_in_another_building_is_no_start() -> None:
    scene = a_task().scene
    across = scene.building("neighbour")
    shut = across.model_copy(
        update={"footprint": tuple(p.model_copy(update={"x": p.x - 60.0, "y": p.y - 32.0}) for p in across.footprint)}
    )
    street = scene.model_copy(update={"buildings": (scene.building("home"), shut)})
    with pytest.raises(UnbuildableScene, match="hemmed in by neighbour"):
        [real_scene(street, SPEC, one_of("m", start="far"), np.random.default_rng(seed)) for seed in range(10)]


def furnished_street(seed: int, **changes: object) -> Scene:
    mixture = Mixture.model_validate(one_of("m", start="usual").model_dump() | {"furnished": 1.0} | changes)
    plain = a_task().scene
    road = Road(start=Point2(x=-60, y=-20), end=Point2(x=60, y=-20))
    street = plain.model_copy(update={"ground": plain.ground.model_copy(update={"roads": (road,)})})
    return real_scene(street, SPEC, mixture, np.random.default_rng(seed)).scene


def test_a_furnished_street_has_shops_hedges_fences_poles_and_wires_at_some_seed() -> None:
    scenes = [furnished_street(seed) for seed in range(6)]
    for field in ("hedges", "fences", "poles", "wires"):
        assert any(getattr(scene.ground, field) for scene in scenes), field
    assert any(building.awnings for scene in scenes for building in scene.buildings)
    assert any(building.signs for scene in scenes for building in scene.buildings)
    assert {scene.light.glass for scene in scenes} == {"painted", "reflecting"}
    assert furnished_street(3) == furnished_street(3)


def test_what_stands_in_a_furnished_street_leaves_the_ring_about_the_house_and_the_start_free() -> None:
    for seed in range(6):
        scene = furnished_street(seed)
        home = tuple((p.x, p.y) for p in scene.building("home").footprint)
        start = (scene.start.position.x, scene.start.position.y)
        lines = [*scene.ground.hedges, *scene.ground.fences]
        places = [(p.x, p.y) for line in lines for p in (line.start, line.end)]
        places += [(pole.position.x, pole.position.y) for pole in scene.ground.poles]
        assert all(distance_to_outline(place, home) >= 14.9 for place in places)
        assert all(math.dist(place, start) >= 3.9 for place in places)


def test_a_mixture_that_does_not_speak_of_furniture_draws_what_it_drew_before() -> None:
    plain = one_of("m", start="usual")
    assert "furnished" not in plain.model_dump()
    bare, shops = made(plain, 4).scene, furnished_street(4)
    assert not bare.ground.wires
    assert (bare.start, bare.air, bare.sensors) == (shops.start, shops.air, shops.sensors)


def test_a_twin_stands_a_few_windows_on_at_the_same_wall() -> None:
    scene = with_twin(a_task().scene, np.random.default_rng(2))
    goal, twin = (next(o for o in scene.objects if o.id == name) for name in ("goal", "twin"))
    assert (goal.kind, goal.colour) == (twin.kind, twin.colour)
    assert isinstance(goal.place, WindowPlace)
    assert isinstance(twin.place, WindowPlace)
    assert goal.place.floor == twin.place.floor
    assert goal.place.facade == twin.place.facade
    assert 2 <= abs(goal.place.column - twin.place.column) <= 4


def test_where_two_windows_fit_only_saying_so_is_right() -> None:
    task = a_task().model_copy(update={"ambiguous": True})
    assert reason_of(task, a_result("request_incomplete", verdict=None)) == "success"
    unread = a_result("request_incomplete", verdict=None, object=None)
    assert reason_of(task, unread) == "parse"
    assert reason_of(task, delivered()) == "wrong_object"


def test_vld_300_stays_as_it_was_shipped() -> None:
    checksum = "5f881774abc31cd2d3c313f3961be30d9d6da11db6afbaa90679b9bf22957558"
    found = load("vld-300")
    assert (found.checksum, len(found.tasks)) == (checksum, 300)
    assert read(lines_of(found.tasks), "written again").checksum == checksum


def test_vld_real_is_what_it_says_it_is() -> None:
    tasks = load("vld-real").tasks
    assert len(tasks) == 300
    assert all(100_000 <= task.seed <= 199_999 for task in tasks)
    assert {sensors_group(task) for task in tasks} == {"perfect", "d455", "d435", "tof-10m"}
    assert {light_group(task) for task in tasks} == {"day", "dusk", "night"}
    assert {task.start for task in tasks} == {"usual", "near", "far", "oblique", "away"}
    assert sum(task.absent for task in tasks) == 31
    assert sum(task.ambiguous for task in tasks) == 20
    assert sum(task.floor == 1 for task in tasks) == 53
    assert any(task.floors == 1 for task in tasks)
    strangers = {template.id for template in stranger_templates()}
    assert all(task.template in strangers for task in tasks)


def test_what_is_absent_is_absent_and_what_is_ambiguous_is_there_twice() -> None:
    for task in load("vld-real").tasks:
        like = [
            o
            for o in task.scene.objects
            if (o.kind, o.colour) == (task.object_kind, task.object_colour)
            and isinstance(o.place, WindowPlace)
            and (o.place.building, o.place.floor) == (task.scene.target, task.floor)
        ]
        assert len(like) == (0 if task.absent else 2 if task.ambiguous else 1), task.id


def test_a_mixture_with_traffic_puts_people_cars_and_birds_where_nothing_stands() -> None:
    busy = Mixture.model_validate(one_of("busy", start="usual").model_dump() | {"traffic": 1.0})
    plain = a_task().scene
    middle = -18.0 + min(p.y for p in plain.building(plain.target).footprint)
    road = Road(start=Point2(x=-60.0, y=middle), end=Point2(x=60.0, y=middle), width_m=6.0)
    parked = Car(position=Point2(x=5.0, y=middle + 1.5))
    street = plain.model_copy(update={"ground": Ground(roads=(road,), cars=(parked,))})
    kinds: Counter[str] = Counter()
    for seed in range(12):
        scene = real_scene(street, SPEC, busy, np.random.default_rng(seed)).scene
        kinds.update(mover.kind for mover in scene.traffic)
        houses = [shapely.Polygon([(p.x, p.y) for p in b.footprint]) for b in scene.buildings]
        for mover in scene.traffic:
            way = shapely.LineString([(p.x, p.y) for p in mover.way])
            assert all(way.distance(house) > 0.3 for house in houses)
        for car in (mover for mover in scene.traffic if mover.kind == "car"):
            lane = shapely.LineString([(p.x, p.y) for p in car.way])
            assert all(lane.distance(shapely.Point(c.position.x, c.position.y)) > 1.8 for c in scene.ground.cars)
    assert min(kinds[kind] for kind in ("person", "car", "bird")) > 3


def test_a_mixture_that_says_nothing_of_traffic_draws_as_it_did_before() -> None:
    assert "traffic" not in REAL.model_dump()
    assert made(REAL, 7).scene.traffic == ()
