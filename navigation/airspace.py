"""The space that is allowed: a geofence about the start, a lowest and a highest height, and volumes to keep out of."""

import math
from typing import Literal, NamedTuple

from navigation.camera import Place
from navigation.keep_out import Volume, entered

Refused = Literal["geofence", "below_floor", "above_ceiling", "keep_out", "clearance", "unseen"]

_LIE_M = 1e-6


class Space(NamedTuple):
    """Where the drone may be: within `geofence_m` of `home`, from `floor_m` to `ceiling_m`, `radius_m` (its own and the
    clearance) from everything, what is known to be kept out of included."""

    home: Place
    geofence_m: float
    floor_m: float
    ceiling_m: float
    radius_m: float
    keep_out: tuple[Volume, ...] = ()


class Refusal(NamedTuple):
    """Why a path is refused, in words, and where on it."""

    reason: Refused
    said: str
    at: Place


def outside(a: Place, b: Place, space: Space) -> Refusal | None:
    """Out of the space allowed; whoever is outside may come back."""
    far = math.hypot(b.x - space.home.x, b.y - space.home.y)
    if far > max(space.geofence_m, math.hypot(a.x - space.home.x, a.y - space.home.y) - _LIE_M):
        return Refusal("geofence", f"{far:.0f} m from the start; {space.geofence_m:g} m are allowed", b)
    if b.z < min(space.floor_m, a.z) - _LIE_M:
        return Refusal("below_floor", f"{b.z:.1f} m above ground; no lower than {space.floor_m:.1f} m is allowed", b)
    if b.z > max(space.ceiling_m, a.z) + _LIE_M:
        return Refusal("above_ceiling", f"{b.z:.1f} m high; {space.ceiling_m:.1f} m are allowed here", b)
    kept_out = entered(a, b, space.keep_out, space.radius_m)
    if kept_out is not None:
        return Refusal("keep_out", f"the way leads into {kept_out.name}, where nothing may fly", kept_out.at)
    return None
