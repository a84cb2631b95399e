"""A scene document as triangles: what the renderers draw, what the world collides with, and which triangle is whose."""

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Light
from services.sim.geometry.mesh import Mesh
from services.sim.geometry.textures import TextureSet

PartKind = Literal["building", "object", "surroundings"]


class ObjectBuilder(Protocol):
    """The catalogue: `build` makes one object (metres, origin in the middle of its underside, +x its front).

    Raises services.sim.geometry.scene_mesh.UnknownObject for a kind or a colour it hasn't got.
    """

    def __call__(self, kind: str, colour: str, textures: TextureSet) -> Mesh: ...


class UnknownObject(ValueError):
    """The catalogue has no such kind or colour; the message lists what it has."""


class Part(NamedTuple):
    """One thing that can be told apart: `id` counts from 1 (0 is nothing); `name` is the document's id."""

    id: int
    kind: PartKind
    name: str


class Chunk(NamedTuple):
    """A run of faces that is drawn or left out as one; `low` and `high` (3,) bound it."""

    first_face: int
    face_count: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]


class Solid(NamedTuple):
    """Something one can bump into: positions (N, 3) float64 metres, faces (M, 3), the part's id and name."""

    part: int
    name: str
    positions: NDArray[np.float64]
    faces: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """The whole scene. `part_of` (N,) gives each vertex the id of its part; shadows are sharpest about `focus`."""

    mesh: Mesh
    part_of: NDArray[np.uint16]
    parts: tuple[Part, ...]
    chunks: tuple[Chunk, ...]
    solids: tuple[Solid, ...]
    textures: TextureSet
    light: Light
    focus: tuple[float, float, float]

    def part(self, kind: PartKind, name: str) -> Part:
        """Raises KeyError."""
        for part in self.parts:
            if part.kind == kind and part.name == name:
                return part
        raise KeyError(f"{kind} {name}")
