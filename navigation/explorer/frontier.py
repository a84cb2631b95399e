"""Where the target's facade is expected to go on out of sight: hidden faces, gaps, and what an occluder covers."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.camera import Pose
from navigation.explorer.facade import Walls, patches
from navigation.explorer.map import (
    CELL_M,
    FREE,
    SIZE,
    UNKNOWN,
    Cells,
    Map,
    cells_of,
    from_turns,
    part_about,
    to_turns,
)
from navigation.explorer.parameters import ExplorerParameters
from navigation.explorer.scan import BINS, Scan

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LIKE = 0.8
"""Cosine from which two normals count as of one wall."""
_FREE_END_M = 3.0
_FEW = 3
_AT_REACH = 0.9
"""A wall that ends so near to the sensor's reach goes on beyond it."""
_SAME_END_M = 1.5
_OUTLINE_M = 6.0
_NEAR_TARGET_M = 3.0
_LOOK_OUT = 24


class Guess(NamedTuple):
    """Wall expected from `start` (ENU) along the unit vector `along` for `length_m`, facing `normal`. `through_free_m`:
    so far from the start known free cells do not end it yet."""

    start: tuple[float, float]
    along: tuple[float, float]
    normal: tuple[float, float]
    length_m: float
    through_free_m: float


def expect(grid: Map, scan: Scan, walls: Walls, target: Bools, settings: ExplorerParameters) -> None:
    """Draws, in place, what each end of the target's runs lets expect; then drops what has turned out otherwise."""
    for guess in guesses(grid, scan, walls, target, settings):
        _draw(grid, guess, target, settings)
    forget(grid, target, scan.pose)


def guesses(grid: Map, scan: Scan, walls: Walls, target: Bools, settings: ExplorerParameters) -> Iterator[Guess]:
    """One for each end of each run of the scan that belongs to the target, and for each edge of its outline at which
    no run ended: behind the last balcony a run may be of a few returns only."""
    points = scan.points(scan.range_m)
    cells = cells_of(grid, np.nan_to_num(points, nan=1e9, posinf=1e9, neginf=-1e9))
    ours = (cells >= 0) & (walls.run >= 0) & target.reshape(-1)[np.maximum(cells, 0)]
    ends: list[Floats] = []
    for number in np.unique(walls.run[ours]):
        members = np.flatnonzero(walls.run == number)
        if len(members) < _FEW or 2 * int(ours[members].sum()) < len(members):
            continue
        for end, step in ((int(members[-1]), 1), (int(members[0]), -1)):
            guess = _beyond(grid, scan, walls, points, ours, members, end, step, settings)
            if guess is not None:
                ends.append(points[end])
                yield guess
    for end, step in _edges(scan, ours):
        if all(np.hypot(*(points[end] - known)) > _SAME_END_M for known in ends):
            yield _round_the_edge(scan, points, ours, end, step, settings)


