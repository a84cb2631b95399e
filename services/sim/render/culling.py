"""What of a scene a view can see, nearest first: what is near hides what is far before it is shaded.

Faces that look away, and runs of faces outside the view or behind a wall, are left out before the card sees them: in
software every vertex and every triangle costs, drawn or not. What is left out would not have shown.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from services.sim.geometry.scene_mesh import SceneMesh

RUN = 48
"""Faces that are kept or left out together."""
_EDGE_ON_M = 1e-3
_DEEP_M = -50.0


class Culler:
    """The boxes and planes of one scene. Immutable."""

    def __init__(self, scene: SceneMesh) -> None:
        mesh = scene.mesh
        count = len(mesh.faces)
        self._faces = np.ascontiguousarray(mesh.faces, np.uint32)
        corners = mesh.positions[self._faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        self._normal = normal.astype(np.float32)
        self._offset = (np.einsum("ij,ij->i", normal, corners[:, 0]) - _EDGE_ON_M).astype(np.float32)
        starts = [np.arange(c.first_face, c.first_face + c.face_count, RUN) for c in scene.chunks]
        first = np.concatenate([*starts, np.zeros(0, np.int64)]).astype(np.int64)
        self._run_chunk = np.repeat(np.arange(len(starts)), [len(s) for s in starts])
        self._run_of = np.repeat(np.arange(len(first), dtype=np.uint32), np.diff(np.append(first, count)))
        self._low = self._high = self._chunk_low = self._chunk_high = np.zeros((0, 3))
        if len(first):
            self._low = np.minimum.reduceat(corners.min(axis=1), first).astype(np.float64)
            self._high = np.maximum.reduceat(corners.max(axis=1), first).astype(np.float64)
            self._chunk_low = np.array([c.low for c in scene.chunks], np.float64)
            self._chunk_high = np.array([c.high for c in scene.chunks], np.float64)
        self._occluders = scene.occluders

    def seen_from(self, eye: NDArray[np.float64]) -> "Seen":
        """What turns its face to a point and isn't behind a wall, whichever way one looks."""
        facing = self._normal @ eye.astype(np.float32) > self._offset
        clear = ~hidden(self._low, self._high, eye, self._occluders)
        index = np.flatnonzero(facing & clear[self._run_of])
        gap = np.maximum(np.maximum(self._chunk_low - eye, eye - self._chunk_high), 0.0)
        rank = np.empty(len(gap), np.uint16)
        rank[np.argsort(np.einsum("ij,ij->i", gap, gap), kind="stable")] = np.arange(len(gap))
        runs = self._run_of[index]
        order = np.argsort(rank[self._run_chunk[runs]], kind="stable")
        return Seen(eye, self._low, self._high, self._faces[index[order]], runs[order])


class Seen:
    """The faces that can be seen from one point."""

    def __init__(
        self,
        eye: NDArray[np.float64],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        faces: NDArray[np.uint32],
        runs: NDArray[np.uint32],
    ) -> None:
        self._eye, self._low, self._high, self._faces, self._runs = eye, low, high, faces, runs

    def towards(self, axes: NDArray[np.float64], camera: Camera) -> NDArray[np.uint32]:
        """(M, 3): the faces in the camera's picture, `axes` as in `view_axes`; the nearest chunk first, and within a
        chunk in the order in which they were built."""
        return self._faces[inside(self._low, self._high, self._eye, axes, camera)[self._runs]]


def inside(
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    eye: NDArray[np.float64],
    axes: NDArray[np.float64],
    camera: Camera,
) -> NDArray[np.bool_]:
    """(C,) whether the boxes low..high ((C, 3) each) reach into the camera's picture."""
    right, up, forward = axes
    to_right, to_left = (camera.width - camera.cx_px) / camera.fx_px, camera.cx_px / camera.fx_px
    to_top, to_bottom = camera.cy_px / camera.fy_px, (camera.height - camera.cy_px) / camera.fy_px
    planes = np.stack(
        [
            forward,
            to_right * forward - right,
            to_left * forward + right,
            to_top * forward - up,
            to_bottom * forward + up,
        ]
    )
    # a box is outside when even its corner farthest along a plane's normal is behind that plane
    centre, half = (low + high) / 2 - eye, (high - low) / 2
    return np.asarray((centre @ planes.T + half @ np.abs(planes).T >= 0).all(axis=1))


def hidden(
    low: NDArray[np.float64], high: NDArray[np.float64], eye: NDArray[np.float64], walls: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(C,) whether the boxes lie wholly behind one of the upright walls: (K, 5) of x, y, x, y and the top, metres."""
    if not len(walls) or not len(low):
        return np.zeros(len(low), np.bool_)
    a, b = walls[:, 0:2] - eye[:2], walls[:, 2:4] - eye[:2]
    # counter-clockwise seen from the eye; a wall seen edge on hides nothing
    turn = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    ok = np.abs(turn) > 1e-3 * np.linalg.norm(b - a, axis=1)
    a, b, top = (np.where((turn < 0)[:, None], b, a)[ok], np.where((turn < 0)[:, None], a, b)[ok], walls[ok, 4])
    if not len(a):
        return np.zeros(len(low), np.bool_)
    zero = np.zeros(len(a))
    along = b - a
    beyond = np.column_stack([along[:, 1], -along[:, 0]])  # points away from the eye
    distance = np.einsum("ij,ij->i", beyond, a)
    rise = top - eye[2]
    left = np.column_stack([-a[:, 1], a[:, 0], zero])
    right = np.column_stack([b[:, 1], -b[:, 0], zero])
    under = np.column_stack([beyond * (rise / distance)[:, None], -np.ones(len(a))])
    over = np.column_stack([beyond * (-(_DEEP_M - eye[2]) / distance)[:, None], np.ones(len(a))])
    centre, half = (low + high) / 2 - eye, (high - low) / 2
    found = np.ones((len(low), len(a)), np.bool_)
    for normal in (left, right, under, over):
        found &= centre @ normal.T >= half @ np.abs(normal).T
    behind = np.column_stack([beyond, zero])
    found &= centre @ behind.T - half @ np.abs(behind).T >= distance
    return np.asarray(found.any(axis=1))
