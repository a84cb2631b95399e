"""People, cars and birds: where they are, what they show, whom they hit."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contracts.geometry import Point2, Point3, Pose
from contracts.scene import Air, Ground, Light, Road, Scene, Wind
from contracts.scene_traffic import Bird, Mover, MovingCar, Person
from contracts.sim import EpisodeQuestion, Flight
from contracts.vehicle import Move
from service_kit.errors import BadQuestion
from services.sim.episode import LiveEpisode
from services.sim.geometry.courses import BIRD_BERTH_M, Course, courses_of
from services.sim.geometry.parts import Assembly
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.geometry.street import KERB_M
from services.sim.geometry.traffic import build_traffic
from services.sim.render.gl import GlRenderer
from services.sim.scenes import make_ready
from tests.cameras import square, squares
from tests.services.sim.conftest import build_boxes, make_yard
from tests.services.sim.running_sim import Simulator

AHEAD = square(size=160)
UP = Point3(x=0.0, y=-15.0, z=8.0)


def way(*corners: tuple[float, float]) -> tuple[Point2, ...]:
    return tuple(Point2(x=x, y=y) for x, y in corners)


def walker(y: float = -9.0, phase: float = 0.25, **changes: float) -> Person:
    """Goes 20 m to the east and back, at 2 m/s; at phase 0.25 it is half way there."""
    fields = {"speed_m_s": 2.0, "phase": phase} | changes
    return Person.model_validate({"id": "anna", "way": way((-10, y), (10, y))} | fields)


def course_of(mover: Mover, *roads: Road) -> Course:
    return courses_of(make_yard(traffic=(mover,), ground=Ground(half_size_m=60.0, roads=roads)))[0]


def with_movers(scene: Scene) -> SceneMesh:
    """The boxes, and what moves between them."""
    still = build_boxes(scene)
    assembly = Assembly()
    assembly.parts = list(still.parts)
    moving = build_traffic(assembly, scene)
    return replace(still, parts=tuple(assembly.parts), moving=moving)


def test_a_person_walks_to_the_end_of_the_way_and_back() -> None:
    course = course_of(walker())
    x, y, z, heading = course.at([0.0, 4.0, 7.0, 20.0]).T
    assert x == pytest.approx([0.0, 8.0, 6.0, 0.0])
    assert (y == -9.0).all()
    assert (z == 0.0).all()
    assert np.cos(heading) == pytest.approx([1.0, 1.0, -1.0, 1.0])


def test_people_step_up_onto_the_pavement() -> None:
    road = Road(start=Point2(x=0, y=-40), end=Point2(x=0, y=40), width_m=6.0, pavement_m=2.0)
    course = course_of(walker(phase=0.0, speed_m_s=1.0), road)
    x, _, z, _ = course.at(np.arange(0.0, 20.0, 0.5)).T
    assert (z[np.abs(np.abs(x) - 4.0) < 0.6] == KERB_M).all()
    assert (z[np.abs(x) < 2.6] == 0.0).all()


def test_a_car_keeps_both_axles_on_its_way_and_starts_again_at_its_end() -> None:
    car = MovingCar(id="taxi", way=way((-20, -12), (20, -12), (20, 20)), speed_m_s=4.0)
    first, cornering, again = course_of(car).at([1.0, 10.0, 19.0])
    assert first == pytest.approx([-16.0, -12.0, 0.0, 0.0])
    assert 0.2 < cornering[3] < math.pi / 2 - 0.2
    assert again[:2] == pytest.approx([-16.0, -12.0])


def test_a_bird_flies_round_and_keeps_away_from_the_drone() -> None:
    corners = ((-10, -10, 5), (10, -10, 7), (10, 10, 9), (-10, 10, 7))
    bird = Bird(id="crow", way=tuple(Point3(x=x, y=y, z=z) for x, y, z in corners), speed_m_s=8.0)
    scene = make_yard(traffic=(bird,))
    part = build_traffic(Assembly(), scene)[0]
    far = np.array((0.0, 0.0, 50.0))
    assert part.place(1.0, far) == pytest.approx(part.place(11.0, far))
    for gap in (0.0, 0.1, 2.0):
        drone = part.place(1.0, far)[:3] - (0.0, gap, 0.0)
        assert math.dist(part.place(1.0, drone)[:3], drone) == pytest.approx(BIRD_BERTH_M)
    assert not np.isfinite(course_of(bird).clearance_m(part.place(1.0, far)[None, :3], np.array([1.0]))).any()


def test_the_clearance_is_that_of_a_capsule_and_of_a_box() -> None:
    person, car = course_of(walker()), course_of(MovingCar(id="taxi", way=way((-30, -9), (30, -9)), phase=0.5))
    asked = np.array([(0.0, -10.0, 1.0), (0.0, -9.0, 2.75), (0.0, -9.0, 1.0)])
    assert person.clearance_m(asked, np.zeros(3)) == pytest.approx([0.7, 1.0, -0.3])
    asked = np.array([(3.15, -9.0, 1.0), (0.0, -10.9, 1.0), (0.0, -9.0, 2.45), (0.0, -9.0, 1.25)])
    assert car.clearance_m(asked, np.zeros(4)) == pytest.approx([1.0, 1.0, 1.0, -0.2])


def test_movers_are_drawn_where_they_are_at_the_moment_of_the_look() -> None:
    scene = make_yard(traffic=(walker(y=-12.0),))
    mesh, pose = with_movers(scene), Pose(x=0.0, y=-20.0, z=1.5, yaw=math.pi / 2)
    part = mesh.part("traffic", "anna").id
    renderer = GlRenderer()
    try:
        uploaded = renderer.upload(mesh)
        for time_s in (0.0, 1.0, 8.0):
            views = renderer.render(uploaded, pose, [AHEAD], time_s, labelled=True)
            assert views.ids is not None
            hers = views.ids[0] == part
            x = float(mesh.moving[0].course.at(time_s)[0, 0])
            assert np.nonzero(hers)[1].mean() == pytest.approx(80 + 80 * x / 8.0, abs=3.0)
            assert views.depth_m()[0][hers] == pytest.approx(8.0, abs=0.5)
            assert np.array_equal(renderer.render_ids(uploaded, pose, [AHEAD], time_s)[0], views.ids[0])
    finally:
        renderer.close()


@pytest.mark.parametrize("light", [Light(), Light(sky="night", lit_windows=0.3)], ids=["by day", "by night"])
def test_movers_cast_shadows_and_change_nothing_else(light: Light) -> None:
    cameras, pose = [AHEAD], Pose(x=0.0, y=-20.0, z=4.0, yaw=math.pi / 2)
    renderer = GlRenderer()
    try:
        empty = renderer.upload(build_boxes(make_yard(light=light)))
        busy = renderer.upload(with_movers(make_yard(light=light, traffic=(walker(y=-14.0),))))
        before, after = (renderer.render(uploaded, pose, cameras, labelled=True) for uploaded in (empty, busy))
    finally:
        renderer.close()
    assert before.ids is not None
    assert after.ids is not None
    elsewhere = after.ids[0] == before.ids[0]
    assert np.array_equal(after.depth_units[0][elsewhere], before.depth_units[0][elsewhere])
    shade = before.rgb[0].astype(int) - after.rgb[0]
    assert (shade[elsewhere] >= 0).all()
    assert (shade[elsewhere].max(axis=1) > 0).sum() in range(20, 2_000)


def test_pictures_in_which_nobody_is_seen_are_those_of_the_scene_without_traffic() -> None:
    cameras, pose = squares((-45, 0, 45), 160), Pose(x=0.0, y=-14.0, z=4.0, yaw=math.pi / 2)
    renderer = GlRenderer()
    try:
        empty = renderer.upload(build_boxes(make_yard()))
        busy = renderer.upload(with_movers(make_yard(traffic=(walker(y=-30.0),))))
        before, behind = (renderer.render(uploaded, pose, cameras, 3.0, labelled=True) for uploaded in (empty, busy))
        for a, b in zip(before, behind, strict=True):
            assert (a is None) == (b is None)
            assert a is None or b is None or np.array_equal(a, b)
    finally:
        renderer.close()


def flying(scene: Scene, flight: Flight | None = None) -> LiveEpisode:
    question = EpisodeQuestion(scene=scene, flight=flight or Flight())
    return LiveEpisode("e", make_ready(scene, build_boxes), question, "tiny", "")


def flown_up(scene: Scene, *, slice_s: float = math.inf, flight: Flight | None = None) -> LiveEpisode:
    live = flying(scene, flight)
    live.begin(1, Move(path=(UP,)))
    time_s = 0.0
    while not live.advance(time_s):
        time_s += slice_s
    return live


def crossing(after_s: float, **changes: float) -> Person:
    """Somebody 2.1 m tall who walks through the drone's start, so many seconds after it has left."""
    return walker(y=-15.0, phase=0.25 - after_s * 2.0 / 40.0, height_m=2.1, **changes)


