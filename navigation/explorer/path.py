"""Ways over the map: what is blocked, how far everything is, what of the facade a place would see."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.explorer.map import (
    CELL_M,
    FREE,
    OCCUPIED,
    SIZE,
    UNKNOWN,
    Cells,
    Map,
    cells_of,
    from_turns,
    middles_of,
    part_about,
)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STRIDE = 2
LATTICE = SIZE // STRIDE
NODE_M = CELL_M * STRIDE
_PAD = 2
_WIDE = LATTICE + 2 * _PAD
_STEPS = [
    (down, right) for down in range(-2, 3) for right in range(-2, 3) if math.gcd(abs(down), abs(right)) == 1
]  # 16 directions
_OFFSETS = np.array([down * _WIDE + right for down, right in _STEPS], np.intp)
_LENGTHS_M = np.array([math.hypot(down, right) * NODE_M for down, right in _STEPS])
_SIGHT_SAMPLES = 16
_SUBPIXEL_BITS = 4
_FAR_M = 20.0
MAX_PLACES = 192
MAX_PIECES = 256


class Reach(NamedTuple):
    """The cheapest ways from one place. `cost_m`, `parent`: by padded lattice node; inf and -1 where none leads."""

    start: int
    cost_m: Floats
    parent: NDArray[np.intp]


def clearance_m(grid: Map, keep_out: Bools | None = None) -> Floats:
    """(SIZE, SIZE) distance of each cell to the nearest that stands in the drone's way or is to be kept out of; the
    map's width where that is farther than 20 m."""
    clear = np.full((SIZE, SIZE), SIZE * CELL_M)
    standing = (grid.state == OCCUPIED) | grid.body
    if keep_out is not None:
        standing |= keep_out
    part = part_about(standing, round(_FAR_M / CELL_M))
    if clear[part].size:
        clear[part] = _away_m(standing[part])
    return clear


def cells_within(grid: Map, outlines: Sequence[Sequence[tuple[float, float]]]) -> Bools:
    """(SIZE, SIZE) the cells that lie at least in part within any of the outlines, ENU plan points."""
    within = np.zeros((SIZE, SIZE), np.uint8)
    for outline in outlines:
        columns_rows = (np.array(outline) - (grid.west_m, grid.south_m)) / CELL_M - 0.5
        corners = np.rint(columns_rows * (1 << _SUBPIXEL_BITS)).astype(np.int32)
        cv2.fillPoly(within, [corners], 1, shift=_SUBPIXEL_BITS)
    return within > 0


def wall_from(grid: Map, x: float, y: float, along: tuple[float, float], length_m: float, half_width_m: float) -> Bools:
    """(SIZE, SIZE) the cells within `half_width_m` of a straight line of `length_m` from (x, y)."""
    line = np.zeros((SIZE, SIZE), bool)
    places = np.array((x, y)) + np.arange(0.0, length_m, CELL_M / 2)[:, None] * np.array(along)
    cells = cells_of(grid, places)
    line.reshape(-1)[cells[cells >= 0]] = True
    return _within(line, half_width_m)


def _within(cells: Bools, reach_m: float) -> Bools:
    """(SIZE, SIZE) what lies no farther than that from any of the cells."""
    out = np.zeros_like(cells)
    part = part_about(cells, math.ceil(reach_m / CELL_M) + 1)
    if cells[part].size:
        out[part] = _away_m(cells[part]) <= reach_m
    return out


def _away_m(cells: Bools) -> Floats:
    """Distance of each cell to the nearest of these, of which there is at least one."""
    cells_away = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, 5)
    return cells_away.astype(np.float64) * CELL_M


class Room(NamedTuple):
    """What a way needs: `need_m` of clearance, `tight_m` near the drone; what a metre costs of unknown country, and of
    a place near the drone with less room than `need_m`."""

    need_m: float
    tight_m: float
    unknown_cost: float
    tight_cost: float = 1.0


def lattice_costs(grid: Map, clear_m: Floats, walls: Bools, at: Floats, room: Room) -> Floats:
    """(padded,) cost of a metre at each node: 1 in known free cells, more in unknown ones, inf where blocked.

    Within 3 m of the drone a node needs only the tight clearance, so that it can leave a tight place. The
    padding is blocked.
    """
    rows = (np.arange(LATTICE) * STRIDE + 0.5) * CELL_M + grid.south_m - at[1]
    columns = (np.arange(LATTICE) * STRIDE + 0.5) * CELL_M + grid.west_m - at[0]
    beside = np.hypot(columns[None, :], rows[:, None]) <= 3.0
    clear = clear_m[::STRIDE, ::STRIDE]
    narrow = clear < room.need_m
    blocked = narrow & ~(beside & (clear >= room.tight_m))
    cost = np.where(grid.state[::STRIDE, ::STRIDE] == UNKNOWN, room.unknown_cost, 1.0)
    cost[narrow] *= room.tight_cost
    cost[blocked | walls[::STRIDE, ::STRIDE]] = np.inf
    out: Floats = np.pad(cost, _PAD, constant_values=np.inf).reshape(-1)
    return out


