"""What is really in a picture: things with their boxes, and where the building, its windows and its floors are.

Everything comes from the renderer's id pixels and the scene document. Maps are on the proposer's grid: one value a
cell of `STRIDE` pixels, 0..255 for 0..1.
"""

from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.scene import Building, Scene
from contracts.scene_layout import floor_outline, window_slots
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.views import project, view_axes
from services.sim.truth import outline_pixels
from services.vlm_gateway.embedded.exported import ROW_SIGMA_PX

STRIDE = 8
_BEFORE_M = 0.7
_FLAT = 0.15
"""Seen flatter than this (sine of the angle to the wall), a window is no window any more."""


class Thing(NamedTuple):
    """One thing in one picture: box in pixels (left, top, right, bottom), pixels seen, share of it that is seen."""

    kind: int
    colour: int
    box: tuple[float, float, float, float]
    pixels: int
    share: float
    distance_m: float
    goal: bool


class Labels(NamedTuple):
    """`building`, `window`, `row`: (h, w) uint8. `floors`: rows (pixels, topmost first) at the picture's middle."""

    things: tuple[Thing, ...]
    building: NDArray[np.uint8]
    window: NDArray[np.uint8]
    row: NDArray[np.uint8]


class Labeller:
    """Labels of one scene's views; `numbers` give classes and colours their indices."""

    def __init__(self, scene: Scene, mesh: SceneMesh, kinds: Mapping[str, int], colours: Mapping[str, int]) -> None:
        self._scene = scene
        self._target = scene.building(scene.target)
        self._kinds, self._colours = kinds, colours
        parts = {(p.kind, p.name): p.id for p in mesh.parts}
        self._target_part = parts["building", scene.target]
        self._part_of = {parts["object", o.id]: o for o in scene.objects}
        self._triangles = _triangles_by_part(mesh)
        self._is_thing = np.zeros(len(mesh.parts) + 2, np.bool_)
        self._is_thing[list(self._part_of)] = True
        self._is_target = self._is_thing.copy()
        self._is_target[self._target_part] = True
        self._slots = window_slots(self._target)

    def of(self, pose: Pose, camera: Camera, ids: NDArray[np.uint16]) -> Labels:
        """ids: (H, W) as the renderer drew them for a level camera."""
        seen = self._is_target[ids]
        building = _shares(seen)
        rows = floor_lines(self._target, pose, camera)
        return Labels(
            self._things(pose, camera, ids),
            building,
            _shares(self._windows(pose, camera, rows.depth_m) & seen),
            row_map(rows.row_px, building),
        )

    def _things(self, pose: Pose, camera: Camera, ids: NDArray[np.uint16]) -> tuple[Thing, ...]:
        ys, xs = np.nonzero(self._is_thing[ids])
        if not len(ys):
            return ()
        owner = ids[ys, xs]
        order = np.argsort(owner, kind="stable")
        owner, ys, xs = owner[order], ys[order], xs[order]
        parts, first = np.unique(owner, return_index=True)
        found = []
        for part, at, end in zip(parts, first, [*first[1:], len(owner)], strict=True):
            thing = self._part_of[int(part)]
            x, y = xs[at:end], ys[at:end]
            triangles = self._triangles[int(part)]
            whole = outline_pixels(triangles, pose, camera)
            middle = (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1))) / 2
            found.append(
                Thing(
                    self._kinds[thing.kind],
                    self._colours[thing.colour],
                    (float(x.min()), float(y.min()), float(x.max() + 1), float(y.max() + 1)),
                    int(end - at),
                    min(1.0, float(end - at) / whole) if whole > 0 else 1.0,
                    float(np.linalg.norm(middle - (pose.x, pose.y, pose.z))),
                    thing.id == self._scene.goal,
                )
            )
        return tuple(found)

    def _windows(self, pose: Pose, camera: Camera, walls_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Openings that face the camera on the wall that is met first."""
        canvas = np.zeros((camera.height, camera.width), np.uint8)
        eye = np.array([pose.x, pose.y])
        for slot in self._slots:
            centre, normal, along = (np.array(v[:2]) for v in (slot.centre, slot.normal, slot.along))
            away = eye - centre
            distance = float(np.linalg.norm(away))
            if distance > 60 or float(away @ normal) < _FLAT * distance:
                continue
            half = along * slot.width_m / 2
            corners = np.array(
                [
                    [*(centre + s * half), slot.centre[2] + t * slot.height_m / 2]
                    for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))
                ]
            )
            pixels = project(pose, camera, np.vstack([corners, slot.centre]))
            if (pixels[:, 2] < 0.3).any():
                continue
            x, _, depth_m = pixels[4]
            column = int(np.clip(x / STRIDE, 0, walls_m.shape[1] - 1))
            if abs(walls_m[slot.floor - 1, column] - depth_m) > _BEFORE_M:
                continue
            cv2.fillConvexPoly(canvas, np.rint(np.clip(pixels[:4, :2], -4e3, 4e3)).astype(np.int32), 1)
        return canvas.astype(np.bool_)


class FloorLines(NamedTuple):
    """(floors, columns): where the middle height of each floor's windows is met in each column of cells, on the wall
    that is met first: pixels from the top (nan where there is no wall) and metres along the optical axis."""

    row_px: NDArray[np.float64]
    depth_m: NDArray[np.float64]


def floor_lines(building: Building, pose: Pose, camera: Camera) -> FloorLines:
    right, _, forward = view_axes(pose, camera)
    x = (np.arange(camera.width // STRIDE) + 0.5) * STRIDE
    rays = forward[:2] + ((x - camera.cx_px) / camera.fx_px)[:, None] * right[:2]
    rows, depths = [], []
    outline: tuple[tuple[float, float], ...] = ()
    depth = np.full(len(x), np.inf)
    for floor in range(1, building.floors + 1):
        now = floor_outline(building, floor)
        if now != outline:
            outline, depth = now, _first_walls_m(np.array(now), np.array([pose.x, pose.y]), rays)
        z = (floor - 1) * building.floor_height_m + building.windows.sill_m + building.windows.height_m / 2
        with np.errstate(invalid="ignore"):
            rows.append(np.where(np.isfinite(depth), camera.cy_px - camera.fy_px * (z - pose.z) / depth, np.nan))
        depths.append(depth)
    return FloorLines(np.array(rows), np.array(depths))


def row_map(row_px: NDArray[np.float64], building: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, w): a ridge along every floor's line that lies inside the picture and on the building."""
    height = len(building)
    y = (np.arange(height) + 0.5) * STRIDE
    inside = np.where((row_px >= 0) & (row_px < height * STRIDE), row_px, np.inf)
    near = np.abs(y[:, None, None] - inside[None]).min(axis=1)
    ridge = np.exp(-0.5 * (near / ROW_SIGMA_PX) ** 2) * 255
    on = cv2.dilate((building > 100).astype(np.uint8), np.ones((3, 3), np.uint8))
    return np.where(on > 0, ridge, 0).astype(np.uint8)


def _first_walls_m(
    outline: NDArray[np.float64], eye: NDArray[np.float64], rays: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(R,): how many times each ray one goes to the first wall that faces the eye; inf where there is none."""
    a, b = outline, np.roll(outline, -1, axis=0)
    u = b - a
    across = rays[:, None, 0] * u[None, :, 1] - rays[:, None, 1] * u[None, :, 0]
    d = a - eye
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (d[:, 0] * u[:, 1] - d[:, 1] * u[:, 0])[None] / across
        s = (d[None, :, 0] * rays[:, None, 1] - d[None, :, 1] * rays[:, None, 0]) / across
    good = (across < -1e-12) & (t > 0) & (s >= -1e-9) & (s <= 1 + 1e-9)
    return np.asarray(np.where(good, t, np.inf).min(axis=1), np.float64)


def _shares(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    size = len(mask) // STRIDE
    whole = mask.astype(np.uint8) * 255
    return np.asarray(cv2.resize(whole, (size, size), interpolation=cv2.INTER_AREA), np.uint8)


def _triangles_by_part(mesh: SceneMesh) -> dict[int, NDArray[np.float32]]:
    faces = mesh.mesh.faces
    part = mesh.part_of[faces[:, 0]]
    order = np.argsort(part, kind="stable")
    parts, first = np.unique(part[order], return_index=True)
    ends = [*first[1:], len(order)]
    return {
        int(p): np.asarray(mesh.mesh.positions[faces[order[a:b]]], np.float32)
        for p, a, b in zip(parts, first, ends, strict=True)
        if p > 0 and mesh.parts[int(p) - 1].kind == "object"
    }
