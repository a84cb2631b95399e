"""The visibility graph, by hand."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navigation.shortest_path import NoWay, Route, VisibilityGraph, Xy, shortest_route
from tests.navigation.raycast_world import Prism, World, rectangle

SQUARE = rectangle(0.0, 0.0, 10.0, 10.0)


def _length(start: Xy, goal: Xy, obstacles: list[tuple[Xy, ...]], clearance_m: float) -> float:
    route = shortest_route(start, goal, obstacles, clearance_m)
    assert isinstance(route, Route), route
    assert route.length_m == pytest.approx(sum(math.dist(a, b) for a, b in pairwise(route.waypoints)))
    assert (route.waypoints[0], route.waypoints[-1]) == (start, goal)
    return route.length_m


def test_a_free_way_is_straight() -> None:
    assert _length((-20.0, 8.0), (20.0, 8.0), [SQUARE], 2.0) == pytest.approx(40.0)
    assert _length((0.0, 0.0), (3.0, 4.0), [], 2.0) == pytest.approx(5.0)


def test_without_clearance_the_way_bends_at_the_corners() -> None:
    """From (-5 - 12, 0) over the corners (-5, 5) and (5, 5) to the other side: 13 + 10 + 13 m."""
    assert _length((-17.0, 0.0), (17.0, 0.0), [SQUARE], 0.0) == pytest.approx(36.0, abs=1e-4)


def test_the_clearance_moves_the_corners_out() -> None:
    """With 1 m the corners are (-6, 6) and (6, 6)."""
    expected = 2 * math.hypot(9.0, 6.0) + 12.0
    assert _length((-15.0, 0.0), (15.0, 0.0), [SQUARE], 1.0) == pytest.approx(expected, abs=1e-4)


def test_the_way_along_a_wall_at_exactly_the_clearance_is_allowed() -> None:
    assert _length((-15.0, 7.0), (15.0, 7.0), [SQUARE], 2.0) == pytest.approx(30.0, abs=1e-4)


def test_vertices_may_run_either_way_round() -> None:
    ways = [_length((-15.0, 1.0), (15.0, 1.0), [outline], 1.0) for outline in (SQUARE, SQUARE[::-1])]
    assert ways[0] == pytest.approx(ways[1])


def test_several_obstacles_are_threaded() -> None:
    left, right = rectangle(-6.0, 0.0, 10.0, 4.0), rectangle(6.0, 0.0, 10.0, 4.0)  # a 2 m alley between them
    assert _length((0.0, -10.0), (0.0, 10.0), [left, right], 0.9) == pytest.approx(20.0)
    assert _length((0.0, -10.0), (0.0, 10.0), [left, right], 1.1) > 25.0


def test_a_courtyard_narrower_than_the_clearances_is_left_alone() -> None:
    u_shape = ((-10.0, -5.0), (10.0, -5.0), (10.0, 5.0), (1.0, 5.0), (1.0, 0.0), (-1.0, 0.0), (-1.0, 5.0), (-10.0, 5.0))
    assert _length((-15.0, 6.0), (15.0, 6.0), [u_shape], 1.5) == pytest.approx(
        2 * math.hypot(3.5, 0.5) + 23.0, abs=1e-3
    )


def test_a_goal_in_front_of_a_window_is_stepped_to_straight_from_the_wall() -> None:
    route = shortest_route((0.0, -20.0), (0.0, -5.5), [SQUARE], 2.0)
    assert isinstance(route, Route)
    assert route.length_m == pytest.approx(14.5)
    on_the_wall = shortest_route((0.0, -20.0), (0.0, -5.0), [SQUARE], 2.0)
    assert isinstance(on_the_wall, Route)
    assert on_the_wall.length_m == pytest.approx(15.0)


def test_a_place_shut_in_by_walls_has_no_way_and_says_which_end() -> None:
    ring = [
        rectangle(x, y, *size) for x, y, size in ((0, 8, (20, 4)), (0, -8, (20, 4)), (8, 0, (4, 20)), (-8, 0, (4, 20)))
    ]
    out = shortest_route((0.0, 0.0), (30.0, 0.0), ring, 1.0)
    assert isinstance(out, NoWay)
    assert "no way between" in out.reason
    tight = shortest_route(
        (30.0, 0.0), (0.0, 0.0), [rectangle(-3.0, 0.0, 4.0, 20.0), rectangle(3.0, 0.0, 4.0, 20.0)], 1.5
    )
    assert isinstance(tight, NoWay)
    assert "the goal is shut in" in tight.reason
    start = shortest_route(
        (0.0, 0.0), (30.0, 0.0), [rectangle(-3.0, 0.0, 4.0, 20.0), rectangle(3.0, 0.0, 4.0, 20.0)], 1.5
    )
    assert isinstance(start, NoWay)
    assert "the start is shut in" in start.reason


def test_many_starts_share_one_goal() -> None:
    graph = VisibilityGraph([SQUARE], 1.0)
    starts = ((-15.0, 0.0), (0.0, 15.0), (20.0, 3.0))
    for start, route in zip(starts, graph.routes(starts, (15.0, 0.0)), strict=True):
        assert route == graph.route(start, (15.0, 0.0))


@pytest.mark.parametrize(
    ("obstacles", "clearance"),
    [([((0.0, 0.0), (1.0, 0.0))], 1.0), ([SQUARE], -1.0), ([((0, 0), (1, 0), (math.nan, 1))], 1)],
)
def test_impossible_obstacles_are_refused(obstacles: list[tuple[Xy, ...]], clearance: float) -> None:
    with pytest.raises(ValueError, match=r"corners|clearance"):
        VisibilityGraph(obstacles, clearance)


def test_a_sharp_corner_is_rounded_by_several_points_and_keeps_the_clearance() -> None:
    spike = ((0.0, 0.0), (20.0, -0.5), (20.0, 0.5))
    route = shortest_route((5.0, 5.0), (5.0, -5.0), [spike], 2.0)
    assert isinstance(route, Route)
    round_arc = 2 * math.sqrt(50 - 4) + 2 * (1.5 * math.pi - 2 * math.acos(2 / math.sqrt(50)))
    assert round_arc <= route.length_m <= 1.08 * round_arc  # one mitred corner would lie 80 m out
    _assert_keeps(route, [spike], 2.0)


_CENTRE = st.integers(-25, 25).map(float)
_SIDE = st.integers(2, 14).map(float)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(_CENTRE, _CENTRE, _SIDE, _SIDE), min_size=1, max_size=5), st.floats(0.1, 2.5))
def test_every_way_keeps_the_clearance_and_is_as_long_backwards(
    blocks: list[tuple[float, float, float, float]], clearance: float
) -> None:
    obstacles = [rectangle(*block) for block in blocks]
    start, goal = (-45.0, 3.0), (45.0, -7.0)
    route = shortest_route(start, goal, obstacles, clearance)
    assert isinstance(route, Route)
    assert route.length_m >= math.dist(start, goal) - 1e-9
    _assert_keeps(route, obstacles, clearance)
    back = shortest_route(goal, start, obstacles, clearance)
    assert isinstance(back, Route)
    assert back.length_m == pytest.approx(route.length_m, abs=1e-4)


def _assert_keeps(route: Route, obstacles: list[tuple[Xy, ...]], clearance_m: float) -> None:
    world = World([Prism(outline) for outline in obstacles])
    for a, b in pairwise(route.waypoints):
        t = np.linspace(0.0, 1.0, 200)[:, None]
        level = np.array(a) * (1 - t) + np.array(b) * t
        places = np.column_stack((level, np.full(len(level), 5.0)))
        assert world.gap_m(places).min() >= clearance_m - 1e-4
