"""What really is in the pictures: for the oracle back end and for measuring models, never for a mission.

Everything comes from the renderer's id pixels (which part is seen in each pixel) and the scene document.
"""

import math
from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.geometry import Box, Point3, Pose
from contracts.scene import Building, Scene, SceneObject, WindowPlace
from contracts.scene_layout import floor_outline, goal_window
from contracts.sim import TruthView, VisibleObject
from episode_kit.judge import Thing
from navigation.shortest_path import NoWay, VisibilityGraph
from services.sim.geometry.scene_mesh import SceneMesh
from services.sim.render.views import NEAR_M, eye_of, project, view_axes

Ids = NDArray[np.uint16]
"""(H, W): the id of the part seen in each pixel, 0 for none."""

WAY_CLEARANCE_M = 0.8
"""How far the shortest way keeps from walls: the drone's radius and some air."""
GOAL_STAND_OFF_M = 1.5
_OUTLINE_PX = 256


def truth_view(
    scene: Scene, mesh: SceneMesh, things: Mapping[str, Thing], pose: Pose, camera: Camera, ids: Ids
) -> TruthView:
    """What one camera of a drone at `pose` shows. `ids` as the renderer drew them."""
    fitting = fitting_request(scene)
    parts = len(mesh.parts) + 1
    counts = cv2.calcHist([ids], [0], None, [parts], [0, parts]).ravel()
    objects = []
    for o in scene.objects:
        thing = things[o.id]
        pixels = int(counts[thing.part])
        box = _box_of(ids == thing.part) if pixels else None
        if box is None:
            continue
        whole = outline_pixels(mesh.triangles_of(thing.part), pose, camera)
        objects.append(
            VisibleObject(
                id=o.id,
                kind=o.kind,
                colour=o.colour,
                goal=o.id in fitting,
                box=box,
                pixels=pixels,
                share=min(1.0, pixels / whole) if whole > 0 else 1.0,
                distance_m=math.dist((pose.x, pose.y, pose.z), thing.middle),
            )
        )
    target = ids == mesh.part("building", scene.target).id
    rows = floor_rows(scene.building(scene.target), pose, camera, target)
    return TruthView(
        camera=camera.name,
        objects=tuple(sorted(objects, key=lambda v: -v.pixels)),
        building_box=_box_of(target),
        floors_visible=len(rows),
        floor_rows=tuple(rows),
    )


def floor_rows(building: Building, pose: Pose, camera: Camera, seen: NDArray[np.bool_]) -> list[float]:
    """The rows (0..1 of the height, lowest floor first) of the floors that one can count in a level view; none where
    the camera looks up or down, whose picture's columns are not upright.

    Counted up one column of the picture, the one nearest to its middle in which the building is seen at all: there,
    on the facade it meets first, a floor counts when the middle height of its windows lies inside the picture and
    the building is seen at that height somewhere near the column (a lamp post or a tree may stand right before it).
    """
    columns = np.flatnonzero(seen.any(axis=0))
    if camera.pitch_deg or not len(columns):
        return []
    column = int(columns[np.abs(columns + 0.5 - camera.cx_px).argmin()])
    right, _, forward = view_axes(pose, camera)
    x, y, eye_z = eye_of(pose, camera).tolist()
    ray = forward + (column + 0.5 - camera.cx_px) / camera.fx_px * right
    aside = int(camera.fx_px / 2)
    near = slice(max(0, column - aside), column + aside + 1)
    rows = []
    for floor in range(1, building.floors + 1):
        depth_m = _first_wall_m(floor_outline(building, floor), (x, y), (float(ray[0]), float(ray[1])))
        if depth_m is None:
            continue
        windows = building.windows
        z = (floor - 1) * building.floor_height_m + windows.sill_m + windows.height_m / 2
        row = camera.cy_px - camera.fy_px * (z - eye_z) / depth_m
        if 0.0 <= row < camera.height and seen[int(row), near].any():
            rows.append(row / camera.height)
    return rows


