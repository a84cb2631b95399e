"""The explorer's map: drawing what was hit, clearing what was looked through."""

import math

import numpy as np
import pytest

from navigation.camera import Pose, pinhole
from navigation.explorer.facade import read_walls
from navigation.explorer.map import (
    FREE,
    OCCUPIED,
    SIZE,
    UNKNOWN,
    Map,
    carve,
    cells_of,
    draw_hits,
    empty_map,
    from_turns,
    middles_of,
    part_about,
    to_turns,
)
from navigation.explorer.scan import Scan, panorama
from tests.navigation import usual
from tests.navigation.raycast_world import Prism, World, rectangle

HERE = Pose(0.0, 0.0, 8.0, math.pi / 2)
WALL = Prism(rectangle(0, 10.5, 30, 1))


def _scan(prisms: list[Prism], pose: Pose = HERE) -> Scan:
    return panorama(list(World(prisms).views(pose, pinhole(200, 24, 90.0)).values()), pose, 0.5, 1.2)


def _drawn(grid: Map, scan: Scan) -> Map:
    walls = read_walls(scan, usual.EXPLORER)
    carve(grid, scan)
    draw_hits(grid, scan, walls.run, walls.normal, walls.good, 45.0)
    return grid


def _at(grid: Map, x: float, y: float) -> int:
    return int(grid.state.reshape(-1)[cells_of(grid, np.array([[x, y]]))[0]])


def test_cells_and_places_are_each_others_inverse_and_outside_is_no_cell() -> None:
    grid = empty_map(3.0, -7.0)
    cells = np.arange(0, SIZE * SIZE, 977)
    assert np.array_equal(cells_of(grid, middles_of(grid, cells)), cells)
    assert cells_of(grid, np.array([[3.0 + 111.0, 0.0], [0.0, -7.0 - 111.0]])).tolist() == [-1, -1]


def test_directions_survive_being_kept_in_a_byte() -> None:
    angle = np.linspace(-3.1, 3.1, 50)
    normals = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    assert ((from_turns(to_turns(normals)) * normals).sum(axis=1) > math.cos(math.tau / 500)).all()


def test_before_a_wall_is_free_the_wall_is_occupied_and_behind_it_nothing_is_known() -> None:
    grid = _drawn(empty_map(0.0, 0.0), _scan([WALL]))
    assert [_at(grid, 0.0, y) for y in (2.0, 8.0, 10.2, 12.0)] == [FREE, FREE, OCCUPIED, UNKNOWN]
    assert _at(grid, 0.0, -5.0) == UNKNOWN  # behind the drone no camera looks
    assert (grid.state[grid.inspected] == OCCUPIED).all()
    out = from_turns(grid.normal[grid.inspected])
    assert (out @ np.array((0.0, -1.0)) > 0.98).all()


def test_a_wall_has_no_holes_where_it_is_seen_slantwise() -> None:
    grid = _drawn(empty_map(0.0, 0.0), _scan([Prism(rectangle(4.2, 20.0, 1.0, 36.0))]))
    column = [_at(grid, 3.7, y) for y in np.arange(2.5, 30.0, 0.5)]
    assert column == [OCCUPIED] * len(column)


def test_a_pole_thinner_than_a_cell_is_not_cleared_by_the_rays_that_pass_it() -> None:
    pole = Prism(rectangle(1.0, 8.0, 0.3, 0.3))
    grid = _drawn(empty_map(0.0, 0.0), _scan([WALL, pole]))
    cell = cells_of(grid, np.array([[1.0, 8.0]]))[0]
    block = grid.state[cell // SIZE - 1 : cell // SIZE + 2, cell % SIZE - 1 : cell % SIZE + 2]
    assert (block == OCCUPIED).any()
    again = _drawn(grid, _scan([WALL, pole], HERE._replace(x=-1.5, y=1.0)))
    block = again.state[cell // SIZE - 1 : cell // SIZE + 2, cell % SIZE - 1 : cell % SIZE + 2]
    assert (block == OCCUPIED).any()


def test_what_has_gone_away_is_cleared() -> None:
    grid = _drawn(empty_map(0.0, 0.0), _scan([WALL, Prism(rectangle(1.0, 7.0, 1.5, 1.5))]))
    assert _at(grid, 1.0, 6.3) == OCCUPIED
    _drawn(grid, _scan([WALL]))
    assert _at(grid, 1.0, 6.3) == FREE


def test_facade_counts_as_inspected_only_from_near_and_not_too_slantwise() -> None:
    far = _drawn(empty_map(0.0, 0.0), _scan([Prism(rectangle(0, 14.5, 30, 1))]))
    assert not far.inspected.any()
    near = _drawn(empty_map(0.0, 0.0), _scan([WALL]))
    reach = np.abs(middles_of(near, np.flatnonzero(near.inspected.reshape(-1)))[:, 0]).max()
    assert reach == pytest.approx(math.sqrt(11.5**2 - 10.0**2), abs=0.6)


def test_returns_beyond_the_map_are_left_out() -> None:
    grid = _drawn(empty_map(-105.0, 0.0), _scan([WALL]))
    assert grid.state.shape == (SIZE, SIZE)
    _drawn(empty_map(-200.0, 0.0), _scan([WALL]))


def test_the_part_about_cells_holds_them_with_a_margin_and_ends_at_the_maps_border() -> None:
    cells = np.zeros((SIZE, SIZE), bool)
    assert not cells[part_about(cells, 3)].size
    cells[5, 100] = cells[9, 437] = True
    rows, columns = part_about(cells, 7)
    assert (rows.start, columns.start) == (0, 93)
    assert cells[rows, columns].shape == (17, SIZE - 93)
    assert cells[rows, columns].sum() == 2