def openings(grid: Map, target: Bools) -> Bools:
    """(SIZE, SIZE) unknown cells near the target that border on known free ones, from where they can be seen; none
    round a contour that has closed. The last thing to look at before facade counts as all seen."""
    found = np.zeros_like(target)
    part = part_about(target, math.ceil(_NEAR_TARGET_M / CELL_M) + 1)
    if not target[part].size:
        return found
    state = grid.state[part]
    away = cv2.distanceTransform((~target[part]).astype(np.uint8), cv2.DIST_L2, 5) * CELL_M
    beside_free = cv2.dilate((state == FREE).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    found[part] = (state == UNKNOWN) & beside_free & (away <= _NEAR_TARGET_M)
    return found


def expect_openings(grid: Map, target: Bools, settings: ExplorerParameters) -> None:
    """Draws, in place, the openings as expected facade that faces the free country beside it."""
    found = patches(openings(grid, target) & (grid.attempts == 0), settings.min_patch_m)
    rows, columns = np.nonzero(found)
    if not len(rows):
        return
    free = cv2.GaussianBlur((grid.state == FREE).astype(np.float32), (7, 7), 2.0)
    east, north = cv2.Sobel(free, cv2.CV_32F, 1, 0), cv2.Sobel(free, cv2.CV_32F, 0, 1)
    grid.normal[rows, columns] = to_turns(np.stack((east[rows, columns], north[rows, columns]), axis=1))
    grid.expected[rows, columns] = True


def forget(grid: Map, target: Bools, pose: Pose) -> None:
    """Drops, in place, expected cells that became known, lie beside the target's wall of like normal, between two of
    its cells or behind it, within a contour that has closed, or failed to show when a stop was flown to see them."""
    rows, columns = np.nonzero(grid.expected)
    if not len(rows):
        return
    keep = (grid.state[rows, columns] == UNKNOWN) & (grid.attempts[rows, columns] == 0)
    own = from_turns(grid.normal[rows, columns])
    beside = np.zeros(len(rows), np.intp)
    last = SIZE - 1
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            r, c = np.clip(rows + down, 0, last), np.clip(columns + right, 0, last)
            there = target[r, c]
            beside += there
            keep &= ~(there & ((from_turns(grid.normal[r, c]) * own).sum(axis=1) > LIKE))
    keep &= (beside < 2) & ~_is_behind(grid, target, rows, columns, own)
    grid.expected[rows, columns] = keep & _outside(grid, target, pose, rows, columns)


def _is_behind(grid: Map, target: Bools, rows: Cells, columns: Cells, normals: Floats) -> Bools:
    """(N,) does the wall stand before a cell, so that what is expected there lies inside the building? That is: going
    out along its normal, the first known cell is the target's."""
    out = np.arange(1, _LOOK_OUT + 1)
    r = np.clip(np.rint(rows[:, None] + out * normals[:, 1:]), 0, SIZE - 1).astype(np.intp)
    c = np.clip(np.rint(columns[:, None] + out * normals[:, :1]), 0, SIZE - 1).astype(np.intp)
    known = grid.state[r, c] != UNKNOWN
    first = known.argmax(axis=1)
    at = np.arange(len(rows))
    behind: Bools = known.any(axis=1) & target[r[at, first], c[at, first]]
    return behind


def _outside(grid: Map, target: Bools, pose: Pose, rows: Cells, columns: Cells) -> Bools:
    """(N,) which cells can be reached from the drone without crossing the target's wall."""
    cell = int(cells_of(grid, np.array([[pose.x, pose.y]]))[0])
    if cell < 0:
        return np.ones(len(rows), bool)
    asked = target.copy()
    asked[rows, columns] = True
    asked[cell // SIZE, cell % SIZE] = True
    part = part_about(asked, 1)
    labels = cv2.connectedComponents((~target[part]).astype(np.uint8), connectivity=4)[1]
    top, left = part[0].start, part[1].start
    out: Bools = labels[rows - top, columns - left] == labels[cell // SIZE - top, cell % SIZE - left]
    return out


def _beyond(
    grid: Map,
    scan: Scan,
    walls: Walls,
    points: Floats,
    ours: Bools,
    members: NDArray[np.intp],
    end: int,
    step: int,
    settings: ExplorerParameters,
) -> Guess | None:
    """What to expect beyond one end of a run, by what the neighbouring ray sees. Where that is unknown, the wall may go
    straight on; where it was looked for there in vain, it ends."""
    inner = _window_inside(points, members, end, step, max(0.9, 0.05 * float(scan.range_m[end])))
    normal = walls.normal[inner]
    along = np.array((-normal[1], normal[0]))
    if (points[end] - points[inner]) @ along < 0:
        along = -along
    at = points[end]
    face = (float(normal[0]), float(normal[1]))
    ahead = (float(along[0]), float(along[1]))
    start = (float(at[0]), float(at[1]))
    bridged = _bridge(scan, walls, points, at, normal, along, end, step, settings)
    if bridged is not None:
        return Guess(start, ahead, face, bridged, settings.bridge_m)
    beside = end + step
    in_view = 0 <= beside < BINS
    unknown = in_view and bool(np.isnan(scan.range_m[beside]))
    at_reach = in_view and float(scan.range_m[end]) > _AT_REACH * float(scan.reach_m[beside])
    if not in_view or unknown or at_reach or scan.range_m[end] > settings.map_range_m:
        on = Guess(start, ahead, face, settings.straight_on_m, 0.0)
        if not unknown or not _in_vain(grid, on):
            return on
    if scan.range_m[beside] < scan.range_m[end]:  # something nearer hides the rest
        return Guess(start, ahead, face, settings.straight_on_m, 0.0)
    hidden_m = settings.hidden_face_m
    if ours[beside]:  # a step in the facade, no deeper than where the ray past its edge meets the same building
        hidden_m = min(hidden_m, float((at - points[beside]) @ normal))
        if hidden_m < settings.min_patch_m:
            return None
    corner = (start[0] + ahead[0] * CELL_M / 2, start[1] + ahead[1] * CELL_M / 2)
    return Guess(corner, (-face[0], -face[1]), ahead, hidden_m, _FREE_END_M)


def _in_vain(grid: Map, guess: Guess) -> bool:
    """Is most of what that guess expects free, or was it or a cell beside it looked for already?"""
    cells = cells_of(grid, _line(guess))
    rows, columns = np.divmod(cells[cells >= 0], SIZE)
    tried = grid.state[rows, columns] == FREE
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            tried |= grid.attempts[np.clip(rows + down, 0, SIZE - 1), np.clip(columns + right, 0, SIZE - 1)] > 0
    return 2 * int(tried.sum()) > len(tried)


def _line(guess: Guess) -> Floats:
    """(N, 2) places along what is expected."""
    steps = np.arange(CELL_M, guess.length_m + 1e-9, CELL_M / 2)
    line: Floats = np.array(guess.start) + steps[:, None] * np.array(guess.along)
    return line


def _edges(scan: Scan, ours: Bools) -> list[tuple[int, int]]:
    """The returns at which the target's outline ends before something farther or nothing, and the side it ends at."""
    ranges = np.where(np.isnan(scan.range_m), 0.0, scan.range_m)
    nearer = ranges[:-1] < ranges[1:]
    left = np.flatnonzero(ours[1:] & ~ours[:-1] & ~nearer & (ranges[:-1] > 0)) + 1
    right = np.flatnonzero(ours[:-1] & ~ours[1:] & nearer)
    return [(int(i), 1) for i in right] + [(int(i), -1) for i in left]


def _round_the_edge(
    scan: Scan, points: Floats, ours: Bools, end: int, step: int, settings: ExplorerParameters
) -> Guess:
    """The hidden face behind an edge whose own run tells no normal: from the facade about it as a whole."""
    at = points[end]
    ray = at - (scan.pose.x, scan.pose.y)
    ray = ray / np.hypot(*ray)
    aside = step * np.array((ray[1], -ray[0]))
    members = np.flatnonzero(ours)
    members = members[np.hypot(*(points[members] - at).T) <= _OUTLINE_M]
    about = points[members] - points[members].mean(axis=0)
    along = np.linalg.eigh(about.T @ about)[1][:, 1] if len(members) > _FEW else aside
    along = along if along @ aside > 0 else -along
    normal = np.array((-along[1], along[0]))
    normal = normal if normal @ ray < 0 else -normal
    corner = at + along * CELL_M / 2
    return Guess(
        (float(corner[0]), float(corner[1])),
        (float(-normal[0]), float(-normal[1])),
        (float(along[0]), float(along[1])),
        settings.hidden_face_m,
        _FREE_END_M,
    )


def _window_inside(points: Floats, members: NDArray[np.intp], end: int, step: int, reach: float) -> int:
    """The member one normal's window away from the end, where the window is not one-sided."""
    away = np.hypot(*(points[members] - points[end]).T)
    inside = members[away >= reach]
    if not len(inside):
        return int(members[len(members) // 2])
    return int(inside[-1] if step > 0 else inside[0])


def _bridge(
    scan: Scan,
    walls: Walls,
    points: Floats,
    at: Floats,
    normal: Floats,
    along: Floats,
    end: int,
    step: int,
    settings: ExplorerParameters,
) -> float | None:
    """How far the same wall goes on after a gap, None where it does not within `bridge_m`."""
    rays = np.arange(end + step, BINS, 1) if step > 0 else np.arange(end - 1, -1, -1)
    rays = rays[walls.run[rays] >= 0][: BINS // 6]
    gap = points[rays] - at
    out, ahead = gap @ normal, gap @ along
    slack = 0.6 + 0.03 * scan.range_m[rays]
    same = (np.abs(out) < slack) & (ahead > 0) & (ahead < settings.bridge_m) & (walls.normal[rays] @ normal > LIKE)
    return float(ahead[same].min()) if same.any() else None


def _draw(grid: Map, guess: Guess, target: Bools, settings: ExplorerParameters) -> None:
    cells = cells_of(grid, _line(guess))
    steps = CELL_M + np.arange(len(cells)) * CELL_M / 2
    state = grid.state.reshape(-1)[np.maximum(cells, 0)]
    stopped = (cells < 0) | ((state == FREE) & (steps > guess.through_free_m))
    past = int(stopped.argmax()) if stopped.any() else len(cells)
    cells = np.unique(cells[:past][state[:past] == UNKNOWN])
    cells = cells[(grid.attempts.reshape(-1)[cells] == 0) & ~grid.expected.reshape(-1)[cells]]
    grid.expected.reshape(-1)[cells] = True
    grid.normal.reshape(-1)[cells] = to_turns(np.array([guess.normal]))[0]
