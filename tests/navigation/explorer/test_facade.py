"""Walls in a scan: runs, normals, what is inspected, and which cells are the target's."""

import math

import numpy as np
import pytest

from navigation.camera import Pose, pinhole
from navigation.explorer.facade import (
    Seed,
    find_seed,
    inspected_share,
    normals,
    read_walls,
    runs,
    seen_cells,
    target_cells,
    unseen,
)
from navigation.explorer.map import OCCUPIED, cells_of, empty_map
from navigation.explorer.scan import Scan, panorama
from tests.navigation import usual
from tests.navigation.raycast_world import Prism, World, rectangle

HERE = Pose(0.0, 0.0, 8.0, math.pi / 2)


def _scan(*prisms: Prism, pose: Pose = HERE) -> Scan:
    return panorama(list(World(prisms).views(pose, pinhole(200, 24, 90.0)).values()), pose, 0.5, 1.2)


def test_a_wall_seen_slantwise_to_the_end_is_one_run() -> None:
    scan = _scan(Prism(rectangle(4.2, 20.0, 1.0, 36.0)))
    run = runs(scan)
    y = np.nan_to_num(scan.points(scan.range_m)[:, 1], posinf=0.0, neginf=0.0)
    along_side = (run >= 0) & (y > 3.0) & (y < 34.0)
    assert len(np.unique(run[along_side])) == 1


def test_a_wall_and_the_house_behind_its_edge_are_two_runs() -> None:
    scan = _scan(Prism(rectangle(-6.0, 12.0, 12.0, 4.0)), Prism(rectangle(8.0, 30.0, 30.0, 4.0)))
    run = runs(scan)
    assert len(np.unique(run[run >= 0])) == 2


def test_normals_stand_upright_on_the_wall_and_face_the_drone() -> None:
    turned = 0.4
    corners = tuple(
        (x * math.cos(turned) - y * math.sin(turned), x * math.sin(turned) + y * math.cos(turned))
        for x, y in rectangle(0.0, 11.0, 24.0, 4.0)
    )
    scan = _scan(Prism(corners))
    run = runs(scan)
    out = normals(scan, run)
    front = np.array((math.sin(turned), -math.cos(turned)))
    points = np.where(run[:, None] >= 0, scan.points(scan.range_m), 0.0)
    on_front = (run >= 0) & (np.abs(points @ front + 9.0) < 0.05)
    assert on_front.sum() > 100
    assert np.median(out[on_front] @ front) > 0.9999
    assert ((out[run >= 0] * -points[run >= 0]).sum(axis=1) >= 0).all()


def test_a_pole_faces_the_drone() -> None:
    scan = _scan(Prism(rectangle(0.1, 12.0, 0.2, 0.2)))
    hit = np.flatnonzero(np.isfinite(scan.range_m))
    assert 0 < len(hit) <= 2
    assert (normals(scan, runs(scan))[hit] @ np.array((0.0, -1.0)) > 0.99).all()


def test_the_search_starts_at_the_facade_ahead_not_at_the_nearest_thing() -> None:
    scan = _scan(Prism(rectangle(0.0, 11.0, 20.0, 4.0)), Prism(rectangle(-6.0, -1.0, 1.0, 1.0)))
    seed = find_seed(scan, read_walls(scan, usual.EXPLORER), (-25.0, 25.0))
    assert seed is not None
    assert (seed.x, seed.y) == (pytest.approx(0.0, abs=0.2), pytest.approx(9.0, abs=0.05))
    assert seed.normal == (pytest.approx(0.0, abs=0.02), pytest.approx(-1.0, abs=0.01))


def test_without_anything_near_there_is_no_start() -> None:
    scan = _scan(Prism(rectangle(0.0, 40.0, 20.0, 4.0)))
    assert find_seed(scan, read_walls(scan, usual.EXPLORER), (-25.0, 25.0)) is None


def _grid_with(*places: tuple[float, float]):
    grid = empty_map(0.0, 0.0)
    grid.state.reshape(-1)[cells_of(grid, np.array(places))] = OCCUPIED
    return grid


def test_the_target_hangs_together_over_a_metre_and_ends_at_a_wider_gap() -> None:
    wall = [(x, 5.1) for x in np.arange(-5.0, 5.0, 0.5) if not 0.9 < x < 1.6]
    beyond = [(x, 5.1) for x in np.arange(8.0, 12.0, 0.5)]
    target = target_cells(_grid_with(*wall, *beyond), Seed(0.0, 5.1, (0.0, -1.0)))
    assert int(target.sum()) == len(wall)


def test_specks_are_not_worth_a_stop_and_given_up_pieces_are_left_alone() -> None:
    wall = [(x + 0.1, 5.1) for x in np.arange(-5.0, 5.0, 0.5)]
    grid = _grid_with(*wall)
    target = target_cells(grid, Seed(0.0, 5.1, (0.0, -1.0)))
    settings = usual.EXPLORER
    assert np.array_equal(unseen(grid, target, settings), target)
    grid.inspected.reshape(-1)[cells_of(grid, np.array(wall[:-2]))] = True
    assert not unseen(grid, target, settings).any()
    seen = seen_cells(grid, target, settings)
    assert inspected_share(grid, target, seen) == pytest.approx((len(wall) - 1) / len(wall))
    grid.inspected[:] = False
    grid.attempts[target] = settings.attempts
    assert not unseen(grid, target, settings).any()
    assert not seen_cells(grid, target, settings).any()


def test_what_lies_beside_an_inspected_wall_counts_as_seen_as_far_as_is_asked_for() -> None:
    wall = [(x + 0.1, 5.1) for x in np.arange(-5.0, 5.0, 0.5)]
    grid = _grid_with(*wall, *((x, y + 1.0) for x, y in wall[:8]), *((x, y + 0.5) for x, y in wall[:8]))
    grid.inspected.reshape(-1)[cells_of(grid, np.array(wall))] = True
    target = target_cells(grid, Seed(0.0, 5.1, (0.0, -1.0)))
    assert unseen(grid, target, usual.EXPLORER).sum() == 8
    noisy = usual.EXPLORER._replace(beside_m=1.0)
    assert not unseen(grid, target, noisy).any()
    assert np.array_equal(seen_cells(grid, target, noisy), target)
