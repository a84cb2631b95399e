"""The binary layouts of CARLA 0.9.16's streams, and the arrays of its remote calls, as its client reads them.

Learnt from LibCarla's public headers (`sensor/s11n`, `sensor/data`, `streaming/detail/Token.h`, `rpc`) and from the
client itself. Everything is little-endian and packed. Locations are in metres, left-handed (x forward, y right, z up);
rotations in degrees: pitch, yaw, roll.
"""

import struct
from typing import Any, NamedTuple

DEPTH_CAMERA, RGB_CAMERA, WORLD_OBSERVER = 1, 13, 17
"""A sensor's place in the client's registry of sensors."""
BOOL, INT, FLOAT, STRING = 1, 2, 3, 4
"""Types of a blueprint's attributes."""

_SENSOR = struct.Struct("<QQd6f")
_IMAGE = struct.Struct("<IIf")
_EPISODE = struct.Struct("<Qdf3iI")
_ACTOR = struct.Struct("<IB6f9f54x")
_TOKEN = struct.Struct("<IHBB4s12x")
_SIZE = struct.Struct("<I")
_TCP, _IPV4 = 1, 1
_ACTIVE = 1
STREAM_ID = struct.Struct("<I")


class Transform(NamedTuple):
    """Metres and degrees, as CARLA has them."""

    x: float
    y: float
    z: float
    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0


class Time(NamedTuple):
    """A tick: its number, seconds since the world began, and seconds since the tick before."""

    frame: int
    elapsed_s: float
    delta_s: float


class Attribute(NamedTuple):
    """Of a blueprint: its name, its type, and the value it has where nobody sets it."""

    name: str
    kind: int
    value: str


def transform_of(array: list[list[float]]) -> Transform:
    """Of a remote call's argument: location, rotation."""
    return Transform(*array[0], *array[1])


def token(stream: int, host: str, port: int) -> bytes:
    """What a client needs to subscribe to a stream; 24 bytes."""
    address = bytes(int(part) for part in host.split("."))
    return _TOKEN.pack(stream, port, _TCP, _IPV4, address)


def message(body: bytes) -> bytes:
    """As it goes through a stream: its length, and itself."""
    return _SIZE.pack(len(body)) + body


def image(kind: int, time: Time, at: Transform, width: int, height: int, fov_deg: float, bgra: bytes) -> bytes:
    """A camera's picture."""
    return _SENSOR.pack(kind, time.frame, time.elapsed_s, *at) + _IMAGE.pack(width, height, fov_deg) + bgra


def episode_state(episode: int, time: Time, actors: dict[int, Transform]) -> bytes:
    """What the world observer tells of every actor at a tick."""
    head = _SENSOR.pack(WORLD_OBSERVER, time.frame, time.elapsed_s, *Transform(0.0, 0.0, 0.0))
    state = _EPISODE.pack(episode, time.elapsed_s, time.delta_s, 0, 0, 0, 0)
    still = (0.0,) * 9
    return head + state + b"".join(_ACTOR.pack(actor, _ACTIVE, *at, *still) for actor, at in actors.items())


def definition(uid: int, blueprint: str, attributes: tuple[Attribute, ...]) -> list[Any]:
    """A blueprint, as `get_actor_definitions` lists it."""
    listed = [[*attribute, [], True, False] for attribute in attributes]
    return [uid, blueprint, blueprint.replace(".", ","), listed]


def actor(number: int, description: Any, stream_token: bytes, extent_m: tuple[float, float, float]) -> list[Any]:
    """An actor: its bounding box stands on its own origin."""
    box = [[0.0, 0.0, extent_m[2]], list(extent_m), [0.0, 0.0, 0.0]]
    return [number, 0, description, box, b"", stream_token]
