"""From the depth views of one moment to a level panorama: how far away the nearest return is in each direction."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Camera, DepthView, Pose, column_slopes, fewest, horizon_rows, row_slopes
from navigation.point_cloud import above_ground_m

Floats = NDArray[np.float64]

BIN_DEG = 0.5
REACH_DEG = 135.0
BINS = round(2 * REACH_DEG / BIN_DEG)
_HORIZON_SHARE = 0.01
_NEAREST_ROW_M = 1.4
"""Rows are read as steeply as they see the band from this depth on; nearer things are the corridor's business."""


class Scan(NamedTuple):
    """A panorama from `pose`, bearings from -135 to 135 degrees (positive to the right of the nose) in bins.

    `range_m` (BINS,): level distance to the nearest return of the facade's band; inf where there is none, nan where no
    camera saw anything valid. `bearing_deg`: of that return, or the bin's middle. `body_m`: the range for the higher
    band that the drone's body needs. `reach_m` (BINS,): how far a bin without a return is free.
    """

    pose: Pose
    range_m: Floats
    bearing_deg: Floats
    body_m: Floats
    reach_m: Floats

    @property
    def known_share(self) -> float:
        """Of the bins, those in which some camera saw anything, or that nothing is there."""
        return float((~np.isnan(self.range_m)).mean())

    @property
    def angles(self) -> Floats:
        """(BINS,) direction of each bin's return, radians counter-clockwise from east; falls from left to right."""
        return self.pose.yaw - np.deg2rad(self.bearing_deg)

    def points(self, ranges_m: Floats) -> Floats:
        """(BINS, 2) ENU plan points at the given ranges; not finite where the range is not."""
        with np.errstate(invalid="ignore"):
            x = self.pose.x + ranges_m * np.cos(self.angles)
            y = self.pose.y + ranges_m * np.sin(self.angles)
        return np.stack((x, y), axis=1)


def bin_bearings_deg() -> Floats:
    """(BINS,) bearing of each bin's middle, positive to the right."""
    return np.linspace(-REACH_DEG + BIN_DEG / 2, REACH_DEG - BIN_DEG / 2, BINS)


def panorama(views: Sequence[DepthView], pose: Pose, band_m: float, body_band_m: float) -> Scan:
    """The scan of the level views; of these, the fewest that see all that all of them see, and the others where those
    don't know. A camera that looks up or down has no horizon to read ranges along and is left out.

    The ground is no obstacle: the body's band ends above it.
    """
    level = [view for view in views if view.camera.is_level]
    kept = fewest([view.camera for view in level])
    scan = Scan(pose, *(np.full(BINS, fill) for fill in (np.nan, 0.0, np.nan, np.inf)))
    scan = scan._replace(bearing_deg=bin_bearings_deg())
    for view in (view for view in level if view.camera in kept):
        scan = _joined(scan, view, band_m, body_band_m)
    if np.isnan(scan.range_m).any():
        for view in (view for view in level if view.camera not in kept):
            more = _joined(scan, view, band_m, body_band_m)
            blind = np.isnan(scan.range_m)
            scan = Scan(pose, *(np.where(blind, new, old) for new, old in zip(more[1:], scan[1:], strict=True)))
    return scan


def _joined(scan: Scan, view: DepthView, band_m: float, body_band_m: float) -> Scan:
    """The scan with one more view: of two ranges the nearer."""
    below = min(body_band_m, above_ground_m(scan.pose.z))
    found, at = _ranges(view, min(band_m, below), band_m)
    bearings = np.where((found < scan.range_m) | np.isnan(scan.range_m), at, scan.bearing_deg)
    away = np.cos(np.deg2rad(bearings - view.camera.heading_deg))
    reach = np.where(np.isnan(found), scan.reach_m, np.minimum(scan.reach_m, view.reach_m / np.maximum(away, 0.1)))
    body = np.fmin(scan.body_m, _ranges(view, below, body_band_m)[0])
    return Scan(scan.pose, np.fmin(scan.range_m, found), bearings, body, reach)


