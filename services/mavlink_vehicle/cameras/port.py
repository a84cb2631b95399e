"""What a source of pictures gives, whether cameras film or a simulator draws."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.vehicle import SensedView

PoseAt = Callable[[float], Pose]
"""Where the vehicle was at a moment of its clock, in the mission's frame. Raises NoPose."""


class Seen(NamedTuple):
    """Views of one moment, when that was by the vehicle's clock, and where the vehicle was then."""

    views: tuple[SensedView, ...]
    time_s: float
    pose: Pose
    timings_s: dict[str, float]


class Cameras(Protocol):
    """The cameras that a vehicle carries."""

    @property
    def carried(self) -> tuple[Camera, ...]: ...

    async def look(self, chosen: Sequence[Camera], pose_at: PoseAt, *, depth: bool) -> Seen:
        """Views by these cameras, which are carried. Raises Unavailable where there are none of now, and NoPose."""
        ...
