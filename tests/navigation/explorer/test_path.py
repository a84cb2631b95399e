"""Ways over the map, and what a place sees."""

import heapq
import math

import cv2
import numpy as np
import pytest

from navigation.explorer import path
from navigation.explorer.map import CELL_M, FREE, OCCUPIED, SIZE, Map, cells_of, empty_map, to_turns

ROOM = path.Room(2.1, 1.3, 1.3)
NO_WALLS = np.zeros((SIZE, SIZE), bool)


def _field(*blocks: tuple[float, float, float, float]) -> Map:
    """Free all over, with occupied rectangles (x0, y0, x1, y1)."""
    grid = empty_map(0.0, 0.0)
    grid.state[:] = FREE
    for x0, y0, x1, y1 in blocks:
        columns = slice(int((x0 - grid.west_m) / CELL_M), int((x1 - grid.west_m) / CELL_M))
        rows = slice(int((y0 - grid.south_m) / CELL_M), int((y1 - grid.south_m) / CELL_M))
        grid.state[rows, columns] = OCCUPIED
    return grid


def _spread(grid: Map, at: tuple[float, float], limit_m: float, walls=NO_WALLS) -> tuple[path.Reach, np.ndarray]:
    here = np.array(at)
    cost = path.lattice_costs(grid, path.clearance_m(grid), walls, here, ROOM)
    return path.spread(cost, int(path.nodes_of(grid, here[None])[0]), limit_m), cost


def test_nodes_and_places_are_each_others_inverse() -> None:
    grid = empty_map(5.0, -3.0)
    places = np.array([[5.0, -3.0], [-40.0, 60.0], [114.0, 106.0]])
    nodes = path.nodes_of(grid, places)
    assert np.abs(path.places_of(grid, nodes) - places).max() <= 0.75
    assert np.array_equal(path.nodes_of(grid, path.places_of(grid, nodes)), nodes)


