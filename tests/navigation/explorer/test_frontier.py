"""What the ends of a wall let expect."""

import math

import numpy as np
import pytest

from navigation.camera import Pose, pinhole
from navigation.explorer.facade import find_seed, read_walls, target_cells
from navigation.explorer.frontier import Guess, expect, guesses
from navigation.explorer.map import Map, carve, draw_hits, empty_map, middles_of
from navigation.explorer.scan import panorama
from tests.navigation import usual
from tests.navigation.raycast_world import Prism, World, rectangle

HERE = Pose(0.0, 0.0, 8.0, math.pi / 2)
SETTINGS = usual.EXPLORER
HOUSE = Prism(rectangle(0.0, 14.0, 16.0, 10.0))


def _looked(
    *prisms: Prism, pose: Pose = HERE, grid: Map | None = None, beyond: float = math.inf
) -> tuple[Map, list[Guess]]:
    """`beyond`: what a pixel says that shows nothing."""
    views = list(World(prisms).views(pose, pinhole(300, 24, 90.0)).values())
    for view in views:
        view.depth_m[np.isinf(view.depth_m)] = beyond
    scan = panorama(views, pose, 0.5, 1.2)
    walls = read_walls(scan, SETTINGS)
    grid = grid or empty_map(0.0, 0.0)
    carve(grid, scan)
    draw_hits(grid, scan, walls.run, walls.normal, walls.good, 45.0)
    seed = find_seed(scan, walls, (-25.0, 25.0))
    assert seed is not None
    target = target_cells(grid, seed)
    found = list(guesses(grid, scan, walls, target, SETTINGS))
    expect(grid, scan, walls, target, SETTINGS)
    return grid, found


def _expected(grid: Map) -> np.ndarray:
    return middles_of(grid, np.flatnonzero(grid.expected.reshape(-1)))


def test_a_hidden_face_is_expected_behind_each_edge() -> None:
    grid, found = _looked(HOUSE)
    assert sorted(round(g.normal[0]) for g in found) == [-1, 1]
    assert all(g.length_m == SETTINGS.hidden_face_m and g.along[1] > 0.95 for g in found)
    places = _expected(grid)
    assert len(places) > 20
    assert (np.abs(np.abs(places[:, 0]) - 8.2) < 0.8).all()
    assert (places[:, 1] > 9.0).all()


def test_where_nothing_is_known_past_an_edge_a_wall_goes_on_until_it_was_looked_for_in_vain() -> None:
    """Under the eaves of a pagoda a stereo camera tells no air past the corner."""
    grid, found = _looked(HOUSE, beyond=math.nan)
    on = [g for g in found if abs(g.along[0]) > 0.95]
    assert sorted(round(g.along[0]) for g in on) == [-1, 1]
    assert all(g.length_m == SETTINGS.straight_on_m for g in on)
    places = _expected(grid)
    assert ((np.abs(places[:, 0]) > 8.5) & (np.abs(places[:, 1] - 9.0) < 1.0)).sum() >= 10
    grid.attempts[grid.expected] = 1
    grid, found = _looked(HOUSE, grid=grid, beyond=math.nan)
    assert sorted(round(g.normal[0]) for g in found) == [-1, 1]
    assert all(g.length_m == SETTINGS.hidden_face_m and g.along[1] > 0.95 for g in found)
    assert (_expected(grid)[:, 1] > 9.0).all()


def test_a_wall_that_something_hides_is_expected_to_go_straight_on() -> None:
    pillar = Prism(rectangle(5.0, 4.0, 1.0, 1.0))
    _, found = _looked(Prism(rectangle(5.0, 14.0, 9.0, 10.0)), pillar)
    straight = [g for g in found if abs(g.along[0]) > 0.95]
    assert straight
    assert all(g.normal[1] < -0.95 for g in straight)


def test_a_gap_in_one_wall_is_bridged() -> None:
    pole = Prism(rectangle(2.0, 5.0, 0.6, 0.6))
    _, found = _looked(HOUSE, pole)
    bridges = [g for g in found if abs(g.along[0]) > 0.95 and g.length_m < SETTINGS.straight_on_m]
    assert bridges
    assert bridges[0].length_m == pytest.approx(0.6 * 9 / 4.7, abs=0.5)


def test_a_niche_of_the_facade_is_no_edge() -> None:
    left, right = Prism(rectangle(-6.0, 14.0, 8.0, 10.0)), Prism(rectangle(6.0, 14.0, 8.0, 10.0))
    _, found = _looked(left, right, Prism(rectangle(0.0, 14.3, 6.0, 9.6)))  # 0.5 m deep, 4 m wide
    assert all(abs(g.start[0]) > 5.0 for g in found)


def test_what_was_expected_and_has_been_seen_is_forgotten() -> None:
    grid, _ = _looked(HOUSE)
    before = _expected(grid)
    grid, _ = _looked(HOUSE, pose=Pose(16.0, 6.0, 8.0, math.radians(150.0)), grid=grid)
    after = _expected(grid)
    assert (before[:, 0] > 7.0).sum() > 10
    assert ((after[:, 0] > 7.0) & (after[:, 1] < 17.0)).sum() == 0


def test_nothing_is_expected_inside_a_contour_that_has_closed() -> None:
    grid = None
    for x, y in ((0.0, 0.0), (17.0, 14.0), (0.0, 28.0), (-17.0, 14.0)):
        look = Pose(x, y, 8.0, math.atan2(14.0 - y, -x))
        grid, _ = _looked(HOUSE, pose=look, grid=grid)
    assert grid is not None
    inside = np.abs(_expected(grid) - (0.0, 14.0)) < (7.0, 4.0)
    assert not inside.all(axis=1).any()
