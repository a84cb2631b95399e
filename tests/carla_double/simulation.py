"""A CARLA server of our own: actors, settings and ticks behind the calls that the real client makes.

It ticks by itself until a client asks for synchronous mode, and then when it is told to.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from contracts.scene import Scene
from services.sim.render.thread import RenderThread
from services.sim.scenes import SceneBuilder
from tests.carla_double.layouts import (
    DEPTH_CAMERA,
    FLOAT,
    INT,
    RGB_CAMERA,
    STRING,
    Attribute,
    Time,
    Transform,
    actor,
    definition,
    episode_state,
    image,
    token,
    transform_of,
)
from tests.carla_double.rpc import Bare, Handler, Nothing, Refusal, RpcServer
from tests.carla_double.streams import Streams
from tests.carla_double.streets import Lens, Prop, Street

VERSION = "0.9.16"
OBSERVER_STREAM = 1
FIRST_ACTOR = 24
CAMERAS = {"sensor.camera.rgb": RGB_CAMERA, "sensor.camera.depth": DEPTH_CAMERA}
PROPS = {"static.prop.plantpot04": ("flower_pot", "green"), "static.prop.wateringcan": ("watering_can", "red")}
"""Blueprints of props, and what of our catalogue is drawn for them."""
_DESTROY, _TRANSFORM = 1, 6
_BOX = 3
_SYNCHRONOUS, _DELTA = 0, 2
_LENS = (
    Attribute("image_size_x", INT, "800"),
    Attribute("image_size_y", INT, "600"),
    Attribute("fov", FLOAT, "90.0"),
    Attribute("sensor_tick", FLOAT, "0.0"),
    Attribute("role_name", STRING, "front"),
)
_PICTURE = (*_LENS, Attribute("motion_blur_intensity", FLOAT, "0.45"), Attribute("exposure_mode", STRING, "histogram"))
_PROP = (Attribute("role_name", STRING, "prop"),)
_PROP_EXTENT_M = (0.2, 0.2, 0.25)
_FREE_DELTA_S = 0.05


@dataclass
class _Actor:
    blueprint: str
    at: Transform
    record: list[Any]
    lens: Lens | None
    seen_from: list[Transform] = field(default_factory=list)


class Simulation:
    """`maps` by their names; the first is loaded. `follows_late`: ticks by which a camera's picture lags behind its
    place. `blind`: no camera sends any. `host` is an IPv4 address; port + 1 has the streams."""

    def __init__(
        self,
        maps: Sequence[Scene],
        build: SceneBuilder,
        renderer: RenderThread,
        *,
        version: str = VERSION,
        follows_late: int = 0,
        blind: bool = False,
    ) -> None:
        self._maps = {scene.name: scene for scene in maps}
        self._build = build
        self._renderer = renderer
        self._version = version
        self._late = follows_late
        self._blind = blind
        self._street = Street(maps[0], build, renderer)
        self.map = maps[0].name
        self.actors: dict[int, _Actor] = {}
        self.settings: list[Any] = [False, False, [False], True, 0.01, 10, 0.0, False, 3000.0, 2000.0, True]
        self.weather: list[float] | None = None
        self.frame = 100
        self._elapsed_s = 0.0
        self._episode = 1
        self._next_actor = FIRST_ACTOR
        self._streams = Streams()
        self._rpc = RpcServer(self._handlers())
        self._address = ("127.0.0.1", 2000)
        self._servers: list[asyncio.Server] = []
        self._ticking: asyncio.Task[None] | None = None

    @property
    def calls(self) -> list[str]:
        return self._rpc.calls

    @property
    def synchronous(self) -> bool:
        return bool(self.settings[_SYNCHRONOUS])

    async def start(self, host: str, port: int) -> None:
        self._address = (host, port)
        await self._street.prepare()
        self._servers = [await self._rpc.serve(host, port), await self._streams.serve(host, port + 1)]
        self._ticking = asyncio.create_task(self._tick_freely())

    async def stop(self) -> None:
        if self._ticking is not None:
            self._ticking.cancel()
        for server in self._servers:
            server.close()
        self._rpc.drop()
        self._streams.drop()
        await self._street.close()

    async def tick(self) -> int:
        """One step of the world: its state, and a picture from every camera that somebody listens to."""
        self.frame += 1
        given = self.settings[_DELTA]
        delta_s = given[1] if given[0] else _FREE_DELTA_S
        self._elapsed_s += delta_s
        time = Time(self.frame, self._elapsed_s, delta_s)
        places = {number: one.at for number, one in self.actors.items()}
        self._streams.send(OBSERVER_STREAM, episode_state(self._episode, time, places))
        for number, one in list(self.actors.items()):
            one.seen_from.append(one.at)
            del one.seen_from[: -1 - self._late]
            if one.lens is not None and self._streams.heard(number) and not self._blind:
                at = one.seen_from[0]
                taken = await self._street.take(at, one.lens)
                kind = CAMERAS[one.blueprint]
                body = taken.picture if kind == RGB_CAMERA else taken.depth
                self._streams.send(number, image(kind, time, at, *one.lens, body))
        return self.frame

    async def _tick_freely(self) -> None:
        while True:
            await asyncio.sleep(_FREE_DELTA_S)
            if not self.synchronous:
                await self.tick()

    def _handlers(self) -> dict[str, Handler]:
        return {
            "version": self._value(lambda: self._version),
            "get_episode_info": self._value(lambda: [self._episode, [self._token(OBSERVER_STREAM)]]),
            "get_episode_settings": self._value(lambda: self.settings),
            "set_episode_settings": self._set_settings,
            "get_sensor_token": self._sensor_token,
            "get_required_files": self._nothing_listed,
            "query_lights_state": self._nothing_listed,
            "get_available_maps": self._value(lambda: [f"/Game/Carla/Maps/{name}" for name in self._maps]),
            "load_new_episode": self._load,
            "set_weather_parameters": self._set_weather,
            "get_actor_definitions": self._value(_definitions),
            "get_actors_by_id": self._actors_by_id,
            "get_actor_bounding_box": self._bounding_box,
            "spawn_actor": self._spawn,
            "set_actor_transform": self._move,
            "destroy_actor": self._destroy,
            "apply_batch": self._batch,
            "tick_cue": self.tick,
        }

    @staticmethod
    def _value(get: Any) -> Handler:
        async def answer() -> Any:
            return get()

        return answer

    def _token(self, stream: int) -> bytes:
        host, port = self._address
        return token(stream, host, port + 1)

    async def _nothing_listed(self, *_: Any) -> list[Any]:
        return []

    async def _sensor_token(self, stream: int) -> list[bytes]:
        return [self._token(stream)]

    async def _set_settings(self, settings: list[Any]) -> int:
        self.settings = settings
        return self.frame

    async def _set_weather(self, weather: list[float]) -> Nothing:
        self.weather = weather
        return Nothing()

    async def _load(self, name: str, reset_settings: bool, _: int) -> Nothing:
        name = name.rpartition("/")[2]
        if name not in self._maps:
            raise Refusal(f"map not found: {name}")
        await self._street.close()
        self._street, self.map = Street(self._maps[name], self._build, self._renderer), name
        await self._street.prepare()
        self.actors.clear()
        self._episode += 1
        if reset_settings:
            self.settings = [False, False, [False], *self.settings[3:]]
        return Nothing()

    async def _actors_by_id(self, numbers: list[int]) -> list[Any]:
        return [self.actors[number].record for number in numbers if number in self.actors]

    async def _bounding_box(self, number: int) -> Any:
        if number not in self.actors:
            raise Refusal(f"unable to get actor bounding box: actor not found: {number}")
        return self.actors[number].record[_BOX]

    async def _spawn(self, description: list[Any], transform: list[list[float]]) -> list[Any]:
        blueprint, at = description[1], transform_of(transform)
        given = {name: value for name, _, value in description[2]}
        number, self._next_actor = self._next_actor, self._next_actor + 1
        lens = None
        if blueprint in CAMERAS:
            lens = Lens(int(given["image_size_x"]), int(given["image_size_y"]), float(given["fov"]))
        elif blueprint in PROPS:
            await self._street.put(number, Prop(*PROPS[blueprint], at))
        else:
            raise Refusal(f"no such blueprint: {blueprint}")
        record = actor(number, description, self._token(number) if lens else b"", _PROP_EXTENT_M)
        self.actors[number] = _Actor(blueprint, at, record, lens)
        return record

    async def _move(self, number: int, transform: list[list[float]]) -> Nothing:
        if number not in self.actors:
            raise Refusal(f"unable to set actor transform: actor not found: {number}")
        self.actors[number].at = transform_of(transform)
        return Nothing()

    async def _destroy(self, number: int) -> bool:
        if self.actors.pop(number, None) is None:
            raise Refusal(f"unable to destroy actor: not found: {number}")
        await self._street.remove(number)
        return True

    async def _batch(self, commands: list[Any], tick: bool) -> Bare:
        answers: list[Any] = []
        for ((kind, arguments),) in commands:
            try:
                if kind == _TRANSFORM:
                    await self._move(*arguments)
                elif kind == _DESTROY:
                    await self._destroy(*arguments)
                else:
                    raise Refusal(f"the double knows no command {kind}")
            except Refusal as error:
                answers.append([[0, [str(error)]]])
            else:
                answers.append([[1, arguments[0]]])
        if tick:
            await self.tick()
        return Bare(answers)


def _definitions() -> list[Any]:
    blueprints = {"sensor.camera.rgb": _PICTURE, "sensor.camera.depth": _LENS} | dict.fromkeys(PROPS, _PROP)
    return [definition(uid, name, attributes) for uid, (name, attributes) in enumerate(blueprints.items(), start=1)]
