"""Triangle meshes for PyBullet, handed over in the same lists every time.

PyBullet (3.2.7) keeps two references to each list that a mesh is given as, the rows of the vertices included, until the
process ends: a megabyte a street. Here those lists are filled anew for every mesh, so what is kept stays one mesh's
size.
"""

from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from services.sim.bullet import pybullet


class _Rows:
    """An (N, K) array as a list of rows."""

    def __init__(self) -> None:
        self._all: list[list[float]] = []
        self._handed: list[list[float]] = []

    def filled(self, values: NDArray[np.floating[Any]]) -> list[list[float]]:
        self._all.extend([] for _ in range(len(values) - len(self._all)))
        for row, numbers in zip(self._all, values.tolist(), strict=False):
            row[:] = numbers
        self._handed[:] = self._all[: len(values)]
        return self._handed


class _MeshLists:
    """The lists of one process, and who may fill them: `lock` is held until PyBullet has read them."""

    def __init__(self) -> None:
        self.lock = Lock()
        self.vertices, self.normals, self.uvs = _Rows(), _Rows(), _Rows()
        self._indices: list[int] = []

    def indices(self, values: NDArray[np.integer[Any]]) -> list[int]:
        self._indices[:] = values.ravel().tolist()
        return self._indices


_lists = _MeshLists()


def collision_mesh(vertices: NDArray[np.floating[Any]], indices: NDArray[np.integer[Any]], client: int) -> int:
    """A solid's shape, triangles exactly as they are: (N, 3) metres and three indices a triangle. PyBullet's number of
    it, negative where it failed."""
    with _lists.lock:
        return int(
            pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                vertices=_lists.vertices.filled(vertices),
                indices=_lists.indices(indices),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=client,
            )
        )


def visual_mesh(
    vertices: NDArray[np.floating[Any]],
    normals: NDArray[np.floating[Any]],
    uvs: NDArray[np.floating[Any]],
    indices: NDArray[np.integer[Any]],
    client: int,
) -> int:
    """What TinyRenderer draws, white and without gloss: (N, 3) metres, (N, 3) normals, (N, 2) places in the texture."""
    with _lists.lock:
        return int(
            pybullet.createVisualShape(
                pybullet.GEOM_MESH,
                vertices=_lists.vertices.filled(vertices),
                indices=_lists.indices(indices),
                normals=_lists.normals.filled(normals),
                uvs=_lists.uvs.filled(uvs),
                rgbaColor=(1, 1, 1, 1),
                specularColor=(0, 0, 0),
                physicsClientId=client,
            )
        )