@pytest.mark.parametrize("wind", [Wind(), Wind(speed_m_s=3.0)], ids=["kinematic", "by dynamics"])
def test_a_drone_on_its_way_that_somebody_walks_into_has_collided_with_them(wind: Wind) -> None:
    live = flown_up(make_yard(traffic=(crossing(0.6),), air=Air(wind=wind)))
    try:
        result = live.result(1)
        assert result.collided
        assert result.hit == "anna"
        assert result.pose.z < 3.0
        assert live.state().health.problems == ("it has hit anna",)
    finally:
        live.close()


def test_a_drone_that_has_gone_before_somebody_comes_is_not_hit() -> None:
    live = flown_up(make_yard(traffic=(crossing(3.0),)))
    try:
        assert live.result(1).reached
    finally:
        live.close()


def test_the_collision_is_the_same_however_the_flight_is_followed() -> None:
    ends = []
    for slice_s in (math.inf, 0.25, 0.013):
        live = flown_up(make_yard(traffic=(crossing(0.6),)), slice_s=slice_s)
        ends.append(live.result(1).pose)
        live.close()
    assert ends[0] == ends[1] == ends[2]


def test_nobody_stops_for_a_drone_that_hovers_and_looks() -> None:
    live = flying(make_yard(traffic=(crossing(1.0),)))
    try:
        for number in range(1, 21):
            live.looked(number, live.drone.pose)
            if live.drone.collided:
                break
        assert live.state().health.problems == ("it has hit anna",)
        assert 0.4 < live.time_s < 1.0
    finally:
        live.close()


