"""What is found in scenes of people's own, by a real simulator, and the picture of it."""

import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from contracts.geometry import Point2, Point3
from contracts.scene import Building, Scene, SceneObject, Start, WindowPlace
from contracts.scene_street import Awning, Hedge, Pole
from evaluation.own_scenes.check import Problem, problems_of
from evaluation.own_scenes.preview import draw_preview
from evaluation.own_scenes.starts import walkable_starts
from evaluation.sim_client import SimClient
from tests.load.processes import service
from tests.services.sim.conftest import make_yard, square


@pytest.fixture(scope="module")
def simulator() -> Iterator[SimClient]:
    with service("services.sim", {"SIM_TRUTH": "on"}) as running:
        yield SimClient(running.url)


def thing(name: str, **changes: object) -> SceneObject:
    place = WindowPlace(building="house", facade=0, floor=3, column=1)
    told = {"id": name, "kind": "flower_pot", "colour": "green", "place": place}
    return SceneObject(**(told | changes))


def at(**changes: object) -> WindowPlace:
    return WindowPlace(**({"building": "house", "facade": 0, "floor": 3, "column": 1} | changes))


def with_awning(column: int) -> Building:
    return make_yard().buildings[0].model_copy(update={"awnings": (Awning(facade=0, column=column),)})


def test_in_a_sound_scene_nothing_is_found(simulator: SimClient) -> None:
    assert problems_of(make_yard(), simulator) == []


@pytest.mark.parametrize(
    ("scene", "weight", "text"),
    [
        (make_yard(objects=(thing("pot", kind="unicorn"),)), "error", "object pot: the catalogue has no 'unicorn'"),
        (make_yard(objects=(thing("pot", colour="mauve"),)), "error", "does not come in 'mauve'; it comes in"),
        (make_yard(objects=(thing("pot", place=at(column=9)),)), "error", "there is no 9"),
        (make_yard(objects=(thing("pot", place=at(on="balcony")),)), "error", "its window has no balcony"),
        (make_yard(objects=(thing("pot", place=at(on="hang")),)), "warning", "made for sill"),
        (
            make_yard(start=Start(position=Point3(x=0, y=0, z=1), yaw=0.0)),
            "error",
            "start: (0, 0) is inside building house",
        ),
        (
            make_yard(start=Start(position=Point3(x=0, y=-15, z=1), yaw=-1.5)),
            "warning",
            "faces nothing, not the target",
        ),
        (make_yard(start=Start(position=Point3(x=0, y=-8, z=1), yaw=1.57)), "warning", "3.0 m before the wall"),
        (make_yard(buildings=(with_awning(5), make_yard().buildings[1])), "error", "there is no 5"),
        (make_yard(goal=None), "warning", "stopped_not_judged"),
        (make_yard(objects=(thing("pot"), thing("twin", place=at(facade=1)))), "warning", "twin is the same thing"),
    ],
)
def test_what_is_wrong_is_found_and_said(simulator: SimClient, scene: Scene, weight: str, text: str) -> None:
    found = problems_of(scene, simulator)
    assert any(problem.weight == weight and text in problem.text for problem in found), found


def test_everything_that_is_wrong_is_found_at_once_errors_first(simulator: SimClient) -> None:
    scene = make_yard(objects=(thing("pot", kind="unicorn"), thing("other", colour="mauve")), goal=None)
    assert [problem.weight for problem in problems_of(scene, simulator)] == ["error", "error", "warning"]


def test_an_unknown_class_is_told_with_the_nearest_and_hides_nothing_else_of_the_thing(simulator: SimClient) -> None:
    scene = make_yard(objects=(thing("pot", kind="flower_pod", place=at(column=99)),), goal=None)
    texts = [problem.text for problem in problems_of(scene, simulator)]
    assert any("the catalogue has no 'flower_pod' (did you mean 'flower_pot'?)" in text for text in texts)
    assert any("pot: " in text and "99" in text for text in texts), texts


def test_a_neighbour_that_leaves_no_way_is_named(simulator: SimClient) -> None:
    house, shed = make_yard().buildings
    near = shed.model_copy(update={"footprint": square(10.5, 0, 4)})
    texts = [problem.text for problem in problems_of(make_yard(buildings=(house, near)), simulator)]
    assert any("building shed and the target are 1.5 m apart" in text for text in texts)


def test_starts_are_in_the_open_and_see_the_target() -> None:
    starts = walkable_starts(make_yard())
    assert len(starts) > 50
    assert all(math.hypot(max(abs(s.x) - 5, 0), max(abs(s.y) - 5, 0)) >= 6.0 for s in starts)
    assert not any(abs(s.x - 20) < 5.5 and abs(s.y - 20) < 5.5 for s in starts)
    walled = make_yard().buildings[1].model_copy(update={"footprint": square(0, -18, 8)})
    fewer = walkable_starts(make_yard(buildings=(make_yard().buildings[0], walled)))
    assert not any(abs(s.x) < 9.0 and s.y < 0.0 for s in fewer)


def test_no_drone_starts_in_a_hedge_or_at_a_pole() -> None:
    hedge = Hedge(start=Point2(x=-8, y=-15), end=Point2(x=8, y=-15))
    ground = make_yard().ground.model_copy(update={"hedges": (hedge,), "poles": (Pole(position=Point2(x=0, y=13)),)})
    starts = walkable_starts(make_yard(ground=ground))
    assert len(walkable_starts(make_yard())) > len(starts) > 50
    assert not any(abs(s.x) < 9.0 and abs(s.y + 15) < 1.8 for s in starts)
    assert all(math.dist((s.x, s.y), (0, 13)) > 1.5 for s in starts)


def test_the_picture_shows_plan_and_looks_and_for_a_broken_scene_the_plan_alone(
    simulator: SimClient, tmp_path: Path
) -> None:
    scene = make_yard()
    draw_preview(scene, walkable_starts(scene), [], simulator, tmp_path / "whole.png")
    draw_preview(scene, [], [Problem("error", "no such thing")], None, tmp_path / "plan.png")
    whole, plan = (cv2.imread(str(tmp_path / name)) for name in ("whole.png", "plan.png"))
    assert whole.shape[0] > 1.7 * plan.shape[0] - 200
    first_look = whole[800:1400, 20:660]
    assert first_look.std() > 20.0  # a wall with windows, and not an empty sheet
