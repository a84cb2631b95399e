"""What movers look like: people in mid-stride, the parked cars' like, birds beating their wings; each built once as
a few still shapes, of which the clock chooses one."""

from functools import lru_cache
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from contracts.scene import Scene
from contracts.scene_traffic import Bird, MovingCar, Person
from services.sim.geometry.courses import F64, Course, courses_of, made_way
from services.sim.geometry.facade import chance
from services.sim.geometry.mesh import Colour, Mesh, concatenate, mixed
from services.sim.geometry.parts import Assembly
from services.sim.geometry.solids import box, ellipsoid, frustum, quad
from services.sim.geometry.street import car_shape
from services.sim.geometry.tubes import rod, tube

FRAMES = 8
"""Still shapes of one stride, and of one beat of the wings."""
STRIDE_M = 1.45
"""Two steps of a person of 1.75 m."""
BEATS_HZ = 4.0
_TALL_M = 1.75
_HIP_M, _SHOULDER_M = 0.90, 1.42
_SWING = 0.42
_SKIN = ("#e0b899", "#c68e68", "#8d5b3c", "#5c3a28")
_HAIR = ("#2a211b", "#57402c", "#8c6a3f", "#b9b4ad")
_TROUSERS = ("#2b3340", "#4a4640", "#6d6657", "#1f2226")


class Clothes(NamedTuple):
    coat: Colour
    trousers: Colour
    skin: Colour
    hair: Colour


class MovingPart(NamedTuple):
    """A part that has no place of its own: its course, and its still shapes about where it is (+x ahead)."""

    part: int
    course: Course
    frames: tuple[Mesh, ...]

    def place(self, time_s: float, drone: F64) -> F64:
        """(4,) x, y, z and heading at that time, with a drone at (3,)."""
        here: F64 = self.course.at(time_s)[0]
        if isinstance(self.course.mover, Bird):
            here[:3] = made_way(here[:3], drone)
        return here

    def mesh(self, time_s: float, drone: F64) -> Mesh:
        """As it stands in the world at that time."""
        x, y, z, yaw = self.place(time_s, drone).tolist()
        return self.frames[self._frame(time_s)].transformed(yaw=yaw, move=(x, y, z))

    def _frame(self, time_s: float) -> int:
        mover, count = self.course.mover, len(self.frames)
        if isinstance(mover, Bird):
            return int((time_s * BEATS_HZ + mover.phase) * count) % count
        stride_m = STRIDE_M * mover.height_m / _TALL_M if isinstance(mover, Person) else 1.0
        return int(self.course.travelled(np.array([time_s]))[0] / stride_m * count) % count


def build_traffic(assembly: Assembly, scene: Scene) -> tuple[MovingPart, ...]:
    """A part for each mover, after all that stands still."""
    found = []
    for course in courses_of(scene):
        mover = course.mover
        rng = chance(scene.seed, f"mover {mover.id}")
        if isinstance(mover, Person):
            clothes = Clothes(mover.colour, *(str(rng.choice(colours)) for colours in (_TROUSERS, _SKIN, _HAIR)))
            scale = mover.height_m / _TALL_M
            frames = tuple(_person(clothes, k).transformed(scale=scale) for k in range(FRAMES))
        elif isinstance(mover, MovingCar):
            frames = (car_shape(mover.colour, bool(rng.random() < 0.5)).transformed(move=(0.0, 0.0, 0.02)),)
        else:
            frames = tuple(_bird(mover.colour, k) for k in range(FRAMES))
        found.append(MovingPart(assembly.part("traffic", mover.id), course, frames))
    return tuple(found)


@lru_cache(maxsize=256)
def _person(clothes: Clothes, frame: int) -> Mesh:
    """1.75 m tall, feet on z = 0."""
    swing = sin(2.0 * pi * frame / FRAMES)
    coat, skin = clothes.coat, clothes.skin
    parts = [
        frustum(0.17, 0.21, _SHOULDER_M - 0.82, (0, 0, 0.82), 10, coat).transformed(scale=(0.62, 1.0, 1.0)),
        ellipsoid((0.13, 0.21, 0.07), (0, 0, _SHOULDER_M), 10, 4, coat),
        rod((0, 0, 1.42), (0.01, 0, 1.54), 0.055, 6, skin),
        ellipsoid((0.10, 0.085, 0.125), (0.015, 0, 1.62), 10, 6, skin),
        ellipsoid((0.105, 0.095, 0.105), (-0.012, 0, 1.655), 10, 5, clothes.hair),
    ]
    for side in (-1.0, 1.0):
        parts += _leg(side, side * swing * _SWING, clothes.trousers)
        parts += _arm(side, -side * swing * _SWING * 0.8, coat, skin)
    return concatenate(parts)


def _leg(side: float, angle: float, colour: Colour) -> list[Mesh]:
    """Swung forward by `angle`; the knee of the leg behind bends, and both soles stay near the ground."""
    y, bend = side * 0.095, max(0.0, -angle) * 0.8
    hip = (0.0, y, _HIP_M)
    knee = (0.44 * sin(angle), y, _HIP_M - 0.44 * cos(angle))
    shin = angle - bend
    ankle = (knee[0] + 0.40 * sin(shin), y, max(0.07, knee[2] - 0.40 * cos(shin)))
    shoe = box((0.26, 0.10, 0.08), (0.05, 0.0, -0.02), "#241f1c").transformed(pitch=-shin * 0.5, move=ankle)
    return [tube([hip, knee, ankle], (0.095, 0.07, 0.05), 7, colour), shoe]


def _arm(side: float, angle: float, coat: Colour, skin: Colour) -> list[Mesh]:
    shoulder = (0.0, side * 0.225, _SHOULDER_M - 0.01)
    elbow = (0.29 * sin(angle), side * 0.255, shoulder[2] - 0.29 * cos(angle))
    fore = angle + 0.25
    hand = (elbow[0] + 0.25 * sin(fore), side * 0.25, elbow[2] - 0.25 * cos(fore))
    return [tube([shoulder, elbow, hand], (0.06, 0.05, 0.04), 6, coat), ellipsoid(0.05, hand, 6, 4, skin)]


@lru_cache(maxsize=64)
def _bird(colour: Colour, frame: int) -> Mesh:
    """A metre across, about the middle of its body."""
    lift = 0.75 * sin(2.0 * pi * frame / FRAMES)
    pale = mixed(colour, "#ffffff", 0.25)
    parts = [
        ellipsoid((0.22, 0.075, 0.075), (0, 0, 0), 8, 6, colour),
        ellipsoid((0.06, 0.05, 0.05), (0.22, 0, 0.03), 7, 5, colour),
        rod((0.26, 0, 0.03), (0.33, 0, 0.02), 0.016, 5, "#c9962f"),
        quad([(-0.16, 0.04, 0.01), (-0.42, 0.11, 0.02), (-0.42, -0.11, 0.02), (-0.16, -0.04, 0.01)], pale).two_sided(),
    ]
    for side in (-1.0, 1.0):
        wrist = (side * (0.05 + 0.24 * cos(lift)), 0.03 + 0.24 * sin(lift))
        tip = (wrist[0] + side * 0.24 * cos(lift * 0.5), wrist[1] + 0.24 * sin(lift * 0.5))
        inner = [(0.11, side * 0.05, 0.03), (0.13, *wrist), (-0.11, *wrist), (-0.10, side * 0.05, 0.03)]
        outer = [(0.13, *wrist), (-0.02, *tip), (-0.10, *tip), (-0.11, *wrist)]
        parts += [quad(inner, colour).two_sided(), quad(outer, pale).two_sided()]
    return concatenate(parts)
