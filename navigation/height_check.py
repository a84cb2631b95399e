"""Is the row of windows asked for there, at the height that was found for it? One more count, by the picture taken at
that height.

Windows nearly level with the camera are placed best: how far the wall is hardly matters. Where the picture reaches the
ground, or nearly, the rows beneath tell the floor's number anew.
"""

from typing import NamedTuple

from navigation.floor_localization import WindowRows

_LEVEL_FLOORS = 0.35
"""A row this near to the camera's height is the one that the drone stands before; its neighbours are a floor off."""
_GROUND_FLOORS = 0.25
"""The picture reaches the ground where no more than this share of a floor is beneath it."""
_NEAR_GROUND_FLOORS = 3.75
"""Not so far under the lowest row the floors beneath are told by the rows' distances."""
_EVEN_FLOORS = 0.25
"""Floors are counted where the lowest row's height comes out even: half a floor above a whole number of them."""


class HeightCheck(NamedTuple):
    """What a picture at the final height says of it. `row_m`: how high the row of windows level with the camera is,
    None where none is; `floor`: its number, counted from the ground, None where that is too far beneath the picture;
    `wanted_m`: how high the row of the floor asked for is by that count, None where it is not in the picture."""

    row_m: float | None
    floor: int | None
    wanted_m: float | None

    def confirms(self, floor: int) -> bool:
        """A row is there, and nothing says that it is another floor's."""
        return self.row_m is not None and self.floor in (None, floor)


def check_height(seen: WindowRows, floor: int, floor_height_m: float) -> HeightCheck:
    """The rows of a picture held against the floor asked for; `floor_height_m` is taken where a single row is seen."""
    spacing_m = seen.spacing_m or floor_height_m
    if not seen.rows or spacing_m <= 0.0:
        return HeightCheck(None, None, None)
    heights = [seen.height_m(at) for at in range(len(seen.rows))]
    nearest = min(range(len(heights)), key=lambda at: abs(heights[at] - seen.camera_m))
    is_level = abs(heights[nearest] - seen.camera_m) <= _LEVEL_FLOORS * spacing_m
    row_m = heights[nearest] if is_level else None
    beneath = _floors_beneath(seen, spacing_m)
    if beneath is None:
        return HeightCheck(row_m, None, None)
    count = len(heights) + beneath
    wanted = count - floor
    return HeightCheck(
        row_m,
        floor=count - nearest if is_level else None,
        wanted_m=heights[wanted] if 0 <= wanted < len(heights) else None,
    )


def _floors_beneath(seen: WindowRows, spacing_m: float) -> int | None:
    """How many floors lie under the lowest row; None where that is too far from the ground to tell, or lies as floors
    of one height would not: of a wall seen from aside the rows' distances grow downwards, and what would be a row more
    beneath the picture looks like the ground."""
    up_floors = seen.height_m(-1) / spacing_m
    to_ground = seen.camera_m - seen.stand_off_m * seen.view.down_slope <= _GROUND_FLOORS * spacing_m
    if not to_ground and (seen.spacing_m is None or up_floors > _NEAR_GROUND_FLOORS):
        return None
    beneath = 0 if seen.spacing_m is None else max(0, round(up_floors - 0.5))
    return beneath if abs(up_floors - 0.5 - beneath) <= _EVEN_FLOORS else None
