"""How far a flight may go, whoever planned it: the operator's limits, which a request may tighten but never loosen."""

from typing import Annotated, Literal, Self

from pydantic import Field

from contracts.base import Unit, Wire
from contracts.keep_out import KeepOuts

RefusalReason = Literal[
    "geofence",
    "below_floor",
    "above_ceiling",
    "keep_out",
    "clearance",
    "unseen",
    "passer_by",
    "speed",
    "blind",
    "frozen_frames",
    "stale_frames",
    "pose_jump",
    "health",
    "manual_control",
    "battery_reserve",
    "time_limit",
]
"""Why the guard refused a flight.

`geofence`, `below_floor`, `above_ceiling`: it would leave the space that is allowed. `keep_out`: it
would enter a volume that nothing may fly into. `clearance`: it would come too
near to something that depth has shown. `unseen`: nobody has looked there. `passer_by`: somebody who walks or drives by
could come into the way, or still could when they had been waited for. `speed`: the vehicle flies faster than it
may. `blind`: depth shows nothing. `frozen_frames`, `stale_frames`: the pictures are not of now. `pose_jump`: the
vehicle is not where it flew. `health`: it reports a problem. `manual_control`: a
pilot, or a failsafe of its autopilot, flies it. `battery_reserve`, `time_limit`: it has to go home."""

GuardAction = Literal["none", "hold", "return", "land"]
"""What the guard had the vehicle do: nothing, the planner may try another way; hold where it is; go back along the way
that it has flown; land where it is."""


class FlightLimits(Wire):
    """Heights are above the ground at the start, distances from where the vehicle started.

    `roof_margin_m`: how far above the highest thing that depth has shown beside it the vehicle may be; it is never
    higher than `max_height_m`. `min_clearance_m`: beyond the vehicle's own radius, from all that depth has shown.
    `battery_reserve`: of a full charge; what is left after the way home. `max_frame_age_s`: depth older than this is
    taken anew before a flight. `max_pose_jump_m`: how far the vehicle may be from where it should be. `keep_out`:
    volumes that no flight enters, the vehicle's radius and the least clearance included."""

    geofence_m: float = Field(default=150.0, ge=5.0, le=5_000.0)
    min_height_m: float = Field(default=0.8, ge=0.2, le=50.0)
    max_height_m: float = Field(default=120.0, ge=2.0, le=500.0)
    roof_margin_m: float = Field(default=6.0, ge=1.0, le=50.0)
    min_clearance_m: float = Field(default=0.15, ge=0.05, le=5.0)
    max_speed_m_s: float = Field(default=8.0, ge=0.2, le=30.0)
    max_flight_s: float = Field(default=1_200.0, ge=10.0, le=86_400.0)
    battery_reserve: Unit = 0.15
    max_frame_age_s: Annotated[float, Field(ge=0.5, le=3_600.0)] = 60.0
    max_pose_jump_m: float = Field(default=2.5, ge=0.2, le=20.0)
    keep_out: KeepOuts = ()

    def tightened(self, by: "FlightLimits | None") -> Self:
        """The same, and narrower wherever `by` is; the volumes of both."""
        if by is None:
            return self
        narrower = {
            name: (max if name in _LEAST else min)(getattr(self, name), getattr(by, name))
            for name in type(self).model_fields
            if name != "keep_out"
        }
        more = tuple(volume for volume in by.keep_out if volume not in self.keep_out)
        return self.model_copy(update=narrower | {"keep_out": self.keep_out + more})


_LEAST = frozenset({"min_height_m", "min_clearance_m", "battery_reserve"})
"""Where the larger value is the narrower limit."""
