"""Walls in a scan: runs of returns, their normals, what of them is inspected, and which of them is the target."""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.explorer.map import CELL_M, OCCUPIED, SIZE, Map, cells_of, part_about
from navigation.explorer.parameters import ExplorerParameters
from navigation.explorer.scan import BINS, Scan

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Cells = NDArray[np.intp]


class Walls(NamedTuple):
    """Of one scan, each (BINS,): `run`: which unbroken piece of wall a return belongs to, -1 for no return; `normal`
    (BINS, 2): out of the wall, towards the drone; `good`: seen from near and straight enough to count as inspected."""

    run: Cells
    normal: Floats
    good: Bools


class Seed(NamedTuple):
    """Where the target's facade was first seen (ENU), and its normal there."""

    x: float
    y: float
    normal: tuple[float, float]


def read_walls(scan: Scan, settings: ExplorerParameters) -> Walls:
    """Runs, normals and what is well seen."""
    run = runs(scan)
    normal = normals(scan, run)
    points = scan.points(scan.range_m)
    with np.errstate(invalid="ignore"):
        sight = np.array((scan.pose.x, scan.pose.y)) - points
        straight = (sight * normal).sum(axis=1) >= math.cos(math.radians(settings.inspect_incidence_deg)) * scan.range_m
    good = (run >= 0) & straight & (scan.range_m <= settings.inspect_range_m)
    return Walls(run, normal, good)


def runs(scan: Scan) -> Cells:
    """(BINS,) number of the run of each return, rising from left to right; -1 where there is none.

    Neighbours belong together where they lie near each other, or where the second lies on the straight wall through
    the two before it: along a straight wall, 1 / range is a sine of the bearing.
    """
    ranges = scan.range_m
    hit = np.isfinite(ranges) & (ranges > 0)
    points = scan.points(np.where(hit, ranges, 0.0))
    gap = np.hypot(*np.diff(points, axis=0).T)
    inverse = np.where(hit, 1.0 / np.maximum(ranges, 1e-3, where=hit, out=np.full(BINS, 1.0)), 0.0)
    both = hit[:-1] & hit[1:]
    near = gap < 0.7 + 0.05 * np.minimum(ranges[:-1], ranges[1:], where=both, out=np.zeros(BINS - 1))
    straight = np.zeros(BINS - 1, bool)
    turn = np.deg2rad(np.diff(scan.bearing_deg))
    both_turns = turn[1:] + turn[:-1]
    off = (
        np.abs(  # of three neighbours, from one straight wall
            inverse[2:] * np.sin(turn[:-1]) - inverse[1:-1] * np.sin(both_turns) + inverse[:-2] * np.sin(turn[1:])
        )
        / np.maximum(np.sin(turn[:-1]), 1e-4)
    )
    on_line = off * np.where(hit[1:-1], ranges[1:-1], 0.0) ** 2 < 0.25 + 0.15 * gap[1:]
    straight[1:] |= on_line & hit[:-2]
    straight[:-1] |= on_line & hit[2:]
    joined = both & (near | (straight & (gap < 3.0)))
    number = np.cumsum(np.concatenate(([1], ~joined)))
    return np.where(hit, number, -1).astype(np.intp)


