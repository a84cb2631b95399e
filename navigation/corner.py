"""Inner corners: which of two walls a thing stands at, and how far aside of it the drone stops so that this wall stays
the nearer one.

A window across a corner may be nearer to a stop straight in front of a balcony than the window behind the balcony is.
The drone knows neither, but depth shows both walls; a stop nearer to its own wall than to the other by a margin is
nearer to its own window wherever on the other wall the windows are.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navigation.camera import Place, wrap_radians
from navigation.point_cloud import Points
from navigation.target import Target


class CornerParameters(NamedTuple):
    """How walls beside a thing are told from depth, and what is done about them.

    `band_m`: heights above the thing in which walls are looked for, above a railing and below the next storey's
    slab. `reach_m`: a wall farther aside does not matter. `begins_m` and `ends_m`: the stretch, out from the thing,
    in which a wall that runs out of the facade is looked for: reveals end before it. `cell_m`: of that stretch; a
    wall fills `least_cells` within `thickness_m`, each of them in `least_layers` of the band's layers, `layer_m`
    high: eaves, a porch's roof and the balcony above run out of a facade too, but are not upright. `deepest_m`: a
    thing stands no farther in front of its own wall, `half_width_m` is how far to either side of the thing that is
    measured. `nearer_m`: by so much a wall has to be nearer to count as the nearer one. `farthest_m`: from the
    facade's place behind the thing to the stop, at most. `slide_step_m`: between tried stops.
    """

    band_m: tuple[float, float] = (0.8, 1.6)
    reach_m: float = 3.0
    begins_m: float = 0.4
    ends_m: float = 3.5
    cell_m: float = 0.25
    least_cells: int = 4
    thickness_m: float = 0.2
    layer_m: float = 0.2
    least_layers: int = 3
    deepest_m: float = 1.8
    half_width_m: float = 1.0
    nearer_m: float = 0.3
    farthest_m: float = 2.85
    slide_step_m: float = 0.05


class Walls(NamedTuple):
    """Level distances from a thing to the wall it is taken to stand at, and to walls that run out of that one to its
    left and right, as one looks at the facade; None where none is seen."""

    behind_m: float | None
    left_m: float | None
    right_m: float | None


def walls_round(points: Points, target: Target, settings: CornerParameters) -> Walls:
    """The walls round a thing. points: (N, 3) ENU."""
    gap = points - np.array(target.place, np.float32)
    low, high = settings.band_m
    gap = gap[(gap[:, 2] > low) & (gap[:, 2] < high)]
    east, north = target.normal
    out = gap[:, 0] * np.float32(east) + gap[:, 1] * np.float32(north)
    left = gap[:, 0] * np.float32(north) - gap[:, 1] * np.float32(east)
    back = out[(np.abs(left) < settings.half_width_m) & (out < 0.1) & (out > -settings.deepest_m)]
    behind = max(0.0, -float(np.percentile(back, 10.0))) if len(back) >= settings.least_cells else None
    up = gap[:, 2] - np.float32(low)
    return Walls(behind, _running_out(out, left, up, settings), _running_out(out, -left, up, settings))


def at_nearest_wall(target: Target, points: Points, settings: CornerParameters) -> Target:
    """The thing with the normal of the wall it stands nearest to.

    A look along a facade shows more of the wall across the corner than of the thing's own, and the plane is fitted to
    what is seen most of. points: (N, 3) ENU.
    """
    walls = walls_round(points, target, settings)
    behind = settings.deepest_m if walls.behind_m is None else walls.behind_m
    beside = min((m for m in (walls.left_m, walls.right_m) if m is not None), default=math.inf)
    if beside > behind - settings.nearer_m:
        return target
    east, north = target.normal
    normal = (-north, east) if beside == walls.left_m else (north, -east)
    return target._replace(normal=normal, facing_yaw=wrap_radians(math.atan2(-normal[1], -normal[0])))


def stop_beside_corner(
    target: Target,
    points: Points,
    z: float,
    nearest_m: float,
    room_m: Callable[[Target], float],
    settings: CornerParameters,
) -> Place | None:
    """The stop at height `z` that is least aside among those nearer to the thing's own wall than to one across.

    It is `nearest_m` from the thing at least and, out from the facade, as far as `room_m` asks for in front of a thing
    there. None where no wall runs out of the facade near enough, or no stop is near enough to the thing's own.
    points: (N, 3) ENU.
    """
    walls = walls_round(points, target, settings)
    beside = [(m, side) for m, side in ((walls.left_m, 1.0), (walls.right_m, -1.0)) if m is not None]
    if not beside:
        return None
    wall_m, side = min(beside)
    most = min(settings.reach_m, (max(beside)[0] - wall_m) / 2 if len(beside) > 1 else math.inf)
    east, north = target.normal
    for slide in np.arange(0.0, most + 1e-6, settings.slide_step_m).tolist():
        x, y = target.place.x - side * slide * north, target.place.y + side * slide * east
        room = room_m(target._replace(place=Place(x, y, z)))
        out = max(room, math.sqrt(max(0.0, nearest_m**2 - slide**2)))
        own_m = math.hypot(slide, out + (walls.behind_m or 0.0))
        if own_m <= min(settings.farthest_m, wall_m + slide - settings.nearer_m):
            return Place(x + out * east, y + out * north, z)
    return None


def _running_out(
    out: NDArray[np.float32], aside: NDArray[np.float32], up: NDArray[np.float32], settings: CornerParameters
) -> float | None:
    """How far aside the nearest wall runs out of the facade: the least distance at which returns fill enough cells from
    low to high. `up`: above the band's lower edge."""
    here = (out > settings.begins_m) & (out < settings.ends_m) & (aside > 0.3) & (aside < settings.reach_m)
    layers = math.ceil((settings.band_m[1] - settings.band_m[0]) / settings.layer_m - 1e-6)
    cells = ((out[here] - settings.begins_m) / settings.cell_m).astype(np.intp)
    boxes = cells * layers + np.minimum((up[here] / settings.layer_m).astype(np.intp), layers - 1)
    aside = aside[here]
    for start in np.arange(0.3, settings.reach_m, settings.thickness_m / 2).tolist():
        within = (aside >= start) & (aside < start + settings.thickness_m)
        upright = np.bincount(np.unique(boxes[within]) // layers) >= settings.least_layers
        if upright.sum() >= settings.least_cells:
            return float(np.median(aside[within]))
    return None