def spread(cost: Floats, start: int, limit_m: float) -> Reach:
    """Dijkstra over 16 directions from a node, up to `limit_m`.

    No edge is cheaper than a node's width, so all nodes within that of the cheapest open one are final together: whole
    rings are settled at once.
    """
    far = np.full(_WIDE * _WIDE, np.inf)
    parent = np.full(_WIDE * _WIDE, -1, np.intp)
    settled = np.zeros(_WIDE * _WIDE, bool)
    far[start] = 0.0
    pending = np.array([start], np.intp)
    while len(pending):
        least = float(far[pending].min())
        if least > limit_m:
            break
        ring = far[pending] < least + NODE_M
        now, pending = pending[ring], pending[~ring]
        settled[now] = True
        to = (now[:, None] + _OFFSETS).reshape(-1)
        price = (far[now][:, None] + _LENGTHS_M * cost[to].reshape(len(now), -1)).reshape(-1)
        better = ~settled[to] & (price < far[to])
        to, price, origin = to[better], price[better], np.repeat(now, len(_OFFSETS))[better]
        order = np.argsort(-price, kind="stable")  # of several ways to a node the cheapest is written last
        far[to[order]] = price[order]
        parent[to[order]] = origin[order]
        pending = np.sort(np.concatenate((pending, to)))
        fresh = np.ones(len(pending), bool)
        fresh[1:] = pending[1:] != pending[:-1]
        pending = pending[fresh]
    far[~settled] = np.inf
    return Reach(start, far, parent)


def nodes_of(grid: Map, points: Floats) -> Cells:
    """(N,) padded lattice node nearest to each plan point; points outside are taken to the border."""
    column = np.rint((points[:, 0] - grid.west_m) / NODE_M - 0.5 / STRIDE)
    row = np.rint((points[:, 1] - grid.south_m) / NODE_M - 0.5 / STRIDE)
    clipped = np.clip(row, 0, LATTICE - 1) * _WIDE + np.clip(column, 0, LATTICE - 1)
    nodes: Cells = clipped.astype(np.intp) + _PAD * _WIDE + _PAD
    return nodes


def places_of(grid: Map, nodes: Cells) -> Floats:
    """(N, 2) ENU plan points of padded lattice nodes."""
    rows, columns = np.divmod(nodes, _WIDE)
    return np.stack(
        (
            grid.west_m + ((columns - _PAD) * STRIDE + 0.5) * CELL_M,
            grid.south_m + ((rows - _PAD) * STRIDE + 0.5) * CELL_M,
        ),
        axis=1,
    )


def near_nodes(mask: Bools, within_m: float) -> Bools:
    """(padded,) nodes no farther than that from any cell of the mask."""
    out: Bools = np.pad(_within(mask, within_m)[::STRIDE, ::STRIDE], _PAD).reshape(-1)
    return out


def way_to(grid: Map, reach: Reach, node: int) -> Floats:
    """(N, 2) ENU plan points from the node after the start to `node`; empty for the start itself."""
    nodes = []
    while node != reach.start and node >= 0:
        nodes.append(node)
        node = int(reach.parent[node])
    return places_of(grid, np.array(nodes[::-1], np.intp))


def sees(grid: Map, places: Floats, pieces: Cells, range_m: float, incidence_deg: float) -> Bools:
    """(P, U) does each place (P, 2) see each piece of facade (a cell with its normal): near enough, straight enough,
    and nothing known in the line of sight. Unknown country counts as clear."""
    ends = middles_of(grid, pieces)
    normal = from_turns(grid.normal.reshape(-1)[pieces])
    gap = places[:, None] - ends[None]
    away = np.hypot(gap[..., 0], gap[..., 1])
    front = (gap * normal).sum(axis=2)
    seen: Bools = (away <= range_m) & (front >= math.cos(math.radians(incidence_deg)) * away)
    p, u = np.nonzero(seen)
    if not len(p):
        return seen
    # the last metre lies before the wall itself, whose cells are as thick as half of that
    until = np.maximum(0.0, 1.0 - 1.2 / np.maximum(away[p, u], 1e-6))
    share = np.linspace(0.05, 1.0, _SIGHT_SAMPLES)[None, :] * until[:, None]
    x = places[p, 0][:, None] * (1 - share) + ends[u, 0][:, None] * share
    y = places[p, 1][:, None] * (1 - share) + ends[u, 1][:, None] * share
    column = ((x - grid.west_m) / CELL_M).astype(np.intp).clip(0, SIZE - 1)
    row = ((y - grid.south_m) / CELL_M).astype(np.intp).clip(0, SIZE - 1)
    seen[p, u] = ~(grid.state[row, column] == OCCUPIED).any(axis=1)
    return seen


def is_known_free(grid: Map, clear_m: Floats, walls: Bools, start: Floats, end: Floats, need_m: float) -> bool:
    """Does the straight way lie in known free cells with that clearance, the first 3 m with what there is at the
    start, and cross none of `walls`?"""
    length = float(np.hypot(*(end - start)))
    share = np.linspace(0.0, 1.0, max(2, math.ceil(length / (CELL_M / 2)) + 1))
    cells = cells_of(grid, start + share[:, None] * (end - start))
    if (cells < 0).any():
        return False
    clear = clear_m.reshape(-1)[cells]
    near = share * length < 3.0
    enough = (clear >= need_m) | (near & (clear >= min(need_m, float(clear[0]) - CELL_M)))
    known = (grid.state.reshape(-1)[cells] == FREE) | (share * length < 1.5)
    return bool((enough & known & ~walls.reshape(-1)[cells]).all())


def near_cells(place: Floats, grid: Map, within_m: float) -> Bools:
    """(SIZE, SIZE) the cells within a distance of a plan point."""
    x = grid.west_m + (np.arange(SIZE) + 0.5) * CELL_M - place[0]
    y = grid.south_m + (np.arange(SIZE) + 0.5) * CELL_M - place[1]
    out: Bools = np.hypot(x[None, :], y[:, None]) <= within_m
    return out