def normals(scan: Scan, run: Cells) -> Floats:
    """(BINS, 2) unit normals towards the drone, by total least squares in a window that never crosses a run's end.

    The window reaches 0.9 m each way, or 5 % of the range. Two returns or fewer are taken to face the drone.
    """
    hit = run >= 0
    points = scan.points(np.where(hit, scan.range_m, 0.0)) - np.array((scan.pose.x, scan.pose.y))
    leg = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
    breaks = np.concatenate(([False], run[1:] != run[:-1]))
    along = np.cumsum(np.where(breaks, 1e4, leg))
    reach = np.where(hit, np.maximum(0.9, 0.05 * np.where(hit, scan.range_m, 0.0)), 0.0)
    low = np.searchsorted(along, along - reach, side="left")
    high = np.searchsorted(along, along + reach, side="right")
    count = np.maximum(high - low, 1)

    def window(values: Floats) -> Floats:
        total = np.concatenate(([0.0], np.cumsum(values)))
        out: Floats = (total[high] - total[low]) / count
        return out

    x, y = points[:, 0], points[:, 1]
    mean_x, mean_y = window(x), window(y)
    xx, yy = window(x * x) - mean_x**2, window(y * y) - mean_y**2
    xy = window(x * y) - mean_x * mean_y
    wall = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    normal = np.stack((-np.sin(wall), np.cos(wall)), axis=1)
    away = np.maximum(np.hypot(x, y), 1e-9)
    to_drone = np.stack((-x / away, -y / away), axis=1)
    normal = np.where((high - low < 3)[:, None], to_drone, normal)
    out: Floats = normal * np.where((normal * to_drone).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return out


def find_seed(scan: Scan, walls: Walls, box_deg: tuple[float, float]) -> Seed | None:
    """The facade ahead: of the runs within `box_deg` (bearings, left to right) and 16 m the one with most returns,
    at its return nearest to the box's middle. Where there is none, anything within 25 m, wherever; None for nothing."""
    bearing = scan.bearing_deg
    near = (walls.run >= 0) & (scan.range_m <= 16.0) & (bearing >= box_deg[0]) & (bearing <= box_deg[1])
    if not near.any():
        near = (walls.run >= 0) & (scan.range_m <= 25.0)
    if not near.any():
        return None
    most = np.bincount(walls.run[near]).argmax()
    members = np.flatnonzero(near & (walls.run == most))
    at = members[np.abs(bearing[members] - (box_deg[0] + box_deg[1]) / 2).argmin()]
    x, y = scan.points(scan.range_m)[at]
    return Seed(float(x), float(y), (float(walls.normal[at, 0]), float(walls.normal[at, 1])))


def target_cells(grid: Map, seed: Seed) -> Bools:
    """(SIZE, SIZE) the target building's cells: those that hang together with the seed over gaps of up to a metre.

    What stands at the body's height links pieces too: eaves and balconies run on where they hide the wall behind.
    """
    target = np.zeros((SIZE, SIZE), bool)
    solid = grid.state == OCCUPIED
    standing = solid | grid.body
    part = part_about(standing, 1)
    cell = int(cells_of(grid, np.array([[seed.x, seed.y]]))[0])
    if cell < 0:
        return target
    row, column = divmod(cell, SIZE)
    row, column = row - part[0].start, column - part[1].start
    grown = cv2.dilate(standing[part].astype(np.uint8), np.ones((3, 3), np.uint8))
    labels = cv2.connectedComponents(grown, connectivity=8)[1]
    about = labels[max(0, row - 2) : max(0, row + 3), max(0, column - 2) : max(0, column + 3)]
    found = about[about > 0]
    if len(found):
        target[part] = (labels == np.bincount(found).argmax()) & solid[part]
    return target


def seen_cells(grid: Map, target: Bools, settings: ExplorerParameters) -> Bools:
    """(SIZE, SIZE) the target's cells that are inspected, or have an inspected one within `beside_m`."""
    seen = np.zeros_like(target)
    beside = round(settings.beside_m / CELL_M)
    part = part_about(target, beside)
    well = (grid.inspected[part] & target[part]).astype(np.uint8)
    if well.any():
        about = np.ones((2 * beside + 1, 2 * beside + 1), np.uint8)
        seen[part] = (cv2.dilate(well, about) > 0) & target[part]
    return seen


def unseen(grid: Map, target: Bools, settings: ExplorerParameters, min_patch_m: float | None = None) -> Bools:
    """(SIZE, SIZE) what is worth a stop: the target's cells that no stop has seen well, nor any beside them, and
    the expected ones; in pieces of at least `min_patch_m`, not yet tried in vain `attempts` times."""
    left = (target & ~seen_cells(grid, target, settings) & (grid.attempts < settings.attempts)) | grid.expected
    return patches(left, settings.min_patch_m if min_patch_m is None else min_patch_m)


def patches(cells: Bools, least_m: float) -> Bools:
    """(SIZE, SIZE) the cells without those in connected pieces smaller than `least_m` across."""
    kept = np.zeros_like(cells)
    part = part_about(cells, 0)
    if not cells[part].size:
        return kept
    _, labels, stats, _ = cv2.connectedComponentsWithStats(cells[part].astype(np.uint8), connectivity=8)
    extent = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * CELL_M
    worth = extent >= least_m
    worth[0] = False
    kept[part] = worth[labels]
    return kept


def inspected_share(grid: Map, target: Bools, seen: Bools) -> float:
    """The share of the facade known or expected that has been inspected, 0..1; 0 where nothing is known of it."""
    known = int(target.sum()) + int(grid.expected.sum())
    return float(seen.sum()) / known if known else 0.0
