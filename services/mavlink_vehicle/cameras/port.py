"""What a source of pictures gives, whether cameras film or a simulator draws."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.vehicle import SensedView
from service_kit.errors import BadQuestion

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


def chosen_cameras(carried: Sequence[Camera], names: Sequence[str] | None) -> tuple[Camera, ...]:
    """The cameras of these names, in the order asked for; all where none are named. Raises BadQuestion."""
    if names is None:
        return tuple(carried)
    known = {camera.name: camera for camera in carried}
    wrong = next((name for name in names if name not in known), None)
    if wrong is not None or not names:
        there = ", ".join(known) or "none"
        raise BadQuestion(f"there is no camera {wrong or ''!r}; choose from {there}", code="bad_cameras")
    if len(set(names)) != len(names):
        raise BadQuestion(f"cameras={','.join(names)}: ask for each camera once", code="bad_cameras")
    return tuple(known[name] for name in names)
