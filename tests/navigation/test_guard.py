"""The guard's geometry: the space allowed, what depth has shown, where anybody has looked."""

import math

import numpy as np
import pytest

from navigation import guard
from navigation.camera import Camera, DepthView, Place, Pose, pinhole
from navigation.guard import Look, Space, check, column_is_open, look_of, top_beside_m
from tests.navigation.raycast_world import Prism, World, rectangle

HERE = Pose(0.0, 0.0, 5.0, math.pi / 2)
SPACE = Space(Place(0.0, 0.0, 5.0), 50.0, 0.8, 30.0, 0.5)
CAMERA = pinhole(120, 120, 90.0)
NOWHERE = np.array([[0.0, 0.0, 5.0]])
WALL = Prism(rectangle(0.0, 10.5, 40.0, 1.0), 0.0, 20.0)
SLAB = Prism(rectangle(0.0, 5.0, 3.0, 2.0), 3.4, 3.6)
POST = Prism(rectangle(0.8, 4.3, 0.2, 0.1), 3.6, 4.2)
"""All that depth shows of a railing on it."""


def _look(
    prisms: list[Prism], pose: Pose = HERE, *, up: bool = False, blind: bool = False, holes: bool = False
) -> Look:
    world = World(prisms, ground=True)
    views = list(world.views(pose, CAMERA).values())
    if up:
        views.append(_overhead(prisms, pose))
    if holes:
        views[0].depth_m[0, 0] = np.nan
    if blind:
        views = [view._replace(depth_m=np.full_like(view.depth_m, np.nan)) for view in views]
    return look_of(views, pose)


def _overhead(prisms: list[Prism], pose: Pose) -> DepthView:
    """A camera that looks straight up: the undersides of what hangs over the drone."""
    camera: Camera = CAMERA._replace(pitch_deg=90.0)
    depth = np.full((120, 120), np.inf, np.float32)
    for prism in prisms:
        xs, ys = np.array(prism.outline).T
        inside = min(xs) < pose.x < max(xs) and min(ys) < pose.y < max(ys)
        if inside and prism.bottom_m > pose.z:
            depth[:] = prism.bottom_m - pose.z
    return DepthView(camera, depth)


def _reason(path: list[Place], look: Look, space: Space = SPACE, flown: np.ndarray = NOWHERE) -> str | None:
    refusal = check(path, [look], flown, look.pose, space)
    return None if refusal is None else refusal.reason


def test_a_way_that_was_looked_through_is_free_and_one_into_a_wall_is_not() -> None:
    look = _look([WALL])
    assert _reason([Place(0.0, 8.0, 5.0)], look) is None
    assert _reason([Place(0.0, 9.7, 5.0)], look) == "clearance"
    assert _reason([Place(0.0, 8.0, 5.0), Place(0.0, 14.0, 5.0)], look) == "clearance"


def test_nobody_has_seen_what_lies_behind_the_drone_unless_it_flew_there() -> None:
    look = _look([WALL])
    back = [Place(0.0, -6.0, 5.0)]
    assert _reason(back, look) == "unseen"
    assert _reason(back, look, flown=np.array([[0.0, -6.0, 5.0], [0.0, 0.0, 5.0]])) is None
    assert _reason([Place(0.0, -1.0, 5.0)], look) is None  # a step back


def test_where_depth_shows_nothing_no_way_is_free() -> None:
    assert _reason([Place(0.0, 8.0, 5.0)], _look([WALL], blind=True)) == "unseen"


def test_over_a_slab_a_railing_may_stand_that_a_sensor_with_holes_has_missed() -> None:
    over = [Place(0.0, 8.0, 5.0)]
    assert _reason(over, _look([WALL, SLAB, POST])) is None
    assert _reason(over, _look([WALL, SLAB, POST], holes=True)) == "clearance"
    assert _reason(over, _look([WALL, SLAB], holes=True)) is None  # an awning


def test_a_look_ahead_alone_does_not_make_a_railing_vanish_that_all_cameras_showed() -> None:
    whole = _look([WALL, SLAB, POST], holes=True)
    ahead = _look([WALL, SLAB, POST], holes=True)._replace(slabs=whole.slabs[:0])
    ahead = ahead._replace(views=ahead.views[:1])
    refusal = check([Place(0.0, 8.0, 5.0)], [whole, ahead], NOWHERE, HERE, SPACE)
    assert refusal is not None
    assert "a railing that depth has missed" in refusal.said


def test_where_the_last_look_shows_nothing_on_the_slab_it_carries_no_railing() -> None:
    looks = [_look([WALL, SLAB, POST], holes=True), _look([WALL, SLAB], holes=True)]
    assert check([Place(0.0, 8.0, 5.0)], looks, NOWHERE, HERE, SPACE) is None
    refusal = check([Place(0.0, 8.0, 5.0)], looks[::-1], NOWHERE, HERE, SPACE)
    assert refusal is not None
    assert "a railing that depth has missed" in refusal.said


