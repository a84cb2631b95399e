"""Who walks by, as depth tells it, and how near they could come."""

import math

import numpy as np
import pytest

from navigation.camera import Place, Pose, pinhole
from navigation.guard import Look, look_of
from navigation.passers_by import HEAD_M, Mover, goes_low, in_the_way, movers, without
from tests.navigation.raycast_world import Prism, World, rectangle

NORTH = math.pi / 2
HERE = Pose(0.0, 0.0, 1.5, NORTH)
CAMERA = pinhole(160, 160, 90.0)
WALL = Prism(rectangle(0.0, 12.0, 40.0, 1.0), 0.0, 20.0)
LOW_M = HEAD_M + 0.5


def _person(x: float, y: float, wide_m: float = 0.5, top_m: float = 1.75) -> Prism:
    return Prism(rectangle(x, y, wide_m, wide_m), 0.0, top_m)


def _look(*prisms: Prism, pose: Pose = HERE, believed: Pose | None = None, holes: bool = False) -> Look:
    views = list(World([WALL, *prisms], ground=True).views(pose, CAMERA).values())
    if holes:
        views[0].depth_m[0, 0] = np.nan
    return look_of(views, believed or pose)


def test_who_stands_where_nobody_stood_has_moved_there() -> None:
    (found,) = movers(_look(_person(2.0, 5.0)), [_look(_person(-1.0, 5.0))])
    assert math.hypot(found.x - 2.0, found.y - 5.0) < 0.5
    assert found.half_m < 0.6


def test_who_walks_is_told_from_another_place_of_the_drone_as_well() -> None:
    before = _look(_person(-1.0, 6.0), pose=Pose(-4.0, 1.0, 1.5, NORTH))
    (found,) = movers(_look(_person(2.0, 6.0)), [before])
    assert math.hypot(found.x - 2.0, found.y - 6.0) < 0.5


@pytest.mark.parametrize(
    "still",
    [
        _person(2.0, 5.0),
        _person(2.0, 5.0, wide_m=2.0, top_m=1.2),
        Prism(rectangle(-3.0, 8.0, 0.1, 0.1), 0.0, 6.0),
        Prism(rectangle(3.0, 10.0, 3.0, 1.5), 2.6, 2.8),
    ],
)
def test_what_stands_still_never_moves_though_the_pose_is_not_exact(still: Prism) -> None:
    looks = [_look(still, pose=Pose(x, y, 1.5, NORTH)) for x, y in ((-3.0, 1.0), (2.0, -2.0), (0.5, 2.0))]
    off = Pose(0.15, -0.1, 1.55, NORTH + 0.01)
    assert movers(_look(still, believed=off), looks) == []


def test_a_post_that_one_look_missed_has_not_moved_there() -> None:
    assert movers(_look(_person(2.0, 5.0, wide_m=0.1)), [_look()]) == []


def test_what_came_out_from_behind_something_may_have_stood_there() -> None:
    screen = Prism(rectangle(2.0, 3.0, 2.0, 0.2), 0.0, 3.0)
    assert movers(_look(_person(2.0, 5.0)), [_look(_person(2.0, 5.0), screen)]) == []


def test_a_sensor_whose_depth_errs_is_believed_about_who_is_near_alone() -> None:
    assert movers(_look(_person(0.0, 9.0)), [_look()])
    assert not movers(_look(_person(0.0, 9.0), holes=True), [_look()])
    assert movers(_look(_person(0.0, 5.0), holes=True), [_look()])


def test_a_fence_that_such_a_sensor_shows_in_every_second_look_has_not_moved() -> None:
    fence = Prism(rectangle(0.0, 5.0, 3.0, 0.1), 0.0, 1.2)
    shown, missed = _look(fence, holes=True), _look(holes=True)
    assert movers(shown, [missed, missed])
    assert movers(shown, [missed, shown])
    assert movers(shown, [missed, shown, missed]) == []
    assert movers(shown, [shown, missed, missed]) == []


@pytest.mark.parametrize(
    ("path", "met"),
    [
        ([Place(0.0, 4.0, 1.5)], True),  # towards it
        ([Place(0.0, -1.0, 1.5)], False),
        ([Place(0.0, -20.0, 1.5)], False),  # away from it, faster than anybody walks
        ([Place(0.0, 0.0, 4.0), Place(0.0, 8.0, 4.0)], False),  # over them
        ([Place(0.0, 4.0, 3.0), Place(0.0, 4.0, 1.5)], True),  # down onto them
    ],
)
def test_a_flight_keeps_off_wherever_they_could_walk_meanwhile(path: list[Place], met: bool) -> None:
    near = in_the_way(path, HERE, 2.0, LOW_M, [Mover(0.0, 7.0, 0.3)])
    assert (near is not None) == met


def test_straight_up_is_the_way_out_of_their_reach_and_any_other_from_low_down_is_low() -> None:
    assert not goes_low([Place(0.0, 0.0, 3.0)], HERE, LOW_M)
    assert goes_low([Place(3.0, 0.0, 3.0)], HERE, LOW_M)
    assert goes_low([Place(0.0, 5.0, 4.0), Place(0.0, 5.0, 1.5)], HERE._replace(z=4.0), LOW_M)
    assert not goes_low([Place(0.0, 5.0, 4.0)], HERE._replace(z=4.0), LOW_M)


def _line(look: Look) -> Look:
    """The look with a thin line overhead, 2 m up."""
    line = np.array([(x, 0.0, 2.0) for x in np.arange(-1.0, 1.0, 0.1)], np.float32)
    return look._replace(points=np.concatenate([look.points, line]))


def test_a_line_that_two_looks_showed_and_the_last_one_missed_is_not_taken_for_who_walked_there() -> None:
    shown, again = _line(_look(holes=True)), _line(_look(holes=True))
    missed = _look(_person(0.0, 5.0), holes=True)
    walker = [Mover(0.0, 5.0, 0.3)]

    def lines(looks: list[Look]) -> int:
        return sum(bool(np.any(np.abs(look.points[:, 1]) + np.abs(look.points[:, 2] - 2.0) < 0.01)) for look in looks)

    assert lines(without([shown, again, missed], walker)) == 2
    assert lines(without([shown, missed, missed], walker)) == 0
    assert lines(without([shown, missed, missed], [])) == 1  # nobody moves: nothing is left out
