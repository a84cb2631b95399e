"""A scene document as triangles: what the renderers draw, what the world collides with, and which triangle is whose."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.scene import CALM, Air, Light, Scene
from services.sim.geometry.buildings import build_building
from services.sim.geometry.entrances import toward_start
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.occluders import occluders
from services.sim.geometry.parts import Assembly, Chunk, Part, PartKind, Solid
from services.sim.geometry.placing import keeps_sill, placed
from services.sim.geometry.street import LAMP_M, LAMP_REACH_M, build_surroundings
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.traffic import MovingPart, build_traffic

__all__ = [
    "Chunk",
    "ObjectBuilder",
    "Part",
    "PartKind",
    "SceneMesh",
    "Solid",
    "UnknownObject",
    "build_scene_mesh",
]


class ObjectBuilder(Protocol):
    """The catalogue: `build` makes one object (metres, +x its front; see `placing` for its origin).

    Raises UnknownObject for a kind or a colour it hasn't got.
    """

    def __call__(self, kind: str, colour: str, textures: TextureSet) -> Mesh: ...


class UnknownObject(ValueError):
    """The catalogue has no such kind or colour; the message lists what it has."""


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """The whole scene. `part_of` (N,) gives each vertex the id of its part; shadows are sharpest about `focus`.
    `occluders` as in `geometry.occluders`. `lamps` (K, 3): where street lamps give light after dark; `seed`: of which
    windows are lit then. `moving`: what is not in `mesh`, since it has no place there to stay."""

    mesh: Mesh
    part_of: NDArray[np.uint16]
    parts: tuple[Part, ...]
    chunks: tuple[Chunk, ...]
    solids: tuple[Solid, ...]
    textures: TextureSet
    light: Light
    focus: tuple[float, float, float]
    occluders: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 5)))
    air: Air = CALM
    lamps: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    seed: int = 0
    moving: tuple[MovingPart, ...] = ()

    def part(self, kind: PartKind, name: str) -> Part:
        """Raises KeyError."""
        for part in self.parts:
            if part.kind == kind and part.name == name:
                return part
        raise KeyError(f"{kind} {name}")

    def triangles_of(self, part: int) -> NDArray[np.float32]:
        """(M, 3, 3): the corners of a part's triangles."""
        order, firsts = self._by_part
        return np.asarray(self.mesh.positions[self.mesh.faces[order[firsts[part] : firsts[part + 1]]]], np.float32)

    @cached_property
    def _by_part(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The faces sorted by part, and where each part's begin."""
        owner = self.part_of[self.mesh.faces[:, 0]]
        order = np.argsort(owner, kind="stable")
        return order, np.searchsorted(owner[order], np.arange(len(self.parts) + 2))


def build_scene_mesh(scene: Scene, build_object: ObjectBuilder, textures: TextureSet) -> SceneMesh:
    """The same triangles for the same document, every time. `textures` are the base layers and the catalogue's.

    Raises UnknownObject for an object that the catalogue hasn't got, ValueError for a window that isn't there.
    """
    assembly = Assembly()
    objects = [placed(scene, o, build_object(o.kind, o.colour, textures)) for o in scene.objects]
    for building in scene.buildings:
        part = assembly.part("building", building.id)
        toward = toward_start(building, scene.start.position.x, scene.start.position.y)
        build_building(assembly, part, building, textures, scene.seed, keeps_sill(scene, building), toward)
    for thing, (mesh, _) in zip(scene.objects, objects, strict=True):
        part = assembly.part("object", thing.id)
        assembly.draw(part, mesh)
        assembly.block(part, mesh)
    build_surroundings(assembly, scene, textures)
    holders = [holder for _, holder in objects if holder is not None]
    assembly.draw(len(assembly.parts), holders)
    assembly.block(len(assembly.parts), holders)
    moving = build_traffic(assembly, scene)
    target = scene.building(scene.target)
    middle = np.array([(p.x, p.y) for p in target.footprint]).mean(axis=0)
    owners = [np.full(m.vertex_count, o, np.uint16) for m, o in zip(assembly.meshes, assembly.owners, strict=True)]
    return SceneMesh(
        concatenate(assembly.meshes),
        np.concatenate(owners),
        tuple(assembly.parts),
        assembly.chunks(),
        assembly.solids(),
        textures,
        scene.light,
        (float(middle[0]), float(middle[1]), target.floors * target.floor_height_m / 3),
        occluders(scene),
        scene.air,
        np.array([(lamp.x, lamp.y + LAMP_REACH_M, LAMP_M) for lamp in scene.ground.lamps], np.float64).reshape(-1, 3),
        scene.seed,
        moving,
    )
