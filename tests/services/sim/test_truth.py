import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from contracts.geometry import Box, Point3, Pose
from contracts.scene import Scene, SceneObject, WindowPlace
from episode_kit.judge import Thing
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.choice import choose_renderer
from services.sim.render.thread import RenderThread
from services.sim.scenes import ReadyScene, make_ready
from services.sim.truth import WayHome, fitting_request, floor_rows, outline_pixels, truth_view
from tests.cameras import square

NORTH = math.pi / 2
FRONT = square(size=200)
Draw = Callable[[Pose, int], np.ndarray]


@pytest.fixture(scope="module")
def ready(yard: Scene, box_builder: Callable[[Scene], SceneMesh]) -> ReadyScene:
    return make_ready(yard, box_builder)


@pytest.fixture(scope="module")
def drawn(ready: ReadyScene) -> Iterator[Draw]:
    thread = RenderThread(choose_renderer)
    uploaded = thread.run(lambda r: r.upload(ready.mesh))

    def draw(pose: Pose, heading: int, size: int = 200) -> np.ndarray:
        return thread.run(lambda r: r.render_ids(uploaded, pose, [square(heading, size)]))[0]

    yield draw
    thread.close()


def test_the_goal_in_the_open_is_seen_whole_and_where_it_is(ready: ReadyScene, drawn: Draw) -> None:
    # 4 m before the pot's front face, at the height of its middle: half a metre is 12.5 of 200 px
    pot = ready.things["pot"].middle
    pose = Pose(x=0.0, y=pot[1] - 0.25 - 4.0, z=pot[2], yaw=NORTH)
    view = truth_view(ready.scene, ready.mesh, ready.things, pose, FRONT, drawn(pose, 0))
    (seen,) = view.objects
    assert (seen.id, seen.goal, seen.kind, seen.colour) == ("pot", True, "flower_pot", "green")
    assert seen.share == pytest.approx(1.0, abs=0.12)
    assert seen.distance_m == pytest.approx(4.25)
    assert seen.box.x_max - seen.box.x_min == pytest.approx(0.0625, abs=0.011)
    assert (seen.box.x_min + seen.box.x_max) / 2 == pytest.approx(0.5, abs=0.006)


def test_what_is_like_the_goal_at_another_window_of_its_floor_fits_the_request_as_well(yard: Scene) -> None:
    def pot(name: str, floor: int, column: int, colour: str = "green") -> SceneObject:
        place = WindowPlace(building=yard.target, facade=0, floor=floor, column=column)
        return SceneObject(id=name, kind="flower_pot", colour=colour, place=place)

    objects = (pot("mine", 1, 0), pot("twin", 1, 1), pot("above", 2, 0), pot("red", 1, 2, "red"))
    scene = yard.model_copy(update={"objects": objects, "goal": "mine"})
    assert fitting_request(scene) == {"mine", "twin"}
    assert fitting_request(scene.model_copy(update={"goal": None})) == frozenset()


def test_a_thing_cut_off_by_the_picture_has_a_smaller_share(ready: ReadyScene, drawn: Draw) -> None:
    # the pot's middle lies on the picture's left border: 4.25 m ahead, 4.25 m to the left
    pot = ready.things["pot"].middle
    pose = Pose(x=pot[0] + 4.25, y=pot[1] - 4.25, z=pot[2], yaw=NORTH)
    (seen,) = truth_view(ready.scene, ready.mesh, ready.things, pose, FRONT, drawn(pose, 0)).objects
    assert 0.2 < seen.share < 0.7
    assert seen.box.x_min == 0.0


def test_behind_the_house_nothing_of_the_front_is_seen(ready: ReadyScene, drawn: Draw) -> None:
    pose = Pose(x=0.0, y=12.0, z=5.0, yaw=-NORTH)
    view = truth_view(ready.scene, ready.mesh, ready.things, pose, FRONT, drawn(pose, 0))
    assert [o.id for o in view.objects] == ["far-pot"]


def test_looking_away_from_everything_shows_nothing(ready: ReadyScene, drawn: Draw) -> None:
    pose = Pose(x=0.0, y=-20.0, z=20.0, yaw=-NORTH)
    view = truth_view(ready.scene, ready.mesh, ready.things, pose, FRONT, drawn(pose, 0))
    assert view.objects == ()
    assert view.building_box is None
    assert view.floors_visible == 0