def test_what_a_sensor_that_misses_thin_things_saw_once_is_there_until_several_looks_see_past_it() -> None:
    wire = Prism(rectangle(0.0, 5.0, 3.0, 0.05), 4.95, 5.05)
    way = [Place(0.0, 8.0, 5.0)]
    seen, past = _look([WALL, wire], holes=True), _look([WALL], holes=True)
    assert [check(way, [seen, *([past] * looks)], NOWHERE, HERE, SPACE) is None for looks in range(5)] == [
        *[False] * 3,
        *[True] * 2,
    ]
    assert check(way, [_look([WALL, wire]), _look([WALL])], NOWHERE, HERE, SPACE) is None


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        (Place(0.0, 8.0, 31.0), "above_ceiling"),
        (Place(0.0, 8.0, 0.5), "below_floor"),
        (Place(60.0, 0.0, 5.0), "geofence"),
    ],
)
def test_what_leads_out_of_the_space_allowed_is_refused(end: Place, reason: str) -> None:
    assert _reason([end], _look([WALL])) == reason


def test_whoever_is_outside_may_come_back_but_not_go_farther() -> None:
    low = HERE._replace(z=0.6)
    look = _look([WALL], low)
    assert _reason([Place(0.0, 4.0, 0.7)], look) is None
    assert _reason([Place(0.0, 4.0, 0.5)], look) == "below_floor"


def test_beside_a_wall_it_may_leave_and_fly_along_but_not_come_nearer() -> None:
    beside = HERE._replace(y=9.6)  # 0.4 m from the wall, within the radius
    look = _look([WALL], beside)
    assert _reason([Place(0.0, 7.0, 5.0)], look, flown=np.array([[0.0, 7.0, 5.0], [0.0, 9.6, 5.0]])) is None
    assert _reason([Place(1.0, 9.6, 5.0)], look) == "clearance"
    assert _reason([Place(0.0, 9.62, 5.0)], look) == "clearance"


def test_what_an_earlier_look_showed_still_stands_until_a_later_one_sees_past_it() -> None:
    pole = Prism(rectangle(0.0, 4.0, 0.3, 0.3), 0.0, 20.0)
    with_pole, without = _look([WALL, pole]), _look([WALL])
    away = _look([WALL], HERE._replace(yaw=-math.pi / 2))
    path = [Place(0.0, 8.0, 5.0)]
    for looks, reason in (([with_pole], "clearance"), ([with_pole, away], "clearance"), ([with_pole, without], None)):
        refusal = check(path, looks, NOWHERE, HERE, SPACE)
        assert (refusal.reason if refusal else None) == reason


def test_the_ground_is_no_obstacle_of_a_low_way() -> None:
    low = HERE._replace(z=1.0)
    assert _reason([Place(0.0, 8.0, 1.0)], _look([WALL], low)) is None


def test_it_climbs_where_nothing_hangs_over_it_and_not_beneath_a_crown_or_a_balcony() -> None:
    ground = HERE._replace(z=1.2)
    place = Place(ground.x, ground.y, ground.z)
    crown = Prism(rectangle(1.5, 0.0, 7.0, 7.0), 3.5, 8.0)
    trunk = Prism(rectangle(2.5, 1.5, 0.4, 0.4), 0.0, 8.0)
    lamp = Prism(rectangle(3.0, 1.0, 0.2, 0.2), 0.0, 6.0)
    assert column_is_open(place, 9.0, [_look([WALL], ground)])
    assert column_is_open(place, 9.0, [_look([WALL, lamp], ground)])
    assert not column_is_open(place, 9.0, [_look([WALL, crown, trunk], ground)])
    close = ground._replace(y=8.8)  # 1.2 m before the wall, a balcony may hang over it
    assert not column_is_open(Place(close.x, close.y, close.z), 9.0, [_look([WALL], close)])
    here = np.array([[0.0, 0.0, 1.2]])
    assert _reason([Place(0.0, 0.0, 9.0)], _look([WALL, crown, trunk], ground), flown=here) in {"unseen", "clearance"}
    assert _reason([Place(0.0, 0.0, 9.0)], _look([WALL], ground), flown=here) is None


def test_a_camera_that_looks_up_has_the_last_word() -> None:
    close = HERE._replace(y=8.8, z=1.2)
    place = Place(close.x, close.y, close.z)
    assert column_is_open(place, 9.0, [_look([WALL], close, up=True)])
    canopy = Prism(rectangle(0.0, 9.0, 3.0, 2.0), 4.0, 4.2)
    assert not column_is_open(place, 9.0, [_look([WALL, canopy], close, up=True)])


def test_the_top_beside_the_drone_is_that_of_what_stands_near() -> None:
    tower = Prism(rectangle(0.0, 60.0, 20.0, 10.0), 0.0, 50.0)
    house = Prism(rectangle(0.0, 12.0, 20.0, 6.0), 0.0, 8.0)
    top = top_beside_m(_look([house, tower]))
    assert top == pytest.approx(8.0, abs=0.3)
    assert top_beside_m(_look([])) is None


def test_what_the_guard_keeps_of_a_look_is_small() -> None:
    look = _look([WALL])
    assert all(view.camera.width <= guard._COARSE_PX for view in look.views)
    assert len(look.points) < 40_000