def test_rings_settled_at_once_are_as_good_as_dijkstra_node_by_node() -> None:
    grid = _field((3.0, -8.0, 5.0, 9.0), (-9.0, 4.0, 3.0, 6.0))
    grid.state[: SIZE // 2 - 6][grid.state[: SIZE // 2 - 6] == FREE] = 0
    reach, cost = _spread(grid, (0.0, 0.0), 25.0)
    wide = math.isqrt(len(cost))
    steps = [
        (dy * wide + dx, math.hypot(dx, dy))
        for dy in range(-2, 3)
        for dx in range(-2, 3)
        if math.gcd(abs(dx), abs(dy)) == 1
    ]
    best = {reach.start: 0.0}
    heap = [(0.0, reach.start)]
    while heap:
        done, node = heapq.heappop(heap)
        if done > best[node] or done > 25.0:
            continue
        for step, length in steps:
            price = done + length * cost[node + step]
            if price < best.get(node + step, math.inf):
                best[node + step] = price
                heapq.heappush(heap, (price, node + step))
    reached = {n: c for n, c in best.items() if c <= 25.0}
    assert len(reached) > 200
    assert all(reach.cost_m[n] == pytest.approx(c) for n, c in reached.items())


def test_the_way_keeps_the_clearance_and_goes_round() -> None:
    grid = _field((4.0, -10.0, 6.0, 10.0))
    reach, _ = _spread(grid, (0.0, 0.0), 60.0)
    goal = int(path.nodes_of(grid, np.array([[10.0, 0.0]]))[0])
    way = path.way_to(grid, reach, goal)
    assert reach.cost_m[goal] > 20.0
    assert np.hypot(*(way[-1] - (10.0, 0.0))) < 1.0
    clear = path.clearance_m(grid).reshape(-1)[cells_of(grid, way)]
    assert clear.min() >= ROOM.need_m


def test_a_tight_place_beside_the_drone_may_be_left_by_the_wide_side() -> None:
    """A spike 2 m off the drone: the straight way passes it with less room than it needs, a dear one keeps away."""
    grid = _field((1.5, -1.5, 2.0, -1.0))
    clear, here = path.clearance_m(grid), np.array((0.5, 0.5))
    start, goal = path.nodes_of(grid, np.array([[0.5, 0.5], [8.0, -0.5]]))
    least = {}
    for tight_cost in (1.0, 6.0):
        cost = path.lattice_costs(grid, clear, NO_WALLS, here, ROOM._replace(tight_cost=tight_cost))
        way = path.way_to(grid, path.spread(cost, int(start), 60.0), int(goal))
        least[tight_cost] = float(clear.reshape(-1)[cells_of(grid, way)].min())
    assert ROOM.tight_m <= least[1.0] < ROOM.need_m <= least[6.0]


def test_a_wall_of_the_cut_is_not_crossed() -> None:
    grid = _field()
    walls = path.wall_from(grid, 4.0, -60.0, (0.0, 1.0), 120.0, 1.25)
    reach, _ = _spread(grid, (0.0, 0.0), 30.0, walls)
    places = path.places_of(grid, np.flatnonzero(np.isfinite(reach.cost_m)))
    assert places[:, 0].max() < 3.5
    clear = path.clearance_m(grid)
    assert path.is_known_free(grid, clear, NO_WALLS, np.zeros(2), np.array((8.0, 0.0)), 1.7)
    assert not path.is_known_free(grid, clear, walls, np.zeros(2), np.array((8.0, 0.0)), 1.7)


def test_the_straight_way_must_be_known_free_with_clearance() -> None:
    grid = _field((-5.0, 2.5, 20.0, 4.0))
    clear = path.clearance_m(grid)
    here = np.zeros(2)
    assert path.is_known_free(grid, clear, NO_WALLS, here, np.array((8.0, 0.0)), 1.75)
    assert not path.is_known_free(grid, clear, NO_WALLS, here, np.array((8.0, 1.5)), 1.75)
    grid.state[:, SIZE // 2 + 10 :] = 0
    assert not path.is_known_free(grid, clear, NO_WALLS, here, np.array((8.0, 0.0)), 1.75)


def test_a_place_sees_near_walls_that_face_it_and_nothing_behind_others() -> None:
    grid = _field((-6.0, 8.0, 6.0, 8.5), (2.0, 3.0, 5.0, 3.5))
    pieces = cells_of(grid, np.array([[0.1, 8.1], [5.6, 8.1], [-5.9, 8.1], [0.1, 20.1]]))
    grid.normal.reshape(-1)[pieces] = to_turns(np.array([[0.0, -1.0]]))[0]
    sees = path.sees(grid, np.array([[0.0, 0.0], [0.0, 12.0]]), pieces, 11.0, 59.0)
    assert sees.tolist() == [[True, False, True, False], [False, False, False, True]]


def test_the_edge_of_the_map_is_no_way_out() -> None:
    grid = _field()
    reach, _ = _spread(grid, (108.0, 0.0), 12.0)
    places = path.places_of(grid, np.flatnonzero(np.isfinite(reach.cost_m)))
    assert places[:, 0].max() <= 110.0


def test_the_clearance_is_right_as_far_as_it_is_asked_for_and_wide_open_beyond() -> None:
    grid = _field((0.0, 10.0, 4.0, 12.0), (-30.0, -5.0, -29.0, 40.0))
    grid.body.reshape(-1)[cells_of(grid, np.array([[20.1, 3.1]]))] = True
    standing = (grid.state == OCCUPIED) | grid.body
    exact = cv2.distanceTransform((~standing).astype(np.uint8), cv2.DIST_L2, 5) * CELL_M
    clear = path.clearance_m(grid)
    assert np.array_equal(clear[exact <= 20.0], exact[exact <= 20.0])
    assert (clear[exact > 20.0] > 20.0).all()
    assert (path.clearance_m(empty_map(0.0, 0.0)) > 20.0).all()
