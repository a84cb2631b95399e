"""Which of its cameras a drone is asked for."""

from collections.abc import Sequence

from contracts.cameras import Camera
from service_kit.errors import BadQuestion


def chosen_cameras(carried: Sequence[Camera], names: Sequence[str] | None) -> tuple[Camera, ...]:
    """The cameras of these names, in the order asked for; all where none are named. Raises BadQuestion."""
    if names is None:
        return tuple(carried)
    known = {camera.name: camera for camera in carried}
    wrong = next((name for name in names if name not in known), None)
    if wrong is not None or not names:
        there = ", ".join(known) or "none"
        raise BadQuestion(
            f"there is no camera {wrong or ''!r}; choose from {there}, separated by commas", code="bad_cameras"
        )
    if len(set(names)) != len(names):
        raise BadQuestion(f"cameras={','.join(names)}: ask for each camera once", code="bad_cameras")
    return tuple(known[name] for name in names)
