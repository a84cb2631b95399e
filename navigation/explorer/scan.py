"""From the depth views of one moment to a level panorama: how far away the nearest return is in each direction."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import DepthView, Pose, column_slopes, pinhole, row_slopes

Floats = NDArray[np.float64]

BIN_DEG = 0.5
REACH_DEG = 135.0
BINS = round(2 * REACH_DEG / BIN_DEG)
_FINE_PX = 600
_NEAREST_ROW_M = 1.4
"""Rows are read as steeply as they see the band from this depth on; nearer things are the corridor's business."""


class Scan(NamedTuple):
    """A panorama from `pose`, bearings from -135 to 135 degrees (positive to the right of the nose) in bins.

    `range_m` (BINS,): level distance to the nearest return of the facade's band; inf where there is none, nan where no
    camera saw anything valid. `bearing_deg`: of that return, or the bin's middle. `body_m`: the range for the higher
    band that the drone's body needs.
    """

    pose: Pose
    range_m: Floats
    bearing_deg: Floats
    body_m: Floats

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
    """The scan of all views; the three of -90, 0 and 90 degrees suffice, so that others are left out beside them.

    The ground is no obstacle: the body's band ends 0.4 m above it.
    """
    straight = [view for view in views if view.heading_deg in (-90, 0, 90)]
    below = min(body_band_m, max(0.0, pose.z - 0.4))
    ranges, bearings, bodies = np.full(BINS, np.nan), bin_bearings_deg(), np.full(BINS, np.nan)
    for view in straight if len(straight) == 3 else views:
        columns = level_ranges_m(view, min(band_m, below), band_m)
        found, at = _binned(view, columns)
        bearings = np.where((found < ranges) | np.isnan(ranges), at, bearings)
        ranges = np.fmin(ranges, found)
        columns = level_ranges_m(view, below, body_band_m)
        bodies = np.fmin(bodies, _binned(view, columns)[0])
    return Scan(pose, ranges, bearings, bodies)


def thinned(view: DepthView) -> DepthView:
    """The view at half the size until it is less than 600 pixels wide: the nearest of every two by two pixels."""
    depth = view.depth_m
    while depth.shape[1] >= _FINE_PX and depth.shape[0] % 2 == 0 and depth.shape[1] % 2 == 0:
        rows = np.fmin(depth[0::2], depth[1::2])  # invalid pixels are passed over
        depth = np.fmin(rows[:, 0::2], rows[:, 1::2])
    return DepthView(view.heading_deg, depth)


def level_ranges_m(view: DepthView, below_m: float, above_m: float) -> Floats:
    """(W,) level distance of each column's nearest return from `below_m` under to `above_m` over the camera; inf where
    nothing is there, nan where no pixel at the horizon is valid. Planar depth becomes distance by 1 / cos(bearing)."""
    height, width = view.depth_m.shape
    camera = pinhole(width, height)
    slopes = row_slopes(camera).astype(np.float64)
    first = int(np.searchsorted(-slopes, -above_m / _NEAREST_ROW_M))
    past = int(np.searchsorted(-slopes, below_m / _NEAREST_ROW_M, side="right"))
    first, past = min(first, (height - 1) // 2), max(past, height // 2 + 1)
    rows, climb = view.depth_m[first:past], slopes[first:past]
    with np.errstate(divide="ignore"):
        limit = np.where(climb >= 0, above_m, below_m) / np.abs(climb)  # the depth at which a row leaves the band
    with np.errstate(invalid="ignore"):
        inside = np.where(rows <= limit.astype(np.float32)[:, None], rows, np.float32(np.inf))
    nearest = inside.min(axis=0).astype(np.float64)
    horizon = view.depth_m[(height - 1) // 2 : height // 2 + 1]
    nearest[np.isinf(nearest) & np.isnan(horizon).all(axis=0)] = np.nan
    level: Floats = nearest * np.hypot(1.0, column_slopes(camera).astype(np.float64))
    return level


def _binned(view: DepthView, columns_m: Floats) -> tuple[Floats, Floats]:
    """(BINS,) the nearest of the columns in each bin, and its bearing; where columns are wider than bins, the next
    column's range at the bin's middle."""
    width = len(columns_m)
    bearings = np.degrees(np.arctan(column_slopes(pinhole(width, 1)).astype(np.float64))) + view.heading_deg
    first = max(0, math.ceil((view.heading_deg - 45.0 + REACH_DEG) / BIN_DEG - 1e-9))
    past = min(BINS, math.floor((view.heading_deg + 45.0 + REACH_DEG) / BIN_DEG + 1e-9))
    edges = np.arange(first, past) * BIN_DEG - REACH_DEG
    starts = np.minimum(np.searchsorted(bearings, edges), width - 1)
    known = np.where(np.isnan(columns_m), np.inf, columns_m)
    ranges, at = np.full(BINS, np.nan), bin_bearings_deg()
    least = np.minimum.reduceat(known, starts)
    blind = np.minimum.reduceat(np.isnan(columns_m).astype(np.int8), starts) > 0
    ranges[first:past] = np.where(blind, np.nan, least)
    owner = np.searchsorted(edges, bearings, side="right") - 1
    mine = (owner >= 0) & np.isfinite(known)
    mine[mine] = known[mine] == least[owner[mine]]
    at[first + owner[mine]] = bearings[mine]
    return ranges, at
