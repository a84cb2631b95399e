"""What the front view's depth says about the facade ahead: how far it is, and where it ends upwards.

Floor localization (eq. 3) needs both: the stand-off sets the height of its bands, and a roof inside the last band must
not stretch the floors.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Depth, DepthView, row_slopes


class FacadeParameters(NamedTuple):
    """How a facade is read from depth.

    `half_width_slope`: what is used lies within so many metres of the optical axis per metre of depth, to each side
    (and, for the stand-off, up and down).
    `min_valid_share`: so many of these pixels must have a return. `recess_m`: how far behind the stand-off upper floors
    may lie (setbacks). `max_lean`: a row is wall while its depth changes by less than this per metre of height; roofs
    and ground lean more. `lean_over_m`: over how much height the lean is measured.
    """

    half_width_slope: float = 0.2
    min_valid_share: float = 0.3
    recess_m: float = 4.0
    max_lean: float = 0.35
    lean_over_m: float = 0.5


_NEARER_M = 0.5
_SAME_WALL_M = 1.5
_LEAST_WALL = 0.15
"""Of a column: the ground in front of the wall fills less at any one distance."""
_MOSTLY_WALL = 0.4
_LEAST_WIDTH = 0.1
"""Of the picture: a narrower stretch is a post or a tree."""


def stand_off_m(view: DepthView, settings: FacadeParameters) -> float | None:
    """Distance from a level camera to the facade straight ahead of it: the median planar depth about its optical axis.

    None where too little of the middle has a return.
    """
    patch = view.depth_m[_middle_rows(view, settings), _middle_columns(view, settings)]
    returns = patch[np.isfinite(patch)]
    if len(returns) < settings.min_valid_share * patch.size:
        return None
    return float(np.median(returns))


def facade_top_m(view: DepthView, stand_off: float, camera_height_m: float, settings: FacadeParameters) -> float | None:
    """The facade's upper edge above ground, from a level view at `camera_height_m`.

    The highest row of the middle columns that belongs to an upright wall no farther than the stand-off plus the allowed
    recess: sky, a receding roof and the houses behind don't count, nor does a pane that returns nothing. None where the
    wall reaches the picture's upper edge, or nothing above it is known to be farther off, its top being out of sight or
    of the sensor's reach, or where most of the middle is invalid; the height of the picture's lower edge on the facade
    where what the picture shows is far and none of it wall.
    """
    camera = view.camera
    strip = view.depth_m[:, _middle_columns(view, settings)]
    if np.isnan(strip).mean() > 1.0 - settings.min_valid_share:
        return None
    profile = _row_medians(strip, settings.min_valid_share)
    profile[np.isinf(profile) & _between_walls(view, stand_off, settings)] = np.nan
    heights = profile * row_slopes(camera)
    near = profile <= stand_off + settings.recess_m
    step = min(camera.height - 1, max(2, math.ceil(settings.lean_over_m * camera.fy_px / stand_off)))
    upright = np.zeros(camera.height, bool)
    # every row is compared with the one `step` rows below; inf - inf is nan and compares false
    with np.errstate(invalid="ignore", divide="ignore"):
        lean = np.abs(profile[:-step] - profile[step:]) / np.abs(heights[:-step] - heights[step:])
        upright[:-step] = near[:-step] & near[step:] & (lean <= settings.max_lean)
    rows = np.flatnonzero(upright)
    top = int(rows[0]) if len(rows) else camera.height
    # a balcony or cornice cut off by the picture's edge breaks the wall without ending it: above a top it is far
    if not (np.minimum(profile[:top], view.reach_m) > stand_off + settings.recess_m).any():
        return None
    if not len(rows):
        return max(0.0, camera_height_m - stand_off * camera.down_slope)
    return max(0.0, camera_height_m + float(profile[top]) * (camera.cy_px - top) / camera.fy_px)


def wall_at_row_m(view: DepthView, row: float, stand_off: float, settings: FacadeParameters) -> float:
    """How far the facade is at a row of a level view (0..1 from the top), planar: the median of the middle columns
    there. The stand-off itself where they show something nearer, such as a balcony, or farther than the allowed
    recess: over a low building the middle of the picture looks at the houses behind it."""
    height = view.camera.height
    at = min(height - 1, max(0, round(row * height)))
    strip = view.depth_m[max(0, at - 2) : at + 3, _middle_columns(view, settings)]
    returns = strip[np.isfinite(strip)]
    if not len(returns):
        return stand_off
    found = float(np.median(returns))
    return found if stand_off - _NEARER_M <= found <= stand_off + settings.recess_m else stand_off


def wall_columns(view: DepthView, stand_off: float) -> tuple[int, int] | None:
    """The first column of a level view that shows the wall ahead, and the first one behind it: of the stretches of
    columns in which enough is as far off as that wall, the one nearest to the middle. None where there is none.

    A wing that steps back, or a house beside, has window rows of its own, at other heights of the picture.
    """
    with np.errstate(invalid="ignore"):
        on_wall = np.abs(view.depth_m - np.float32(stand_off)) <= _SAME_WALL_M
    shown = on_wall.mean(axis=0) >= _LEAST_WALL
    edges = np.flatnonzero(np.diff(np.concatenate(([False], shown, [False])).astype(np.int8)))
    stretches = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    wide = [(a, b) for a, b in stretches if b - a >= _LEAST_WIDTH * view.camera.width]
    middle = view.camera.cx_px
    return min(wide, key=lambda ab: max(ab[0] - middle, middle - ab[1], 0.0)) if wide else None


def _between_walls(view: DepthView, stand_off: float, settings: FacadeParameters) -> NDArray[np.bool_]:
    """(H,) the rows in which the facade goes on close by at both sides of the middle: nothing there is glass, not sky.
    A pane ends so near to the middle; a low house between higher ones, broader than twice the middle, does not."""
    with np.errstate(invalid="ignore"):
        on_wall = np.abs(view.depth_m - np.float32(stand_off)) <= _SAME_WALL_M
    middle = _middle_columns(view, settings)
    width = max(1, (middle.stop - middle.start) // 2)
    sides = (on_wall[:, max(0, middle.start - width) : middle.start], on_wall[:, middle.stop : middle.stop + width])
    if not all(side.shape[1] for side in sides):
        return np.zeros(len(on_wall), np.bool_)
    left, right = (side.mean(axis=1) >= _MOSTLY_WALL for side in sides)
    both: NDArray[np.bool_] = left & right
    return both


def _row_medians(strip: Depth, min_valid_share: float) -> NDArray[np.float64]:
    """(H,) median of each row's returns; where it has too few, inf where nothing is there, nan where nobody knows."""
    returns = np.where(np.isfinite(strip), strip, np.nan)
    enough = np.isfinite(strip).mean(axis=1) >= min_valid_share
    absent, unknown = np.isinf(strip).mean(axis=1), np.isnan(strip).mean(axis=1)
    profile = np.where((absent >= min_valid_share) & (absent > unknown), np.inf, np.nan)
    if enough.any():
        profile[enough] = np.nanmedian(returns[enough], axis=1)
    return profile


def _middle_columns(view: DepthView, settings: FacadeParameters) -> slice:
    return _about(view.camera.cx_px, view.camera.fx_px * settings.half_width_slope)


def _middle_rows(view: DepthView, settings: FacadeParameters) -> slice:
    return _about(view.camera.cy_px, view.camera.fy_px * settings.half_width_slope)


def _about(middle_px: float, half_px: float) -> slice:
    half = max(1, round(half_px))
    return slice(max(0, int(middle_px) - half), max(1, int(middle_px) + half))
