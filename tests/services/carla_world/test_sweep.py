"""A sphere flown through what a depth camera sees stops where it would touch."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from episode_kit.kinematics import Vector
from services.carla_world.sweep import APART_M, HIT, PIECE_M, DepthSweeper
from tests.services.carla_world.boxes import Box, BoxWorld

RADIUS_M = 0.35
WALL = Box((10.0, -20.0, -20.0), (11.0, 20.0, 20.0))
HERE: Vector = (0.0, 0.0, 0.0)


def swept(world: BoxWorld, end: Vector, start: Vector = HERE) -> tuple[float, str | None]:
    return DepthSweeper(world.look, RADIUS_M).sweep(start, end)


@pytest.mark.parametrize("end", [(30.0, 0.0, 0.0), (30.0, 12.0, 4.0), (30.0, -9.0, -9.0)])
def test_it_stops_before_a_wall_however_it_comes(end: Vector) -> None:
    free_m, hit = swept(BoxWorld(WALL), end)
    exact_m = BoxWorld(WALL).free_m(HERE, end, RADIUS_M)
    assert hit == HIT
    assert exact_m - 2 * APART_M <= free_m <= exact_m


def test_what_ends_before_the_wall_is_flown_to_its_end() -> None:
    assert swept(BoxWorld(WALL), (9.0, 0.0, 0.0)) == (9.0, None)


def test_straight_up_and_straight_down_are_looked_at_too() -> None:
    ceiling, floor = Box((-5, -5, 6), (5, 5, 7)), Box((-5, -5, -3), (5, 5, -2))
    up, down = swept(BoxWorld(ceiling), (0.0, 0.0, 20.0)), swept(BoxWorld(floor), (0.0, 0.0, -20.0))
    assert up[0] == pytest.approx(6 - RADIUS_M - APART_M, abs=0.01)
    assert down[0] == pytest.approx(2 - RADIUS_M - APART_M, abs=0.01)


def test_a_bar_of_three_centimetres_is_hit_far_away() -> None:
    bar = Box((25.0, -0.015, -5.0), (25.03, 0.015, 5.0))
    free_m, hit = swept(BoxWorld(bar), (40.0, 0.0, 0.0))
    assert hit == HIT
    assert free_m == pytest.approx(25.0 - RADIUS_M, abs=0.05)


def test_what_is_just_beside_the_way_is_passed() -> None:
    beside = Box((5.0, RADIUS_M + 0.05, -5.0), (25.0, 3.0, 5.0))
    assert swept(BoxWorld(beside), (30.0, 0.0, 0.0)) == (30.0, None)


def test_after_a_stop_at_a_wall_it_flies_along_the_wall_and_away_from_it() -> None:
    free_m, _ = swept(BoxWorld(WALL), (30.0, 0.0, 0.0))
    here = (free_m, 0.0, 0.0)
    assert swept(BoxWorld(WALL), (free_m, 15.0, 0.0), here) == (15.0, None)
    assert swept(BoxWorld(WALL), HERE, here)[1] is None
    assert swept(BoxWorld(WALL), (30.0, 0.0, 0.0), here)[0] == pytest.approx(0.0, abs=0.01)


def test_a_long_way_is_looked_along_in_pieces() -> None:
    world = BoxWorld()
    assert swept(world, (3 * PIECE_M, 0.0, 0.0)) == (3 * PIECE_M, None)
    assert world.looks == 3


def test_a_place_is_touched_from_every_side() -> None:
    sides = [
        Box((0.3, -1, -1), (1, 1, 1)),
        Box((-1, -1, -1), (-0.3, 1, 1)),
        Box((-1, 0.3, -1), (1, 1, 1)),
        Box((-1, -1, -1), (1, -0.3, 1)),
        Box((-1, -1, 0.3), (1, 1, 1)),
        Box((-1, -1, -1), (1, 1, -0.3)),
    ]
    assert all(DepthSweeper(BoxWorld(side, size=64).look, RADIUS_M).touching(HERE) for side in sides)
    assert not DepthSweeper(BoxWorld(WALL, size=64).look, RADIUS_M).touching(HERE)


boxes = st.builds(
    lambda x, y, z, size: Box((x, y, z), (x + size[0], y + size[1], z + size[2])),
    st.floats(-12.0, 12.0),
    st.floats(-12.0, 12.0),
    st.floats(-6.0, 6.0),
    st.tuples(*[st.floats(0.2, 5.0)] * 3),
)


@settings(max_examples=12, deadline=None)
@given(st.lists(boxes, min_size=1, max_size=4), st.tuples(*[st.floats(-14.0, 14.0)] * 3))
def test_among_any_boxes_it_never_flies_into_one_and_stops_near_it(world: list[Box], end: Vector) -> None:
    there = BoxWorld(*world, size=240)
    assume(math.dist(HERE, end) > 0.5)
    assume(there.clearance_m(HERE) > 1.5 * RADIUS_M)
    exact_m = there.free_m(HERE, end, RADIUS_M)
    free_m, hit = swept(there, end)
    # an edge that a pixel passes by is cut by less than the pixel, which the sphere's curve makes larger
    assert free_m <= exact_m + 0.2
    assert free_m >= exact_m - 0.05 or hit is None
