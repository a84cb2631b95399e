"""A camera in CARLA's world, and what its pictures say of themselves."""

from threading import Condition
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from service_kit.errors import Unavailable

SAME_PLACE_M, SAME_DIRECTION = 0.01, 0.001
Kind = Literal["rgb", "depth"]


class Lens(NamedTuple):
    """A camera of square pixels with its principal point in the picture's middle."""

    kind: Kind
    width: int
    height: int
    fov_deg: float


class Eye:
    """A camera in CARLA's world. It keeps its last picture alone: it is sent one at every tick, looked at or not."""

    def __init__(self, actor: Any, lens: Lens, world: Any) -> None:
        """`world`: the connection's, to which it belongs."""
        self.actor = actor
        self.world = world
        self.lens = lens
        self._image: Any = None
        self._arrived = Condition()

    def listen(self) -> None:
        self.actor.listen(self._take)

    def opens_within(self, seconds: float) -> bool:
        """Whether it has sent a picture by then."""
        with self._arrived:
            return self._arrived.wait_for(lambda: self._image is not None, seconds)

    def image_of(self, frame: int, within_s: float) -> Any:
        """Its picture of that tick. Raises Unavailable where none comes."""
        with self._arrived:
            if self._arrived.wait_for(lambda: self._image is not None and self._image.frame >= frame, within_s):
                return self._image
        raise Unavailable(
            f"CARLA sent no {self.lens.kind} picture of tick {frame} within {within_s:g} s", code="no_picture"
        )

    def _take(self, image: Any) -> None:
        """Called by CARLA's client, in a thread of its own."""
        with self._arrived:
            self._image = image
            self._arrived.notify_all()


def destroy(actor: Any) -> None:
    """Raises RuntimeError where CARLA does not do it: its client only says so."""
    if not actor.destroy():
        raise RuntimeError(f"actor {actor.id} could not be destroyed")


def shows(image: Any, frame: int, wanted: Any) -> bool:
    """Whether the picture is of that tick and taken from that transform. Directions are compared and not angles, of
    which straight up and down have many."""
    at = image.transform
    ahead = at.get_forward_vector().distance(wanted.get_forward_vector())
    upwards = at.get_up_vector().distance(wanted.get_up_vector())
    placed = bool(at.location.distance(wanted.location) <= SAME_PLACE_M)
    return placed and bool(image.frame == frame) and bool(max(ahead, upwards) <= SAME_DIRECTION)


def pixels_of(image: Any) -> NDArray[np.uint8]:
    pixels = np.frombuffer(image.raw_data, np.uint8)
    return pixels.reshape(image.height, image.width, 4).copy()
