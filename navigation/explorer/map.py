"""The explorer's map: a square grid about its first place, what is known of each cell, and how a scan changes it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.explorer.scan import BIN_DEG, BINS, REACH_DEG, Scan

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Cells = NDArray[np.intp]
"""(N,) flat cell numbers: row * SIZE + column; the row counts north, the column east."""

SIZE = 440
CELL_M = 0.5
UNKNOWN, FREE, OCCUPIED = 0, 1, 2
_CARVE_M = 40.0
_FILL_STEP_M = 0.3


Part = tuple[slice, slice]
"""A rectangle of the map: of its rows, of its columns."""


class Map(NamedTuple):
    """All planes are (SIZE, SIZE). `west_m`, `south_m`: the grid's corner, ENU.

    `state`: unknown, free or occupied, in the facade's band. `body`: something stands there at the drone's height
    (the band and what overhangs it). `normal`: of occupied and expected cells, out of the wall, 256 to the turn.
    `inspected`: seen from near and not too slantwise. `expected`: unknown, but the facade is thought to run there.
    `attempts`: stops that were flown to see the cell and did not. `awaited`: cells the stop flown to should show.
    """

    west_m: float
    south_m: float
    state: Bytes
    body: Bools
    normal: Bytes
    inspected: Bools
    expected: Bools
    attempts: Bytes
    awaited: Bools

    def copy(self) -> "Map":
        return self._replace(**{name: getattr(self, name).copy() for name in self._fields[2:]})


def empty_map(x: float, y: float) -> Map:
    """Nothing known, with (x, y) in the middle."""

    half = SIZE * CELL_M / 2
    return Map(
        x - half,
        y - half,
        np.zeros((SIZE, SIZE), np.uint8),
        np.zeros((SIZE, SIZE), np.bool_),
        np.zeros((SIZE, SIZE), np.uint8),
        np.zeros((SIZE, SIZE), np.bool_),
        np.zeros((SIZE, SIZE), np.bool_),
        np.zeros((SIZE, SIZE), np.uint8),
        np.zeros((SIZE, SIZE), np.bool_),
    )


def cells_of(grid: Map, points: Floats) -> Cells:
    """(N,) the cells of plan points (N, 2) ENU, -1 outside the map."""
    column = np.floor((points[:, 0] - grid.west_m) / CELL_M)
    row = np.floor((points[:, 1] - grid.south_m) / CELL_M)
    inside = (column >= 0) & (column < SIZE) & (row >= 0) & (row < SIZE)
    flat = np.where(inside, row * SIZE + column, -1)
    return flat.astype(np.intp)


def middles_of(grid: Map, cells: Cells) -> Floats:
    """(N, 2) ENU middles of cells."""
    rows, columns = np.divmod(cells, SIZE)
    return np.stack((grid.west_m + (columns + 0.5) * CELL_M, grid.south_m + (rows + 0.5) * CELL_M), axis=1)


def to_turns(normals: Floats) -> Bytes:
    """(N, 2) vectors to directions, 256 to the turn."""
    angle = np.arctan2(normals[:, 1], normals[:, 0])
    return np.rint(angle * (256 / math.tau)).astype(np.int64).astype(np.uint8)


def from_turns(turns: Bytes) -> Floats:
    """(N, 2) unit vectors."""
    angle = turns.astype(np.float64) * (math.tau / 256)
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def part_about(cells: Bools, margin: int) -> Part:
    """The rectangle about all of the cells, so many more on each side as there are; empty where there are none. Most
    of the map lies far from what a question is about."""
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    if not len(rows):
        return np.s_[0:0, 0:0]
    top, left = max(0, int(rows[0]) - margin), max(0, int(columns[0]) - margin)
    return np.s_[top : int(rows[-1]) + margin + 1, left : int(columns[-1]) + margin + 1]


def carve(grid: Map, scan: Scan) -> None:
    """Clears, in place, what the scan looked through.

    A cell is free where every ray through it goes on beyond it; that asks each cell for its rays, so a pole between
    two rays is never cleared away. A cell that was occupied needs a metre more.
    """
    half = int(_CARVE_M / CELL_M)
    middle_column = int((scan.pose.x - grid.west_m) / CELL_M)
    middle_row = int((scan.pose.y - grid.south_m) / CELL_M)
    rows = np.arange(max(0, middle_row - half), min(SIZE, middle_row + half + 1))
    columns = np.arange(max(0, middle_column - half), min(SIZE, middle_column + half + 1))
    if not len(rows) or not len(columns):
        return
    dx = grid.west_m + (columns + 0.5) * CELL_M - scan.pose.x
    dy = grid.south_m + (rows + 0.5) * CELL_M - scan.pose.y
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    state, body = grid.state[part], grid.body[part]
    near = dx[None, :] ** 2 + dy[:, None] ** 2 <= _CARVE_M**2
    row, column = np.nonzero(((state != FREE) | body) & near)  # the others have nothing to clear
    dx, dy = dx[column], dy[row]
    away = np.hypot(dx, dy)
    bearing = np.degrees(scan.pose.yaw - np.arctan2(dy, dx))
    bearing = np.mod(bearing + 180.0, 360.0) - 180.0
    spread = np.degrees(np.arcsin(np.minimum(1.0, 0.36 / np.maximum(away, 0.36))))
    seen_to = _least_within(np.minimum(scan.range_m, scan.reach_m), bearing, spread)
    was = state[row, column]
    clear = (away + 0.55 < seen_to) & (was == UNKNOWN)
    wiped = (away + 1.1 < seen_to) & (was == OCCUPIED)
    freed = clear | wiped
    state[row[freed], column[freed]] = FREE
    grid.inspected[part][row[wiped], column[wiped]] = False
    solid = body[row, column]
    row, column, away = row[solid], column[solid], away[solid]
    gone = away + 1.1 < _least_within(np.minimum(scan.body_m, scan.reach_m), bearing[solid], spread[solid])
    body[row[gone], column[gone]] = False


def draw_hits(grid: Map, scan: Scan, runs: Cells, normals: Floats, good: Bools, map_range_m: float) -> None:
    """Draws, in place, the returns of the facade's band with their normals, and those of the body's band.

    runs (BINS,): the run of each return, -1 for none; normals (BINS, 2); good (BINS,): seen well enough to count as
    inspected. Gaps between neighbours of one run are filled: slantwise walls have fewer rays than cells.
    """
    points, bodies = scan.points(scan.range_m), scan.points(scan.body_m)
    hit = (runs >= 0) & (scan.range_m <= map_range_m)
    index = np.flatnonzero(hit)
    follows = index[:-1][(np.diff(index) == 1) & (runs[index[:-1]] == runs[index[1:]])] if len(index) > 1 else index[:0]
    owners, places = [index], [points[index]]
    if len(follows):
        leg = points[follows + 1] - points[follows]
        count = np.maximum(0, np.ceil(np.hypot(leg[:, 0], leg[:, 1]) / _FILL_STEP_M).astype(np.intp) - 1)
        owner = np.repeat(np.arange(len(follows)), count)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 1
        share = step / (count[owner] + 1)
        owners.append(follows[owner])
        places.append(points[follows[owner]] + leg[owner] * share[:, None])
    owner, place = np.concatenate(owners), np.concatenate(places)
    cells = cells_of(grid, place)
    owner, cells = owner[cells >= 0], cells[cells >= 0]
    state, normal, inspected = grid.state.reshape(-1), grid.normal.reshape(-1), grid.inspected.reshape(-1)
    fresh = state[cells] != OCCUPIED
    grid.attempts.reshape(-1)[cells[fresh]] = 0
    grid.expected.reshape(-1)[cells] = False
    state[cells] = OCCUPIED
    better = fresh | good[owner] | ~inspected[cells]
    normal[cells[better]] = to_turns(normals[owner[better]])
    inspected[cells[good[owner]]] = True
    in_way = np.isfinite(scan.body_m) & (scan.body_m <= min(25.0, map_range_m))
    body_cells = cells_of(grid, bodies[in_way])
    grid.body.reshape(-1)[body_cells[body_cells >= 0]] = True


def _least_within(ranges_m: Floats, bearing_deg: Floats, spread_deg: Floats) -> Floats:
    """The least range of the bins within `spread_deg` of each bearing; 0 where any of them was not seen.

    By doubling: the least over 1, 2, 4 ... bins from each bin on; two overlapping pieces cover any span.
    """
    first = np.floor((bearing_deg - spread_deg + REACH_DEG) / BIN_DEG).astype(np.intp)
    last = np.floor((bearing_deg + spread_deg + REACH_DEG) / BIN_DEG).astype(np.intp)
    seen = (first >= 0) & (last < BINS)
    first, last = np.clip(first, 0, BINS - 1), np.clip(last, 0, BINS - 1)
    table = [np.where(np.isnan(ranges_m), 0.0, ranges_m)]
    while (1 << len(table)) <= BINS:
        before, half = table[-1], 1 << (len(table) - 1)
        table.append(np.minimum(before, np.concatenate((before[half:], np.full(half, np.inf)))))
    level = np.log2(last - first + 1).astype(np.intp)
    stacked = np.stack(table)
    least = np.minimum(stacked[level, first], stacked[level, last + 1 - (1 << level)])
    return np.where(seen, least, 0.0)
