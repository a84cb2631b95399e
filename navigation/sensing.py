"""What depth says of the space before a camera: something is there, nothing is, or nobody knows. The one place for it.

A return is a return. No return (inf) is free up to the sensor's reach. An invalid pixel (nan) is unknown: neither free
nor a wall. Sensors differ in what they can say. A simulated camera or a lidar tells "nothing there" from "unmeasured";
a stereo camera says "invalid" for both, and for it the sky, and all that lies beyond its range, would be unknown for
ever. So where the sky of a moment's views is invalid, not no return, the invalid pixels that are open upwards, from the
picture's upper edge down to the first return, broad and in a picture that measures something, count as no return: free
as far as the farthest returns show that the sensor reaches. Holes amid returns, narrow stripes and pictures without
returns stay unknown, and so do specks of returns in the air, a stereo camera's mismatches. So does what lies above a
straight cut through things at different distances: there the frame failed, it is not the sky. Where an opening ends in
a level line over what is equally far, it may be either, and is free no farther than that. REP 117 (ROS) draws the same
line between out of range and invalid.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from navigation.camera import Depth, DepthView, Pose, pixels_of

Bools = NDArray[np.bool_]

INVALID, NO_RETURN = 0, 65535
UNSEEN, UNKNOWN, HIDDEN, FREE = 0, 1, 2, 3
"""Of a place: no camera looks there; one does, and nobody knows; a return lies before it; one looked past it."""

_MEASURING_SHARE = 0.01
"""A picture with fewer returns than this share of its pixels says nothing of the rest."""
_NARROW_SHARE = 0.1
"""An opening narrower than this share of the picture's width may be a stripe that was not measured."""
_CUT_SHARE = 0.95
"""Of the columns with an opening, so many end in the same row where a frame was cut."""
_CUT_THROUGH_SHARE = 0.05
_CUT_DEPTH_SHARE = 0.1
"""A cut goes through things: so many of a picture's columns differ by so much from the usual distance along it."""
_BESIDE_COLUMNS = 1
_LINE_ROWS = 4
_REACH_PERCENTILE = 99.0
_SPECK_PX = 3
_SPECK_SIZE_PX = 16
_SPECK_STEP_M = 1.0
"""Returns in so small a patch, so far from all about them, are mismatches: a stereo camera's ghosts in the air."""
_ECHO_SHARE, _ECHO_M = 0.1, 0.15
"""A lone pixel that is nearer than all eight about it by so much is the echo of a drop: what is solid shows in two."""
_DROP_M = 0.05
"""Where a pixel is wider than this, it does not, and a lone one is kept."""
_ABOUT = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)
_NEAREST_M = 0.2
"""Nothing is measured nearer: it would lie within the drone."""
_UNIT_M = 0.005
_HOLE_SHARE = 0.01
"""A single invalid pixel is as its neighbours are, up to so many widths away."""


def read_views(
    views: Sequence[DepthView], sensor_range_m: float = math.inf, *, shown_m: float = 0.0
) -> list[DepthView]:
    """The views of one moment as the rule above reads them: inf where nothing is up to the view's `reach_m`, nan where
    nobody knows. What lies beyond `sensor_range_m` counts as no return. `shown_m`: the reach that earlier moments have
    shown. The views given are not changed."""
    if not leaves_invalid(views):
        return [_within_range(view, sensor_range_m) for view in views]
    lines = lines_of([view.depth_m for view in views])  # of the whole pictures: specks lie along a line as well
    views = [_without_specks(view) for view in views]
    cut = [_within_range(view, sensor_range_m) for view in views]
    opened = [open_upwards(np.isnan(view.depth_m)) & ~line.closed for view, line in zip(views, lines, strict=True)]
    if _tells_no_return([np.isinf(view.depth_m) for view in views], opened):
        return cut
    reach_m = min(sensor_range_m, max(shown_m, shown_reach_m(views)))
    return [_opened(view, mask, min(reach_m, line.far)) for view, mask, line in zip(cut, opened, lines, strict=True)]


def leaves_invalid(views: Sequence[DepthView]) -> bool:
    """Is this a sensor that leaves pixels invalid? Views as the cameras gave them or as `read_views` gives them."""
    return any(bool(np.isnan(view.depth_m).any()) for view in views)


def shown_reach_m(views: Sequence[DepthView]) -> float:
    """How far the sensor reaches, as the farthest returns of one moment show it; 0 without a return."""
    returns = np.concatenate([np.zeros(0, np.float32), *(view.depth_m[np.isfinite(view.depth_m)] for view in views)])
    return float(np.percentile(returns, _REACH_PERCENTILE)) if len(returns) else 0.0


def _tells_no_return(absent: Sequence[Bools], opened: Sequence[Bools]) -> bool:
    """Is this a sensor that says itself where nothing is? Then most of the open sky is no return, not invalid. A few
    may be far returns beyond what depth's unit can hold."""
    return sum(map(np.count_nonzero, absent)) > sum(map(np.count_nonzero, opened))


