"""CARLA's own Python client, behind the few things that this service asks of it. The only module that imports `carla`.

The world is in synchronous mode: it stands still until it is ticked. All calls block; one at a time. What CARLA's
client raises leaves as Unavailable.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from threading import Lock
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from service_kit.errors import BadQuestion, Unavailable
from services.carla_world.eyes import Eye, Lens, destroy, pixels_of, shows
from services.carla_world.frames import Placed

log = logging.getLogger("carla_world.client")

RELEASE = "0.9.16"
"""Before it, cameras that move are shown from where they were a frame ago."""
OURS = "logisticsvln"
"""The role of our actors, by which those of a service that was killed are found again."""
FIRST_PICTURE_S = 0.5
CATCH_UP_TICKS = 5
"""Within so many ticks a camera's picture must show its place."""
SHARP = {"motion_blur_intensity": "0.0", "motion_blur_max_distortion": "0.0"}
"""A camera that jumps does not smear its picture."""


class Server(NamedTuple):
    """Where CARLA listens, and how long it may take for an answer, and to load a map. `tick_s`: of the simulated world
    in one tick."""

    host: str
    port: int
    timeout_s: float
    load_timeout_s: float
    tick_s: float

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class CarlaClient:
    """One connection. `settle_ticks`: between a camera's jump and its picture."""

    def __init__(self, server: Server, settle_ticks: int) -> None:
        self.server = server
        self._settle_ticks = settle_ticks
        self._carla: Any = None
        self._client: Any = None
        self._world: Any = None
        self._map: str | None = None
        self._lock = Lock()

    def problem(self) -> str | None:
        """Why CARLA can't be flown in now; null where it can."""
        if not self._lock.acquire(blocking=False):
            return None  # it is being flown in
        try:
            with self._reached():
                self._connected().get_server_version()
        except Unavailable as error:
            return error.message
        finally:
            self._lock.release()
        return None

    def enter(self, map_name: str, weather: str | None) -> None:
        """Loads a map, where another is loaded, in synchronous mode. Raises BadQuestion for a map or a weather that
        CARLA has not, or Unavailable."""
        with self._lock, self._reached():
            client = self._connected()
            preset = self._weather(weather)
            if self._map != map_name:
                self._load(client, map_name)
            self._sweep_out()
            if preset is not None:
                self._world.set_weather(preset)

    def leave(self) -> None:
        """Lets the world run by itself again: a server that waits for ticks that nobody gives stands still."""
        with self._lock:
            if self._world is None:
                return
            with suppress(Unavailable), self._reached():
                self._sweep_out()
                settings = self._world.get_settings()
                settings.synchronous_mode = False
                settings.fixed_delta_seconds = None
                self._world.apply_settings(settings, self.server.timeout_s)
            self._forget()

    def open_eyes(self, lenses: Sequence[Lens]) -> list[Eye]:
        """Cameras, wherever, once each has sent its first picture; none is left where one of them fails. Raises
        Unavailable."""
        with self._lock, self._reached():
            world = self._in_world()
            eyes: list[Eye] = []
            try:
                for lens in lenses:
                    eyes.append(self._spawned(world, lens))
                self._await_first_pictures(world, eyes)
            except BaseException:
                with suppress(RuntimeError):
                    _destroyed(eyes)
                raise
            return eyes

    def _await_first_pictures(self, world: Any, eyes: Sequence[Eye]) -> None:
        for eye in eyes:
            eye.listen()
        give_up = monotonic() + self.server.timeout_s
        while not all(eye.opens_within(FIRST_PICTURE_S) for eye in eyes):
            if monotonic() > give_up:
                raise Unavailable(
                    f"CARLA sent no picture within {self.server.timeout_s:g} s of a camera's start", code="no_picture"
                )
            world.tick(self.server.timeout_s)

    def put_up(self, blueprint_name: str, attributes: Mapping[str, str], placed: Placed) -> tuple[float, float, float]:
        """A prop; where the middle of it is against its own origin, in CARLA's frame. Raises BadQuestion or
        Unavailable."""
        with self._lock, self._reached():
            world = self._in_world()
            try:
                blueprint = world.get_blueprint_library().find(blueprint_name)
                for name, value in ({"role_name": OURS} | dict(attributes)).items():
                    if name in attributes or blueprint.has_attribute(name):
                        blueprint.set_attribute(name, value)
            except (IndexError, ValueError) as error:
                raise BadQuestion(f"CARLA can't put up {blueprint_name}: {error}", code="bad_carla_scene") from None
            actor = world.spawn_actor(blueprint, self._transform(placed))
            middle = actor.bounding_box.location
            return middle.x, middle.y, middle.z

    def close_eyes(self, eyes: Sequence[Eye]) -> None:
        """They are taken away. Those of a connection that was lost go with their map, which is loaded anew."""
        with self._lock, suppress(Unavailable), self._reached():
            _destroyed([eye for eye in eyes if eye.world is self._world])

    def take(self, eyes: Sequence[Eye], places: Sequence[Placed], *, settled: bool) -> list[NDArray[np.uint8]]:
        """(H, W, 4) each, blue first: what the cameras see from there at one tick. `settled`: after the ticks that
        pictures need; depth needs none. Raises Unavailable."""
        with self._lock, self._reached():
            if any(eye.world is not self._world for eye in eyes):
                raise Unavailable(
                    "CARLA was lost since this episode was begun, and its world with it; begin another episode",
                    code="world_lost",
                )
            wanted = [self._transform(place) for place in places]
            for eye, transform in zip(eyes, wanted, strict=True):
                eye.actor.set_transform(transform)
            for _ in range(self._settle_ticks if settled else 0):
                self._world.tick(self.server.timeout_s)
            for _ in range(CATCH_UP_TICKS):
                frame = self._world.tick(self.server.timeout_s)
                images = [eye.image_of(frame, self.server.timeout_s) for eye in eyes]
                if all(shows(image, frame, transform) for image, transform in zip(images, wanted, strict=True)):
                    return [pixels_of(image) for image in images]
        raise Unavailable(
            f"CARLA's cameras did not show where they were put within {CATCH_UP_TICKS} ticks; CARLA {RELEASE} does",
            code="late_pictures",
        )

    def _in_world(self) -> Any:
        """The world that was entered. Raises Unavailable where it was lost since."""
        if self._world is None:
            raise Unavailable(f"CARLA at {self.server} was lost meanwhile; try again", code="world_lost")
        return self._world

    def _spawned(self, world: Any, lens: Lens) -> Eye:
        blueprint = world.get_blueprint_library().find(f"sensor.camera.{lens.kind}")
        given = {
            "image_size_x": str(lens.width),
            "image_size_y": str(lens.height),
            "fov": f"{lens.fov_deg:.6f}",
            "sensor_tick": "0.0",
            "role_name": OURS,
        }
        for name, value in (given | SHARP).items():
            if blueprint.has_attribute(name):
                blueprint.set_attribute(name, value)
        return Eye(world.spawn_actor(blueprint, self._transform(Placed(0.0, 0.0, 0.0))), lens, world)

    def _connected(self) -> Any:
        """The client. Raises Unavailable where the package is missing or CARLA is of another release."""
        if self._client is not None:
            return self._client
        try:
            import carla
        except ImportError as error:
            raise Unavailable(
                f"the package carla can't be imported ({error}); install the extra: pip install '.[carla]'",
                code="carla_missing",
            ) from None
        client = carla.Client(self.server.host, self.server.port)
        client.set_timeout(self.server.timeout_s)
        found = client.get_server_version()
        if found != RELEASE:
            raise Unavailable(
                f"CARLA at {self.server} is release {found}; its client here is for {RELEASE}", code="carla_release"
            )
        self._carla, self._client = carla, client
        return client

    def _load(self, client: Any, map_name: str) -> None:
        maps = sorted(path.rpartition("/")[2] for path in client.get_available_maps())
        if map_name not in maps:
            raise BadQuestion(
                f"CARLA at {self.server} has no map {map_name!r}; there are {', '.join(maps)}", code="no_such_map"
            )
        client.set_timeout(self.server.load_timeout_s)
        try:
            self._world = client.load_world(map_name)
        finally:
            client.set_timeout(self.server.timeout_s)
        settings = self._world.get_settings()
        settings.synchronous_mode = True
        settings.fixed_delta_seconds = self.server.tick_s
        self._world.apply_settings(settings, self.server.timeout_s)
        self._map = map_name

    def _sweep_out(self) -> None:
        """Destroys what is ours in the world."""
        self._world.tick(self.server.timeout_s)
        for actor in self._world.get_actors():
            if actor.attributes.get("role_name") == OURS:
                destroy(actor)

    def _weather(self, preset: str | None) -> Any:
        if preset is None:
            return None
        found = getattr(self._carla.WeatherParameters, preset, None)
        if not isinstance(found, self._carla.WeatherParameters):
            raise BadQuestion(f"CARLA has no weather {preset!r}; ClearNoon is one", code="bad_carla_scene")
        return found

    def _transform(self, placed: Placed) -> Any:
        carla = self._carla
        return carla.Transform(
            carla.Location(placed.x, placed.y, placed.z), carla.Rotation(placed.pitch_deg, placed.yaw_deg, 0.0)
        )

    def _forget(self) -> None:
        self._client = self._world = self._map = None

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """What CARLA's client raises becomes Unavailable, and the connection is made anew the next time."""
        try:
            yield
        except RuntimeError as error:
            log.warning("CARLA at %s: %s", self.server, error)
            self._forget()
            raise Unavailable(f"CARLA at {self.server} does not answer as it should: {error}", code="carla") from None


def _destroyed(eyes: Sequence[Eye]) -> None:
    """Raises RuntimeError where CARLA does not do it."""
    for eye in eyes:
        eye.actor.stop()
        destroy(eye.actor)
