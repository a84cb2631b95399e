"""The pieces a built scene is made of, and the assembly that collects them."""

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from services.sim.geometry.mesh import Mesh, concatenate

PartKind = Literal["building", "object", "surroundings", "traffic"]


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


class Assembly:
    """Collects meshes, each as one chunk of one part, and what can be bumped into."""

    def __init__(self) -> None:
        self.parts: list[Part] = []
        self.meshes: list[Mesh] = []
        self.owners: list[int] = []
        self._solids: dict[int, list[Mesh]] = {}

    def part(self, kind: PartKind, name: str) -> int:
        """Opens a new part; its id."""
        self.parts.append(Part(len(self.parts) + 1, kind, name))
        return len(self.parts)

    def draw(self, part: int, meshes: Mesh | Iterable[Mesh]) -> None:
        """What is seen: one chunk, so give together what lies together."""
        mesh = meshes if isinstance(meshes, Mesh) else concatenate(meshes)
        if mesh.triangle_count:
            self.meshes.append(mesh)
            self.owners.append(part)

    def block(self, part: int, meshes: Mesh | Iterable[Mesh]) -> None:
        """What is solid; it may be plainer than what is drawn."""
        self._solids.setdefault(part, []).extend([meshes] if isinstance(meshes, Mesh) else meshes)

    def chunks(self) -> tuple[Chunk, ...]:
        found, first = [], 0
        for mesh in self.meshes:
            low, high = mesh.bounds
            count = mesh.triangle_count
            found.append(Chunk(first, count, _triple(low), _triple(high)))
            first += count
        return tuple(found)

    def solids(self) -> tuple[Solid, ...]:
        found = []
        for part, meshes in sorted(self._solids.items()):
            whole = concatenate(meshes)
            positions, index = np.unique(whole.positions, axis=0, return_inverse=True)
            faces = index.ravel()[whole.faces].astype(np.int32)
            proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
            found.append(Solid(part, self.parts[part - 1].name, positions.astype(np.float64), faces[proper]))
        return tuple(found)


def stamped(mesh: Mesh, frames: ArrayLike) -> Mesh:
    """Copies of a mesh, one for each 4x4 frame (K, 4, 4); frames turn and move, they don't stretch."""
    f = np.asarray(frames, np.float64).reshape(-1, 4, 4)
    k, n = len(f), mesh.vertex_count
    positions = np.einsum("kij,nj->kni", f[:, :3, :3], mesh.positions) + f[:, None, :3, 3]
    normals = np.einsum("kij,nj->kni", f[:, :3, :3], mesh.normals)
    faces = mesh.faces[None] + (np.arange(k, dtype=np.uint32) * n)[:, None, None]
    return Mesh(
        positions.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        np.tile(mesh.uv, (k, 1)),
        np.tile(mesh.colours, (k, 1)),
        np.tile(mesh.layer, k),
        faces.reshape(-1, 3).astype(np.uint32),
    )


def wall_frame(normal: Sequence[float], along: Sequence[float], origin: Sequence[float]) -> NDArray[np.float64]:
    """(4, 4): local x points out of the wall, y along it, z up; `origin` is (x, y, z)."""
    frame = np.eye(4)
    frame[:2, 0], frame[:2, 1], frame[:3, 3] = normal, along, origin
    return frame


def _triple(v: NDArray[np.float32]) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
