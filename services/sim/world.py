"""The solid world of one episode in PyBullet: what the drone can touch and what a line of sight can hit.

Every world has a physics client of its own, so episodes can't see each other. Everything in it stands still (what
moves is in `services.sim.traffic`); the drone is a sphere that is put where a question is asked. Metres, ENU.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from episode_kit.judge import Hit
from episode_kit.kinematics import Vector
from episode_kit.trajectory import Sweep
from services.sim.bullet import pybullet
from services.sim.geometry.scene_mesh import Solid
from services.sim.physics_meshes import collision_mesh

TOUCH_M = 0.002
"""Nearer than this is a contact."""
REACH_M = 1.5
"""How far one query looks; the sweep never advances further than this without asking again."""
GROUND = "ground"
EDGE = "edge-of-the-world"
CEILING_ABOVE_ROOFS_M = 60.0
_FACES_PER_BODY = 20_000
_ALONG = 1e-3
"""A motion that nears a surface by less than this share of its length runs along it."""


class Contact(NamedTuple):
    """How near the sphere is to one triangle of a solid; `normal` points from the solid to the drone."""

    name: str
    clearance_m: float
    normal: Vector


class _Piece(NamedTuple):
    whose: Hit
    vertices: NDArray[np.float64]
    indices: NDArray[np.int64]


class Blueprint:
    """A scene's solids in the form PyBullet takes, made once and built into as many worlds as there are episodes.

    `half_size_m` is where the world ends, east, west, north and south of the origin; `roof_m` the highest roof.
    """

    def __init__(self, solids: Sequence[Solid], half_size_m: float, roof_m: float) -> None:
        self.half_size_m = half_size_m
        self.roof_m = roof_m
        self.ceiling_m = roof_m + CEILING_ABOVE_ROOFS_M
        self.pieces = [piece for solid in solids for piece in _pieces(solid)]

    @property
    def triangles(self) -> int:
        return sum(len(piece.indices) // 3 for piece in self.pieces)


class World:
    """One physics client with a scene's solids and the drone's sphere. Call `close` when done; not thread-safe."""

    def __init__(self, blueprint: Blueprint, radius_m: float) -> None:
        self.radius_m = radius_m
        self._client: int = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet has no physics client left")
        self._whose: dict[int, Hit] = {}
        try:
            self._build(blueprint)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Gives the physics client back; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def contacts(self, position: Vector, reach_m: float) -> list[Contact]:
        """Everything whose surface is within `reach_m` of the sphere's surface, were it at `position`; negative
        clearances are overlaps."""
        client = self._client
        pybullet.resetBasePositionAndOrientation(self._drone, position, (0, 0, 0, 1), physicsClientId=client)
        grown = self.radius_m + reach_m
        low, high = [c - grown for c in position], [c + grown for c in position]
        near = pybullet.getOverlappingObjects(low, high, physicsClientId=client) or ()
        found = []
        for body in sorted({body for body, _ in near} - {self._drone}):
            for point in pybullet.getClosestPoints(self._drone, body, reach_m, physicsClientId=client):
                found.append(Contact(self._whose[body].name, float(point[8]), tuple(point[7])))
        return found

    def clearance_m(self, position: Vector, reach_m: float = REACH_M) -> float:
        """Metres between the sphere's surface at `position` and the nearest solid, at most `reach_m`."""
        return min((c.clearance_m for c in self.contacts(position, reach_m)), default=reach_m)

    def touching(self, position: Vector) -> str | None:
        """The name of what the sphere touches at `position`, if anything."""
        near = [c for c in self.contacts(position, TOUCH_M) if c.clearance_m < TOUCH_M]
        return min(near, key=lambda c: c.clearance_m).name if near else None

    def sweep(self, start: Vector, end: Vector) -> Sweep:
        """Moves the sphere along the straight line until it touches something.

        Conservative advancement: the distance to a convex thing, and every triangle is one, shrinks no faster than
        it does at first. So no thing, however thin, is jumped over, and flying along a wall costs no more than
        flying in the open. Something touched from the start stops only a motion towards it.
        """
        length = math.dist(start, end)
        if length == 0.0:
            return Sweep(0.0, None)
        x, y, z = ((b - a) / length for a, b in zip(start, end, strict=True))
        free_m = 0.0
        while True:
            here = (start[0] + x * free_m, start[1] + y * free_m, start[2] + z * free_m)
            safe_m = REACH_M
            hit, hit_m = None, TOUCH_M
            for name, clearance_m, normal in self.contacts(here, min(REACH_M, length - free_m + TOUCH_M)):
                approach = -(x * normal[0] + y * normal[1] + z * normal[2])
                if approach < _ALONG:
                    continue
                if clearance_m < hit_m:
                    hit, hit_m = name, clearance_m
                safe_m = min(safe_m, clearance_m / approach)
            if hit is not None:
                return Sweep(free_m, hit)
            if free_m >= length:
                return Sweep(length, None)
            free_m = min(length, free_m + max(safe_m - TOUCH_M / 2, TOUCH_M / 2))

    def first_hits(self, start: Vector, ends: Sequence[Vector]) -> list[Hit | None]:
        """For each straight line from `start`: the first thing on it, null where it is free."""
        rays = pybullet.rayTestBatch([start] * len(ends), list(ends), physicsClientId=self._client)
        return [None if ray[0] < 0 else self._whose[ray[0]] for ray in rays]

    def _build(self, blueprint: Blueprint) -> None:
        client = self._client
        for piece in blueprint.pieces:
            self._add(piece.whose, collision_mesh(piece.vertices, piece.indices, client), (0.0, 0.0, 0.0))
        e = blueprint.half_size_m
        bounds: tuple[tuple[str, Vector, Vector], ...] = (
            (GROUND, (0, 0, 1), (0, 0, 0)),
            (EDGE, (0, 0, -1), (0, 0, blueprint.ceiling_m)),
            (EDGE, (1, 0, 0), (-e, 0, 0)),
            (EDGE, (-1, 0, 0), (e, 0, 0)),
            (EDGE, (0, 1, 0), (0, -e, 0)),
            (EDGE, (0, -1, 0), (0, e, 0)),
        )
        for name, normal, foot in bounds:
            plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=normal, physicsClientId=client)
            self._add(Hit(0, name), plane, foot)
        sphere = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=self.radius_m, physicsClientId=client)
        self._drone: int = pybullet.createMultiBody(0, sphere, physicsClientId=client)
        # rays ask what lies between two places, and the drone is never in its own way
        pybullet.setCollisionFilterGroupMask(self._drone, -1, 0, 0, physicsClientId=client)

    def _add(self, whose: Hit, shape: Any, foot: Vector) -> None:
        body = pybullet.createMultiBody(0, shape, basePosition=foot, physicsClientId=self._client)
        if shape < 0 or body < 0:
            raise RuntimeError(f"PyBullet could not build {whose.name}")
        self._whose[body] = whose


def _pieces(solid: Solid) -> Iterator[_Piece]:
    """A solid in pieces, split where PyBullet's shared memory would be too small for it at once."""
    for first in range(0, len(solid.faces), _FACES_PER_BODY):
        faces = solid.faces[first : first + _FACES_PER_BODY]
        used, indices = np.unique(faces, return_inverse=True)
        yield _Piece(Hit(solid.part, solid.name), solid.positions[used], indices.ravel())