def open_upwards(invalid: Bools) -> Bools:
    """(H, W) of the invalid pixels those that are open from the picture's upper edge down, in broad regions; none in a
    picture with hardly a return."""
    width = invalid.shape[1]
    if np.count_nonzero(invalid) > (1.0 - _MEASURING_SHARE) * invalid.size:
        return np.zeros_like(invalid)
    solid = cv2.morphologyEx((~invalid).astype(np.uint8), cv2.MORPH_OPEN, np.ones((_SPECK_PX, _SPECK_PX), np.uint8))
    opened = np.logical_and.accumulate(solid == 0, axis=0).astype(np.uint8)
    broad = np.ones((1, max(2, round(_NARROW_SHARE * width))), np.uint8)
    # the border counts as open: an opening that the picture's side cuts off is no stripe
    padded = cv2.copyMakeBorder(opened, 0, 0, broad.shape[1], broad.shape[1], cv2.BORDER_REPLICATE)
    wide = cv2.morphologyEx(padded, cv2.MORPH_OPEN, broad)[:, broad.shape[1] : broad.shape[1] + width]
    out: Bools = (wide > 0) & invalid
    return out


class Line(NamedTuple):
    """Of a picture whose openings (H, W) end in a straight line: (W,) the columns in which nothing counts as open, and
    how far the others may count, in the picture's unit; no column and inf where they end unevenly."""

    opened: Bools
    closed: Bools
    far: float


def lines_of(pictures: Sequence[NDArray[np.floating] | NDArray[np.uint16]]) -> list[Line]:
    """Where one moment's pictures (H, W) of depth, in any unit, invalid pixels 0 or nan, have openings that end in
    a straight cut through things at different distances: a frame of which only the lower part arrived. The sky ends in
    a level line only over what is equally far, and where it does, a picture shows nothing free beyond that; over the
    few columns that are nearer along the line nothing is open."""
    opened = [open_upwards(np.isnan(depth) | (depth == 0)) for depth in pictures]
    edges = [np.where(mask.any(axis=0), len(mask) - np.argmax(mask[::-1], axis=0), 0) for mask in opened]
    lines = [Line(mask, np.zeros(mask.shape[1], bool), math.inf) for mask in opened]
    for height in {len(mask) for mask in opened}:
        same = [number for number, mask in enumerate(opened) if len(mask) == height]
        ends = np.concatenate([edges[number] for number in same])
        rows = ends[(ends > 0) & (ends < height)]
        if not len(rows):
            continue
        cut = int(np.bincount(rows).argmax())
        straight = [number for number in same if _share_at(edges[number], cut) >= _CUT_SHARE]
        along = {number: _along(pictures[number], edges[number], cut) for number in straight}
        usual = _median(list(along.values()))
        failed = any(_share_off(depth, usual) >= _CUT_THROUGH_SHARE for depth in along.values())
        for number, depth in along.items():
            level = np.zeros(len(depth), bool) if failed else _level(depth, usual)
            known = level & np.isfinite(depth)
            lines[number] = Line(opened[number], ~level, float(depth[known].min()) if known.any() else math.inf)
    return lines


def _share_at(edges: NDArray[np.intp], row: int) -> float:
    """Of the columns with an opening, those that end in this row."""
    return float((edges == row).sum() / max(1, (edges > 0).sum()))


def _along(depth: NDArray[np.floating] | NDArray[np.uint16], edges: NDArray[np.intp], row: int) -> NDArray[np.float64]:
    """(W,) what the openings that end in this row end on, there or in a few rows below; nan elsewhere, and where
    nothing was measured."""
    below = depth[row : row + _LINE_ROWS].astype(np.float64)
    known = np.isfinite(below) & (below > 0)
    first = below[known.argmax(axis=0), np.arange(below.shape[1])]
    return np.where((edges == row) & known.any(axis=0), first, np.nan)


def _median(along: Sequence[NDArray[np.float64]]) -> float:
    """Over all columns; nan where nothing was measured."""
    known = np.concatenate([np.zeros(0), *(depth[np.isfinite(depth)] for depth in along)])
    return float(np.median(known)) if len(known) else math.nan


def _share_off(depth: NDArray[np.float64], usual: float) -> float:
    known = depth[np.isfinite(depth)]
    return float(np.mean(np.abs(known - usual) > _CUT_DEPTH_SHARE * usual)) if len(known) else 0.0


def _level(depth: NDArray[np.float64], usual: float) -> Bools:
    """(W,) the columns where nothing nearer than usual stands at the line or just beside."""
    with np.errstate(invalid="ignore"):
        nearer = depth < (1.0 - _CUT_DEPTH_SHARE) * usual
    return ~np.convolve(nearer, np.ones(2 * _BESIDE_COLUMNS + 1), mode="same").astype(bool)


