"""Are the pictures of here and now? What the flight guard knows of the looks so far, and why a flight is refused."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from contracts.flight_limits import GuardAction, RefusalReason
from contracts.geometry import Point3, Pose
from contracts.vehicle import Observation, SensedView
from mission.places import distance_m
from navigation.airspace import Refusal
from navigation.camera import DepthView
from navigation.sensing import known_share

MOVED_M = 0.3
MOVED_RAD = math.radians(3.0)
BLIND_SHARE = 0.02

FINAL: dict[RefusalReason, GuardAction] = {
    "speed": "hold",
    "health": "hold",
    "manual_control": "none",
    "pose_jump": "hold",
    "stale_frames": "return",
    "frozen_frames": "return",
    "blind": "return",
    "battery_reserve": "return",
    "time_limit": "return",
}
"""What no other plan would mend, and what is done about it."""


class FlightRefused(Exception):
    """The guard does not let this flight happen: `reason`, the message for people, and where on the path."""

    def __init__(self, reason: RefusalReason, message: str, at: Point3 | None = None) -> None:
        super().__init__(message)
        self.reason = reason
        self.message = message
        self.at = at

    @classmethod
    def by(cls, refusal: Refusal) -> Self:
        """What the mathematics refused, as a mission's refusal."""
        return cls(refusal.reason, refusal.said, Point3(x=refusal.at.x, y=refusal.at.y, z=refusal.at.z))

    @property
    def final(self) -> bool:
        """No other way would be allowed either."""
        return self.reason in FINAL


class Frame(NamedTuple):
    """One camera's picture and depth as they came, and where from."""

    pose: Pose
    image: str
    depth: str


class Taken(NamedTuple):
    """When a look was taken by the vehicle's clock, and where from."""

    pose: Pose
    time_s: float


class FrameWatch:
    """Follows the looks. `cameras`: how many a whole look has."""

    def __init__(self, cameras: int, max_jump_m: float) -> None:
        self._cameras = cameras
        self._max_jump_m = max_jump_m
        self._frames: dict[str, Frame] = {}
        self._frozen: set[str] = set()
        self._taken: Taken | None = None
        self._number = -1
        self._stale = self._blind = False
        self._jumped_m = 0.0

    @property
    def distrust(self) -> FlightRefused | None:
        """Why the last look is not to be gone by; null where it is."""
        if self._stale:
            return FlightRefused("stale_frames", "the pictures are not new")
        if self._jumped_m > self._max_jump_m:
            return FlightRefused("pose_jump", f"the drone says it is {self._jumped_m:.1f} m from where it was left")
        if self._frozen:
            said = ", ".join(sorted(self._frozen))
            return FlightRefused("frozen_frames", f"the drone has moved, the picture of camera {said} has not")
        return FlightRefused("blind", "the depth cameras show nothing") if self._blind else None

    def see(self, seen: Observation, views: Sequence[DepthView], expected: Pose | None) -> None:
        """One more look, its depth decoded; `expected`: where the drone was left."""
        self._stale = seen.number <= self._number
        self._number = max(self._number, seen.number)
        self._jumped_m = distance_m(expected, seen.pose) if expected is not None else 0.0
        # one camera alone may well look into the sky
        self._blind = len(views) == self._cameras and known_share(views) < BLIND_SHARE
        shows = {view.camera.name: bool(np.isfinite(depth.depth_m).any()) for view, depth in _pairs(seen, views)}
        for view in seen.views:
            if view.depth is not None:
                frame = Frame(seen.pose, view.image.jpeg_base64, view.depth.zstd_base64)
                self._compare(view.camera.name, frame, shows=shows.get(view.camera.name, False))
        self._compare_clock(seen)

    def _compare(self, name: str, now: Frame, *, shows: bool) -> None:
        """A camera whose picture and depth stay the same to the bit while the drone moves is frozen, if it shows
        anything: an empty sky may well look the same from everywhere."""
        before = self._frames.get(name)
        if before is None or (before.image, before.depth) != (now.image, now.depth):
            self._frames[name] = now
            self._frozen.discard(name)
        elif shows and _moved(before.pose, now.pose):
            self._frozen.add(name)

    def _compare_clock(self, seen: Observation) -> None:
        """So are cameras whose clock stands still meanwhile."""
        if seen.time_s is None:
            return
        if self._taken is not None and self._taken.time_s == seen.time_s and _moved(self._taken.pose, seen.pose):
            self._frozen |= {view.camera.name for view in seen.views}
        else:
            self._taken = Taken(seen.pose, seen.time_s)


def _pairs(seen: Observation, views: Sequence[DepthView]) -> list[tuple[SensedView, DepthView]]:
    with_depth = [view for view in seen.views if view.depth is not None]
    return list(zip(with_depth, views, strict=False))


def _moved(a: Pose, b: Pose) -> bool:
    return distance_m(a, b) > MOVED_M or abs(math.remainder(a.yaw - b.yaw, math.tau)) > MOVED_RAD