def test_a_drone_that_brakes_may_be_run_into() -> None:
    live = flying(make_yard(traffic=(crossing(0.9),)))
    try:
        live.begin(1, Move(path=(UP,)))
        assert not live.advance(0.5)
        live.stop()
        assert live.result(1).hit == "anna"
        assert live.state().flight_s < 1.0
    finally:
        live.close()


def test_a_drone_does_not_land_on_people() -> None:
    live = flying(make_yard(traffic=(walker(y=-15.0, phase=0.22, speed_m_s=0.2, height_m=0.9),)))
    live.begin(1, Move(path=(UP,)))
    live.advance(math.inf)
    try:
        live.land()
        live.advance(math.inf)
        assert live.drone.collided
        assert not live.drone.landed
    finally:
        live.close()


@pytest.mark.parametrize(
    ("mover", "said"),
    [
        (Person(id="anna", way=way((-10, -9), (0, 0))), "the way of anna leads into building house"),
        (MovingCar(id="taxi", way=way((-80, -9), (40, -9))), "the way of taxi reaches 80 m from the origin"),
        (crossing(0.0), "anna of the traffic would touch the drone at its start"),
    ],
)
def test_ways_that_lead_nowhere_are_refused(mover: Mover, said: str) -> None:
    with pytest.raises(BadQuestion, match=said):
        flying(make_yard(traffic=(mover,)))


def test_looks_show_traffic_by_the_clock_and_the_same_flight_shows_the_same(launch: Callable[..., Simulator]) -> None:
    sim = launch(builder=with_movers)
    scene = make_yard(traffic=(walker(y=-9.0),))
    flights = []
    for _ in range(2):
        episode = sim.start(scene).id
        looks = [sim.look(episode, cameras="front")]
        sim.move(episode, 1, [{"x": 0.0, "y": -15.0, "z": 3.0}])
        looks += [sim.look(episode, cameras="front") for _ in range(2)]
        flights.append(looks)
    assert [look.views for look in flights[0]] == [look.views for look in flights[1]]
    assert flights[0][1].pose == flights[0][2].pose
    assert flights[0][1].views != flights[0][2].views