def test_the_buildings_box_is_its_outline(ready: ReadyScene, drawn: Draw) -> None:
    # 10 m before the facade at half its height: 10 m wide and 12 m high span half and 0.6 of the picture
    pose = Pose(x=0.0, y=-15.0, z=6.0, yaw=NORTH)
    view = truth_view(ready.scene, ready.mesh, ready.things, pose, FRONT, drawn(pose, 0))
    assert view.building_box is not None
    wanted = Box(x_min=0.25, x_max=0.75, y_min=0.2, y_max=0.8)
    for field in ("x_min", "x_max", "y_min", "y_max"):
        assert getattr(view.building_box, field) == pytest.approx(getattr(wanted, field), abs=0.011)


def test_floors_are_counted_by_their_windows_middle(ready: ReadyScene, drawn: Draw) -> None:
    # windows' middles lie at 1.65, 4.65, 7.65, 10.65 m; from 10 m at z 6 all show, from 2.5 m only 3.5..8.5 m
    far = Pose(x=0.0, y=-15.0, z=6.0, yaw=NORTH)
    rows = truth_view(ready.scene, ready.mesh, ready.things, far, FRONT, drawn(far, 0)).floor_rows
    assert rows == pytest.approx([0.7175, 0.5675, 0.4175, 0.2675])
    near = Pose(x=0.0, y=-7.5, z=6.0, yaw=NORTH)
    assert truth_view(ready.scene, ready.mesh, ready.things, near, FRONT, drawn(near, 0)).floors_visible == 2


def test_floors_above_the_picture_and_hidden_floors_do_not_count(ready: ReadyScene) -> None:
    house = ready.scene.building("house")
    pose = Pose(x=0.0, y=-15.0, z=6.0, yaw=NORTH)
    seen = np.zeros((200, 200), bool)
    seen[:100, 50:150] = True  # something hides the lower half
    assert floor_rows(house, pose, FRONT, seen) == pytest.approx([0.4175, 0.2675])


def test_the_facade_seen_aslant_is_counted_at_the_column_nearest_to_the_middle(ready: ReadyScene, drawn: Draw) -> None:
    # the house fills only the right of the picture; its west wall's far end, 25 m ahead, is nearest to the middle
    pose = Pose(x=-15.0, y=-20.0, z=6.0, yaw=NORTH)
    view = truth_view(ready.scene, ready.mesh, ready.things, pose, FRONT, drawn(pose, 0))
    assert view.floors_visible == 4
    assert view.floor_rows[0] == pytest.approx(0.5 + 0.5 * (6.0 - 1.65) / 25.0, abs=0.01)


def test_an_outline_is_measured_beyond_the_pictures_border() -> None:
    # a 2 m square 4 m ahead and 5 m aside: 50 px a side in a picture of 200, all of it outside
    a, b = (4.0, -6.0, 0.0), (4.0, -4.0, 0.0)
    c, d = (4.0, -4.0, 2.0), (4.0, -6.0, 2.0)
    square = np.array([[a, b, c], [a, c, d]], np.float32)
    assert outline_pixels(square, Pose(x=0, y=0, z=0, yaw=0), FRONT) == pytest.approx(2500, rel=0.03)


def test_what_lies_behind_the_camera_has_no_outline() -> None:
    square = np.array([[(-4.0, 0.0, 0.0), (-4.0, 1.0, 0.0), (-4.0, 0.0, 1.0)]], np.float32)
    assert outline_pixels(square, Pose(x=0, y=0, z=0, yaw=0), FRONT) == 0.0


def test_the_remaining_way_goes_round_the_house_and_up(ready: ReadyScene) -> None:
    way = ready.way_home
    z = 7.65
    before, beside = way.remaining_m([Point3(x=0, y=-6.5, z=z), Point3(x=0, y=-10.5, z=z - 2)])
    assert before == pytest.approx(0.0, abs=1e-6)
    assert beside == pytest.approx(6.0)
    (behind,) = way.remaining_m([Point3(x=0, y=8.0, z=z)])
    assert behind is not None
    assert behind > 5.8 * 2 + 10.0  # round a corner on either side


def test_without_a_goal_no_way_remains(yard_with: Callable[..., Scene]) -> None:
    things = {"pot": Thing(4, (0.0, 0.0, 0.0))}
    assert WayHome(yard_with(goal=None), things).remaining_m([Point3(x=0, y=0, z=1)]) == (None,)