def read_units(pictures: Sequence[NDArray[np.uint16]]) -> list[NDArray[np.uint16]]:
    """The same rule for depth as it crosses the wire, (H, W) with 0 invalid and 65535 no return, of one moment."""
    if not any(bool((units == INVALID).any()) for units in pictures):
        return list(pictures)
    opened = [line.opened & ~line.closed for line in lines_of(pictures)]
    if _tells_no_return([units == NO_RETURN for units in pictures], opened):
        return list(pictures)
    return [np.where(mask, np.uint16(NO_RETURN), units) for mask, units in zip(opened, pictures, strict=True)]


def known_share(views: Sequence[DepthView]) -> float:
    """The share of all pixels, of views as `read_views` gives them, of which anything is known; 0 without views."""
    pixels = sum(view.depth_m.size for view in views)
    return 1.0 - sum(int(np.isnan(view.depth_m).sum()) for view in views) / pixels if pixels else 0.0


def looked_at(places: NDArray[np.floating], views: Sequence[DepthView], pose: Pose) -> NDArray[np.int8]:
    """(N,) UNSEEN, UNKNOWN, HIDDEN or FREE, the best that any of the views (of `read_views`) taken from `pose` says of
    places (N, 3) ENU."""
    found = np.full(len(places), UNSEEN, np.int8)
    for view in views:
        width, height = view.camera.width, view.camera.height
        x, y, forward = pixels_of(view.camera, pose, places)
        inside = (forward > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        at = np.flatnonzero(inside)
        if not len(at):
            continue
        depth = _at_pixels(view, y[at].astype(np.intp), x[at].astype(np.intp))
        with np.errstate(invalid="ignore"):
            free, known = depth > forward[at], depth < np.float32(view.reach_m)
        found[at] = np.maximum(found[at], np.where(free, FREE, np.where(known, HIDDEN, UNKNOWN)))
    return found


def _within_range(view: DepthView, sensor_range_m: float) -> DepthView:
    """Its reach is the sensor's; what was measured beyond it is no return."""
    depth_m = view.depth_m
    with np.errstate(invalid="ignore"):
        beyond = depth_m > sensor_range_m
    if math.isfinite(sensor_range_m) and beyond.any():
        depth_m = np.where(beyond, np.float32(np.inf), depth_m)
    return view._replace(depth_m=depth_m, reach_m=min(view.reach_m, sensor_range_m))


def _without_specks(view: DepthView) -> DepthView:
    """Of a sensor that has invalid pixels: mismatches and echoes of drops are invalid too."""
    with np.errstate(invalid="ignore"):
        fine = view.depth_m < np.float32(_DROP_M * view.camera.fx_px)
        close = (view.depth_m < np.float32(_NEAREST_M)) | (_echoes(view.depth_m) & fine)
    depth_m = np.where(close, np.float32(np.nan), view.depth_m)
    units = np.nan_to_num(depth_m / np.float32(_UNIT_M), nan=0.0, posinf=32767.0).clip(0.0, 32767.0).astype(np.int16)
    kept = cv2.filterSpeckles(units.copy(), 0, _SPECK_SIZE_PX, round(_SPECK_STEP_M / _UNIT_M))[0]
    specks = (kept == 0) & (units > 0) & np.isfinite(depth_m)
    return view._replace(depth_m=np.where(specks, np.float32(np.nan), depth_m))


def _echoes(depth_m: Depth) -> Bools:
    """(H, W) of depth the lone pixels that something stands behind on all sides."""
    nearest = cv2.erode(np.where(np.isnan(depth_m), np.float32(np.inf), depth_m), _ABOUT)
    with np.errstate(invalid="ignore"):
        found: Bools = depth_m < np.minimum(nearest * np.float32(1.0 - _ECHO_SHARE), nearest - np.float32(_ECHO_M))
    return found


def _opened(view: DepthView, opened: Bools, reach_m: float) -> DepthView:
    if not opened.any():
        return view
    return view._replace(depth_m=np.where(opened, np.float32(np.inf), view.depth_m), reach_m=min(view.reach_m, reach_m))


def _at_pixels(view: DepthView, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float32]:
    """(N,) how far the pixels are free: an invalid one as far as the nearest return or opening of those about it."""
    height, width = view.depth_m.shape
    reach = np.float32(view.reach_m)
    depth = np.minimum(view.depth_m[rows, columns], reach)
    holes = np.flatnonzero(np.isnan(depth))
    if len(holes):
        half = max(1, round(_HOLE_SHARE * width))
        beside = np.arange(-half, half + 1)
        r = np.clip(rows[holes, None, None] + beside[:, None], 0, height - 1)
        c = np.clip(columns[holes, None, None] + beside, 0, width - 1)
        patch = np.minimum(view.depth_m[r, c], reach).reshape(len(holes), -1)
        known = ~np.isnan(patch)
        nearest = np.where(known, patch, np.inf).min(axis=1)
        depth[holes] = np.where(known.mean(axis=1) >= 0.25, nearest, np.nan)
    return depth
