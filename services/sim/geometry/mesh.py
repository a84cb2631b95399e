"""Triangle meshes: what everything that is drawn or collided with is made of.

Metres, z up. Faces run counter-clockwise seen from outside; only that side is drawn, so thin things need two sides.
`uv` is in metres for tiled textures and 0..1 for pictures (`services.sim.geometry.textures` knows which is which),
with v pointing up. Colours are sRGB and multiply the texture; layer 0 is plain white.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

F32 = NDArray[np.float32]
Colour = str | tuple[int, int, int]
"""`#rrggbb` or three numbers 0..255, sRGB."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """positions (N, 3) metres; normals (N, 3) unit; uv (N, 2); colours (N, 3) uint8 sRGB; layer (N,) index of the
    texture layer; faces (M, 3) indices, counter-clockwise seen from outside."""

    positions: F32
    normals: F32
    uv: F32
    colours: NDArray[np.uint8]
    layer: NDArray[np.uint16]
    faces: NDArray[np.uint32]

    @property
    def vertex_count(self) -> int:
        return len(self.positions)

    @property
    def triangle_count(self) -> int:
        return len(self.faces)

    @property
    def bounds(self) -> tuple[F32, F32]:
        """The lowest and the highest corner, each (3,). Raises ValueError for an empty mesh."""
        if not len(self.positions):
            raise ValueError("an empty mesh has no bounds")
        return self.positions.min(axis=0), self.positions.max(axis=0)

    def transformed(
        self,
        matrix: ArrayLike | None = None,
        *,
        move: Sequence[float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        scale: float | Sequence[float] = 1.0,
    ) -> "Mesh":
        """Moved by a 4x4 `matrix`, or scaled, then turned (roll about x, pitch about y, yaw about z, radians,
        right-handed), then moved. A mirroring turns the faces round so that outside stays outside."""
        if matrix is None:
            linear = rotation(yaw, pitch, roll) @ np.diag(np.broadcast_to(np.asarray(scale, np.float64), (3,)))
            offset = np.asarray(move, np.float64)
        else:
            full = np.asarray(matrix, np.float64)
            linear, offset = full[:3, :3], full[:3, 3]
        positions = self.positions @ linear.T + offset
        normals = _unit_rows(self.normals @ np.linalg.inv(linear))
        faces = self.faces if np.linalg.det(linear) > 0 else self.faces[:, ::-1]
        return replace(
            self,
            positions=positions.astype(np.float32),
            normals=normals.astype(np.float32),
            faces=np.ascontiguousarray(faces),
        )

    def recoloured(self, colour: Colour) -> "Mesh":
        """The same shape with one colour everywhere."""
        return replace(self, colours=np.tile(rgb(colour), (self.vertex_count, 1)))

    def relayered(self, layer: int) -> "Mesh":
        """The same shape with one texture layer everywhere."""
        return replace(self, layer=np.full(self.vertex_count, layer, np.uint16))

    def shaded(self, factor: float) -> "Mesh":
        """Colours multiplied by `factor` (0..1): the darkness of corners that little light reaches."""
        return replace(self, colours=np.clip(np.rint(self.colours * factor), 0, 255).astype(np.uint8))

    def flipped(self) -> "Mesh":
        """Seen from the other side."""
        return replace(self, normals=-self.normals, faces=np.ascontiguousarray(self.faces[:, ::-1]))

    def two_sided(self) -> "Mesh":
        return concatenate([self, self.flipped()])


def empty() -> Mesh:
    return Mesh(
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.float32),
        np.zeros((0, 2), np.float32),
        np.zeros((0, 3), np.uint8),
        np.zeros(0, np.uint16),
        np.zeros((0, 3), np.uint32),
    )


def concatenate(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of all; the order of faces follows the order given."""
    parts = list(meshes)
    if not parts:
        return empty()
    offsets = np.cumsum([0] + [m.vertex_count for m in parts[:-1]]).astype(np.uint32)
    return Mesh(
        np.concatenate([m.positions for m in parts]),
        np.concatenate([m.normals for m in parts]),
        np.concatenate([m.uv for m in parts]),
        np.concatenate([m.colours for m in parts]),
        np.concatenate([m.layer for m in parts]),
        np.concatenate([m.faces + o for m, o in zip(parts, offsets, strict=True)]),
    )


def make(
    positions: ArrayLike,
    faces: ArrayLike,
    normals: ArrayLike,
    uv: ArrayLike,
    colour: Colour = "#ffffff",
    layer: int = 0,
) -> Mesh:
    """A mesh of one colour and one layer from plain arrays."""
    p = np.ascontiguousarray(positions, np.float32).reshape(-1, 3)
    # not tiled: a scene has thousands of these, and tiling three numbers takes longer than the rest
    colours = np.empty((len(p), 3), np.uint8)
    colours[:] = rgb(colour)
    return Mesh(
        p,
        np.ascontiguousarray(normals, np.float32).reshape(-1, 3),
        np.ascontiguousarray(uv, np.float32).reshape(-1, 2),
        colours,
        np.full(len(p), layer, np.uint16),
        np.ascontiguousarray(faces, np.uint32).reshape(-1, 3),
    )


def rgb(colour: Colour) -> NDArray[np.uint8]:
    """(3,) uint8. Raises ValueError for a string that is not #rrggbb."""
    return _parsed(colour).copy() if isinstance(colour, str) else np.array(colour, np.uint8)


@lru_cache(maxsize=4096)
def _parsed(colour: str) -> NDArray[np.uint8]:
    if len(colour) != 7 or colour[0] != "#":
        raise ValueError(f"a colour is written #rrggbb, not {colour!r}")
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], np.uint8)


def mixed(a: Colour, b: Colour, share_of_b: float) -> tuple[int, int, int]:
    """A colour between two."""
    c = rgb(a) * (1.0 - share_of_b) + rgb(b) * share_of_b
    return round(float(c[0])), round(float(c[1])), round(float(c[2]))


def rotation(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> NDArray[np.float64]:
    """(3, 3): roll about x first, then pitch about y, then yaw about z; radians, right-handed."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (np.cos, np.sin))
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return np.asarray(about_z @ about_y @ about_x, np.float64)


def _unit_rows(v: NDArray[np.floating]) -> NDArray[np.floating]:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / np.where(length < 1e-12, 1.0, length))
