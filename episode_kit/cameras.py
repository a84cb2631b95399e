"""Which of its cameras a drone is asked for."""

from collections.abc import Sequence

from contracts.cameras import Camera, Rig
from service_kit.errors import BadQuestion


def chosen_cameras(rig: Rig, names: Sequence[str] | None) -> tuple[Camera, ...]:
    """The rig's cameras of these names, in the order asked for. Raises BadQuestion."""
    if names is None:
        return rig.cameras
    known = {camera.name: camera for camera in rig.cameras}
    wrong = next((name for name in names if name not in known), None)
    if wrong is not None or not names:
        raise BadQuestion(
            f"there is no camera {wrong or ''!r}; choose from {', '.join(known)}, separated by commas",
            code="bad_cameras",
        )
    if len(set(names)) != len(names):
        raise BadQuestion(f"cameras={','.join(names)}: ask for each camera once", code="bad_cameras")
    return tuple(known[name] for name in names)
