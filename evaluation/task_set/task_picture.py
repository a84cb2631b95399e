"""One task as one picture: the plan with start, target and shortest way; the window; the request."""

import math
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import default_rig
from contracts.geometry import Point3
from contracts.images import decode_jpeg
from contracts.scene_layout import floor_outline
from contracts.vehicle import Move
from evaluation.sim_client import SimClient, SimulatorFault
from evaluation.task_set.proof import NotSolvable, prove
from evaluation.task_set.shortest import FIRST, SECOND, ShortestWay, goal_slot
from evaluation.task_set.task import Task
from mission.record import write_whole
from service_kit.lettering import BOLD, draw_text, text_width, wrapped

Image = NDArray[np.uint8]
_SIDE, _EDGE, _TEXT = 720, 24, 190
_PAPER, _INK, _SOFT = (250, 249, 246), (43, 52, 64), (138, 148, 160)
_TARGET, _NEIGHBOUR, _GRASS = (214, 200, 176), (206, 209, 213), (236, 240, 231)
_WAY, _START, _GOAL = (52, 110, 190), (52, 110, 190), (196, 58, 50)
_LOOK_OFF_M = 4.5


def draw_task(task: Task, simulator: SimClient, path: Path) -> None:
    """Writes the PNG. Raises SimulatorFault, OSError."""
    try:
        way = prove(task.scene, simulator, FIRST if task.clearance_m is None else SECOND).way
    except NotSolvable as error:
        raise SimulatorFault(f"{task.id} can't be flown in this simulator: {error}") from None
    sheet = np.full((_SIDE + 2 * _EDGE + _TEXT, 2 * _SIDE + 3 * _EDGE, 3), _PAPER, np.uint8)
    sheet[_EDGE : _EDGE + _SIDE, _EDGE : _EDGE + _SIDE] = plan_view(task, way)
    sheet[_EDGE : _EDGE + _SIDE, 2 * _EDGE + _SIDE : 2 * (_EDGE + _SIDE)] = window_view(task, simulator)
    _captions(sheet, task)
    ok, data = cv2.imencode(".png", cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR))
    if not ok:
        raise OSError("the picture could not be encoded")
    write_whole(path, data.tobytes())


def plan_view(task: Task, way: ShortestWay, side: int = _SIDE) -> Image:
    """North up; the target's outline at the goal's floor, everything in metres to scale."""
    scene = task.scene
    slot = goal_slot(scene)
    target = scene.building(scene.target)
    outline = floor_outline(target, 1)
    start = scene.start.position
    route = [(start.x, start.y), *((p.x, p.y) for p in way.path)]
    points = np.array([*outline, *route])
    low, high = points.min(axis=0) - 7.0, points.max(axis=0) + 7.0
    middle, reach = (low + high) / 2, float((high - low).max())
    scale = side / reach

    def px(x: float, y: float) -> tuple[int, int]:
        return round(side / 2 + (x - middle[0]) * scale), round(side / 2 - (y - middle[1]) * scale)

    image: Image = np.full((side, side, 3), _GRASS, np.uint8)
    for road in scene.ground.roads:
        width = max(1, round(road.width_m * scale))
        cv2.line(image, px(road.start.x, road.start.y), px(road.end.x, road.end.y), (222, 222, 220), width, cv2.LINE_AA)
    for tree in scene.ground.trees:
        radius = max(2, round(tree.crown_m * scale))
        cv2.circle(image, px(tree.position.x, tree.position.y), radius, (188, 206, 176), -1, cv2.LINE_AA)
    for building in scene.buildings:
        polygon = np.array([px(p.x, p.y) for p in building.footprint], np.int32)
        cv2.fillPoly(image, [polygon], _TARGET if building.id == scene.target else _NEIGHBOUR, cv2.LINE_AA)
        cv2.polylines(image, [polygon], True, _INK, 2 if building.id == scene.target else 1, cv2.LINE_AA)
    for (ax, ay), (bx, by) in pairwise(route):
        cv2.line(image, px(ax, ay), px(bx, by), _WAY, 3, cv2.LINE_AA)
    nose = px(start.x + 2.5 * math.cos(scene.start.yaw), start.y + 2.5 * math.sin(scene.start.yaw))
    cv2.arrowedLine(image, px(start.x, start.y), nose, _START, 2, cv2.LINE_AA, tipLength=0.4)
    cv2.circle(image, px(start.x, start.y), 8, _START, -1, cv2.LINE_AA)
    cv2.circle(image, px(*route[-1]), 6, _WAY, 2, cv2.LINE_AA)
    cv2.circle(image, px(slot.centre[0], slot.centre[1]), 9, _GOAL, -1, cv2.LINE_AA)
    _label(image, "start", px(start.x, start.y), side)
    _label(image, f"floor {task.floor}", px(slot.centre[0], slot.centre[1]), side)
    bar = 10 if reach > 25 else 5
    at = (24, side - 24)
    cv2.line(image, at, (at[0] + round(bar * scale), at[1]), _INK, 3, cv2.LINE_AA)
    draw_text(image, f"{bar} m", (at[0], at[1] - 10), 16, _INK)
    return image


def window_view(task: Task, simulator: SimClient, side: int = _SIDE) -> Image:
    """The target's window from straight before it. Raises SimulatorFault."""
    slot = goal_slot(task.scene)
    x, y = (slot.centre[i] + slot.normal[i] * _LOOK_OFF_M for i in (0, 1))
    start = task.scene.start.position
    facing = math.atan2(-slot.normal[1], -slot.normal[0])
    top = max(b.floors * b.floor_height_m for b in task.scene.buildings) + 12.0
    over = ((start.x, start.y, top), (x, y, top), (x, y, slot.centre[2]))
    episode = simulator.open(task.scene, default_rig().scaled_to(side))
    try:
        place = tuple(Point3(x=a, y=b, z=c) for a, b, c in over)
        simulator.move(episode.id, 1, Move(path=place, yaw=facing))
        return decode_jpeg(simulator.observe(episode.id, ("front",)).views[0].image)
    finally:
        simulator.close(episode.id)


def _captions(sheet: Image, task: Task) -> None:
    y = _SIDE + 2 * _EDGE + 20
    draw_text(
        sheet, f"{task.id}    {task.object}, floor {task.floor} of {task.floors}", (_EDGE, y), 26, _INK, weight=BOLD
    )
    facts = (
        f"{task.building}   {task.difficulty} ({task.corners} corners)   shortest way "
        f"{task.shortest_horizontal_m:.1f} m on the plan, {task.shortest_spatial_m:.1f} m in space   {task.category}   "
        f"{task.style}"
    )
    draw_text(sheet, facts, (_EDGE, y + 32), 18, _SOFT)
    for line, text in enumerate(wrapped(task.request, sheet.shape[1] - 2 * _EDGE, 19)[:5]):
        draw_text(sheet, text, (_EDGE, y + 68 + 26 * line), 19, _INK)


def _label(image: Image, text: str, at: tuple[int, int], side: int) -> None:
    size = 18
    width = text_width(text, size)
    x = min(max(8, at[0] + 14), side - width - 8)
    y = min(max(size + 8, at[1] - 12), side - 8)
    cv2.rectangle(image, (x - 4, y - size), (x + width + 4, y + 6), _PAPER, -1)
    draw_text(image, text, (x, y), size, _INK)