def fitting_request(scene: Scene) -> frozenset[str]:
    """The ids of the things that floor and object of the request fit: the goal, and what is like it at another window
    of its floor and building. Empty without a goal."""
    goal = scene.goal_object()
    if goal is None:
        return frozenset()
    return frozenset(o.id for o in scene.objects if o.id == goal.id or _is_like(o, goal))


def _is_like(other: SceneObject, goal: SceneObject) -> bool:
    here, there = goal.place, other.place
    return (
        isinstance(here, WindowPlace)
        and isinstance(there, WindowPlace)
        and (other.kind, other.colour) == (goal.kind, goal.colour)
        and (there.building, there.floor) == (here.building, here.floor)
    )


def outline_pixels(triangles: NDArray[np.float32], pose: Pose, camera: Camera) -> float:
    """How many pixels a thing would cover with nothing before it and a picture without borders.

    triangles: (M, 3, 3) metres. Painted alone on a canvas of its own, finer than the picture; what reaches behind
    the camera is left out.
    """
    corners = project(pose, camera, triangles.reshape(-1, 3)).reshape(-1, 3, 3)
    corners = corners[(corners[:, :, 2] > NEAR_M).all(axis=1)][:, :, :2]
    if not len(corners):
        return 0.0
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    finer = _OUTLINE_PX / max(float((high - low).max()), 1e-6)
    canvas = np.zeros((_OUTLINE_PX + 2, _OUTLINE_PX + 2), np.uint8)
    sixteenths = np.rint(((corners - low) * finer + 0.5) * 16).astype(np.int32)
    for triangle in sixteenths:
        cv2.fillConvexPoly(canvas, triangle, 1, lineType=cv2.LINE_8, shift=4)
    return float(canvas.sum()) / finer**2


class WayHome:
    """The remaining way to the goal's window: round the buildings on the plan, plus the difference in height."""

    def __init__(self, scene: Scene, things: Mapping[str, Thing]) -> None:
        outlines = [[(p.x, p.y) for p in building.footprint] for building in scene.buildings]
        self._graph = VisibilityGraph(outlines, WAY_CLEARANCE_M)
        self._goal = _stop_before_goal(scene, things)

    def remaining_m(self, places: Sequence[Point3]) -> tuple[float | None, ...]:
        """Metres from each place to a stop before the goal; null where there is no way, or no goal."""
        if self._goal is None or not places:
            return tuple(None for _ in places)
        x, y, z = self._goal
        ways = self._graph.routes([(p.x, p.y) for p in places], (x, y))
        return tuple(
            None if isinstance(way, NoWay) else way.length_m + abs(p.z - z) for p, way in zip(places, ways, strict=True)
        )


def _stop_before_goal(scene: Scene, things: Mapping[str, Thing]) -> tuple[float, float, float] | None:
    slot = goal_window(scene)
    if slot is not None:
        x, y = (slot.centre[i] + slot.normal[i] * GOAL_STAND_OFF_M for i in (0, 1))
        return x, y, slot.centre[2]
    return None if scene.goal is None else things[scene.goal].middle


def _box_of(mask: NDArray[np.bool_]) -> Box | None:
    height, width = mask.shape
    x, y, w, h = cv2.boundingRect(mask.view(np.uint8))
    if not w:
        return None
    return Box(x_min=x / width, y_min=y / height, x_max=(x + w) / width, y_max=(y + h) / height)


def _first_wall_m(
    outline: Sequence[tuple[float, float]], start: tuple[float, float], ray: tuple[float, float]
) -> float | None:
    """How many times `ray` one goes from `start` until the first wall of a counter-clockwise outline that faces one."""
    best = None
    for i, a in enumerate(outline):
        b = outline[(i + 1) % len(outline)]
        ux, uy = b[0] - a[0], b[1] - a[1]
        across = ray[0] * uy - ray[1] * ux
        if across >= -1e-12:  # (uy, -ux) is the outward normal: the wall looks away
            continue
        t = ((a[0] - start[0]) * uy - (a[1] - start[1]) * ux) / across
        s = ((a[0] - start[0]) * ray[1] - (a[1] - start[1]) * ray[0]) / across
        if t > 0.0 and -1e-9 <= s <= 1.0 + 1e-9 and (best is None or t < best):
            best = t
    return best