def level_ranges_m(view: DepthView, below_m: float, above_m: float) -> Floats:
    """(W,) level distance of each column's nearest return from `below_m` under to `above_m` over the camera; inf where
    nothing is there, nan where nothing is known about the horizon. Planar depth becomes distance by
    1 / cos(bearing)."""
    camera = view.camera
    slopes = row_slopes(camera).astype(np.float64)
    horizon = horizon_rows(camera)
    first = int(np.searchsorted(-slopes, -above_m / _NEAREST_ROW_M))
    past = int(np.searchsorted(-slopes, below_m / _NEAREST_ROW_M, side="right"))
    first, past = min(first, horizon.start), max(past, horizon.stop)
    rows, climb = view.depth_m[first:past], slopes[first:past]
    with np.errstate(divide="ignore"):
        limit = np.where(climb >= 0, above_m, below_m) / np.abs(climb)  # the depth at which a row leaves the band
    with np.errstate(invalid="ignore"):
        inside = np.where(rows <= limit.astype(np.float32)[:, None], rows, np.float32(np.inf))
    nearest = inside.min(axis=0).astype(np.float64)
    nearest[np.isinf(nearest) & np.isnan(view.depth_m[_about(horizon, camera.height)]).all(axis=0)] = np.nan
    level: Floats = nearest * np.hypot(1.0, column_slopes(camera).astype(np.float64))
    return level


def _about(rows: slice, height: int) -> slice:
    """The rows, and so many beside them that a hole of a few pixels hides nothing."""
    more = round(_HORIZON_SHARE * height)
    return slice(max(0, rows.start - more), min(height, rows.stop + more))


def _ranges(view: DepthView, below_m: float, above_m: float) -> tuple[Floats, Floats]:
    """(BINS,) the nearest return in each bin from `below_m` under to `above_m` over the drone's centre, and its
    bearing, both as seen from that centre."""
    camera = view.camera
    columns = level_ranges_m(view, max(0.0, below_m + camera.up_m), max(0.0, above_m - camera.up_m))
    ranges, at = np.full(BINS, np.nan), bin_bearings_deg()
    for turn in (-360.0, 0.0, 360.0):
        if camera.left_deg + turn < REACH_DEG and camera.right_deg + turn > -REACH_DEG:
            found, bearings = _binned(camera._replace(heading_deg=camera.heading_deg + turn), columns)
            at = np.where(np.isnan(ranges), bearings, at)
            ranges = np.fmin(ranges, found)
    if camera.forward_m or camera.right_m:
        return _from_centre(camera, ranges, at)
    return ranges, at


def _from_centre(camera: Camera, ranges_m: Floats, bearing_deg: Floats) -> tuple[Floats, Floats]:
    """What a camera beside the drone's centre saw, by range and bearing from that centre. Bins take the nearest of the
    returns that fall into them; a bin that parallax leaves empty takes the return beside it."""
    hits = np.flatnonzero(np.isfinite(ranges_m))
    ranges, bearings = ranges_m.copy(), bearing_deg.copy()
    if not len(hits):
        return ranges, bearings
    turn, found = np.deg2rad(bearing_deg[hits]), ranges_m[hits]
    ahead, aside = found * np.cos(turn) + camera.forward_m, found * np.sin(turn) + camera.right_m
    away, moved = np.hypot(ahead, aside), np.degrees(np.arctan2(aside, ahead))
    beside = np.abs(moved[None, :] - bin_bearings_deg()[hits][:, None]).argmin(axis=1)
    ranges[hits], bearings[hits] = away[beside], moved[beside]
    bins = np.floor((moved + REACH_DEG) / BIN_DEG).astype(np.intp)
    for at in np.argsort(-away, kind="stable"):  # the nearest is written last
        if 0 <= bins[at] < BINS:
            ranges[bins[at]], bearings[bins[at]] = away[at], moved[at]
    return ranges, bearings


def _binned(camera: Camera, columns_m: Floats) -> tuple[Floats, Floats]:
    """(BINS,) the nearest of the columns in each bin, and its bearing; where columns are wider than bins, the next
    column's range at the bin's middle."""
    width = len(columns_m)
    bearings = np.degrees(np.arctan(column_slopes(camera).astype(np.float64))) + camera.heading_deg
    first = max(0, math.ceil((camera.left_deg + REACH_DEG) / BIN_DEG - 1e-9))
    past = min(BINS, math.floor((camera.right_deg + REACH_DEG) / BIN_DEG + 1e-9))
    edges = np.arange(first, past) * BIN_DEG - REACH_DEG
    starts = np.minimum(np.searchsorted(bearings, edges), width - 1)
    known = np.where(np.isnan(columns_m), np.inf, columns_m)
    ranges, at = np.full(BINS, np.nan), bin_bearings_deg()
    if not len(starts):
        return ranges, at
    least = np.minimum.reduceat(known, starts)
    blind = np.minimum.reduceat(np.isnan(columns_m).astype(np.int8), starts) > 0
    ranges[first:past] = np.where(blind, np.nan, least)
    owner = np.searchsorted(edges, bearings, side="right") - 1
    mine = (owner >= 0) & np.isfinite(known)
    mine[mine] = known[mine] == least[owner[mine]]
    at[first + owner[mine]] = bearings[mine]
    return ranges, at
