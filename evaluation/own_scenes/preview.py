"""A scene as one picture: the plan with its starts, the street from above, the first look, the goal's window."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Rig, pinhole_camera
from contracts.geometry import Point3
from contracts.images import decode_jpeg
from contracts.scene import FreePlace, Scene, WindowPlace
from contracts.scene_layout import wall_height_m, window_slot
from contracts.vehicle import Move
from evaluation.own_scenes.check import Problem
from evaluation.own_scenes.starts import Start
from evaluation.sim_client import SimClient
from evaluation.task_set.shortest import goal_slot
from mission.record import write_whole
from service_kit.lettering import BOLD, draw_text, wrapped

Image = NDArray[np.uint8]
_SIDE, _EDGE, _LINE = 640, 20, 26
_PAPER, _INK, _SOFT = (250, 249, 246), (43, 52, 64), (138, 148, 160)
_TARGET, _NEIGHBOUR, _GRASS, _TREE = (214, 200, 176), (206, 209, 213), (236, 240, 231), (188, 206, 176)
_HEDGE, _FENCE = (134, 164, 116), (150, 132, 108)
_OPEN, _START, _GOAL, _THING = (120, 170, 120), (52, 110, 190), (196, 58, 50), (120, 110, 150)
_WAYS = {"person": (150, 90, 40), "car": (90, 96, 104), "bird": (80, 130, 190)}
_WEIGHTS = {"error": (196, 58, 50), "warning": (138, 90, 0)}
_ROUND_M = 24.0
_WINDOW_OFF_M = 5.0
_OVER_M = 10.0


def draw_preview(
    scene: Scene, starts: Sequence[Start], problems: Sequence[Problem], simulator: SimClient | None, path: Path
) -> None:
    """Writes the PNG; without a simulator, for a scene that can't be flown in, the plan alone. Raises SimulatorFault,
    OSError."""
    lines_too = "; lines, traffic" if scene.traffic else ""
    plan_says = f"Plan: green, where a drone may start; blue, its start; red, the goal{lines_too}"
    views = [(plan_says, plan_view(scene, starts))]
    if simulator is not None:
        views += [(title, look(scene, simulator)) for title, look in _looks(scene)]
    lines = [(line, _WEIGHTS[p.weight]) for p in problems for line in wrapped(f"{p.weight}: {p.text}", _wide(2), 18)]
    across = 1 if len(views) == 1 else 2
    rows = math.ceil(len(views) / across)
    height = 60 + rows * (_SIDE + _LINE + _EDGE) + len(lines) * _LINE + _EDGE
    sheet: Image = np.full((height, _wide(2), 3), _PAPER, np.uint8)
    draw_text(sheet, _title(scene), (_EDGE, 40), 26, _INK, weight=BOLD)
    for number, (title, picture) in enumerate(views):
        top, left = 60 + number // across * (_SIDE + _LINE + _EDGE), _EDGE + number % across * (_SIDE + _EDGE)
        draw_text(sheet, title, (left, top + 18), 18, _SOFT)
        sheet[top + _LINE : top + _LINE + _SIDE, left : left + _SIDE] = picture
    for number, (line, colour) in enumerate(lines):
        draw_text(sheet, line, (_EDGE, height - _EDGE - (len(lines) - number - 1) * _LINE - 6), 18, colour)
    ok, data = cv2.imencode(".png", cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR))
    if not ok:
        raise OSError("the picture could not be encoded")
    write_whole(path, data.tobytes())


def plan_view(scene: Scene, starts: Sequence[Start]) -> Image:
    """North up, to scale: buildings with their facades' numbers, things at their windows, starts."""
    target = scene.building(scene.target)
    points = np.array([(p.x, p.y) for p in target.footprint] + [(scene.start.position.x, scene.start.position.y)])
    low, high = points.min(axis=0) - _ROUND_M, points.max(axis=0) + _ROUND_M
    middle, scale = (low + high) / 2, _SIDE / float((high - low).max())

    def px(x: float, y: float) -> tuple[int, int]:
        return round(_SIDE / 2 + (x - middle[0]) * scale), round(_SIDE / 2 - (y - middle[1]) * scale)

    image: Image = np.full((_SIDE, _SIDE, 3), _GRASS, np.uint8)
    _ground(image, scene, px, scale)
    for place in starts:
        cv2.circle(image, px(place.x, place.y), 3, _OPEN, -1, cv2.LINE_AA)
    for building in scene.buildings:
        polygon = np.array([px(p.x, p.y) for p in building.footprint], np.int32)
        cv2.fillPoly(image, [polygon], _TARGET if building.id == scene.target else _NEIGHBOUR, cv2.LINE_AA)
        cv2.polylines(image, [polygon], True, _INK, 2 if building.id == scene.target else 1, cv2.LINE_AA)
    for number, corner in enumerate(target.footprint):
        after = target.footprint[(number + 1) % len(target.footprint)]
        across, down = px((corner.x + after.x) / 2, (corner.y + after.y) / 2)
        draw_text(image, str(number), (across - 5, down + 6), 15, _INK, outline=_PAPER)
    for thing in scene.objects:
        x, y = _place_of(scene, thing.place)
        goal = thing.id == scene.goal
        cv2.circle(image, px(x, y), 8 if goal else 3, _GOAL if goal else _THING, -1, cv2.LINE_AA)
    start, yaw = scene.start.position, scene.start.yaw
    nose = px(start.x + 3.0 * math.cos(yaw), start.y + 3.0 * math.sin(yaw))
    cv2.arrowedLine(image, px(start.x, start.y), nose, _START, 2, cv2.LINE_AA, tipLength=0.4)
    cv2.circle(image, px(start.x, start.y), 7, _START, -1, cv2.LINE_AA)
    cv2.line(image, (24, _SIDE - 24), (24 + round(10 * scale), _SIDE - 24), _INK, 3, cv2.LINE_AA)
    draw_text(image, "10 m", (24, _SIDE - 34), 16, _INK)
    return image


def _ground(image: Image, scene: Scene, px: Callable[[float, float], tuple[int, int]], scale: float) -> None:
    for road in scene.ground.roads:
        width = max(1, round(road.width_m * scale))
        cv2.line(image, px(road.start.x, road.start.y), px(road.end.x, road.end.y), (222, 222, 220), width, cv2.LINE_AA)
    for tree in scene.ground.trees:
        at = px(tree.position.x, tree.position.y)
        cv2.circle(image, at, max(2, round(tree.crown_m * scale)), _TREE, -1, cv2.LINE_AA)
    for car in scene.ground.cars:
        cv2.circle(image, px(car.position.x, car.position.y), max(2, round(1.2 * scale)), _SOFT, -1, cv2.LINE_AA)
    for mover in scene.traffic:
        corners = np.array([px(p.x, p.y) for p in mover.way], np.int32)
        cv2.polylines(image, [corners], mover.kind == "bird", _WAYS[mover.kind], 1, cv2.LINE_AA)
    for hedge in scene.ground.hedges:
        ends = px(hedge.start.x, hedge.start.y), px(hedge.end.x, hedge.end.y)
        cv2.line(image, *ends, _HEDGE, max(2, round(hedge.width_m * scale)), cv2.LINE_AA)
    for fence in scene.ground.fences:
        cv2.line(image, px(fence.start.x, fence.start.y), px(fence.end.x, fence.end.y), _FENCE, 2, cv2.LINE_AA)
    for pole in scene.ground.poles:
        cv2.circle(image, px(pole.position.x, pole.position.y), 3, _INK, -1, cv2.LINE_AA)
    for wire in scene.ground.wires:
        cv2.line(image, px(wire.start.x, wire.start.y), px(wire.end.x, wire.end.y), _INK, 1, cv2.LINE_AA)


def _looks(scene: Scene) -> list[tuple[str, Callable[[Scene, SimClient], Image]]]:
    """The pictures that the simulator draws."""
    looks: list[tuple[str, Callable[[Scene, SimClient], Image]]] = [
        ("From above", _from_above),
        ("What the drone sees first", _first_look),
    ]
    goal = scene.goal_object()
    at_window = goal is not None and isinstance(goal.place, WindowPlace)
    return [*looks, ("The goal's window", _at_window)] if at_window else looks


def _from_above(scene: Scene, simulator: SimClient) -> Image:
    """From behind the start, over all roofs, at the target."""
    target = scene.building(scene.target)
    x = sum(p.x for p in target.footprint) / len(target.footprint)
    y = sum(p.y for p in target.footprint) / len(target.footprint)
    reach = max(math.dist((p.x, p.y), (x, y)) for p in target.footprint)
    top = max(wall_height_m(building) for building in scene.buildings) + _OVER_M
    start = scene.start.position
    off = math.atan2(start.y - y, start.x - x)
    away = min(reach + top, scene.ground.half_size_m - 2.0 - max(abs(x), abs(y)))
    eye = Point3(x=x + away * math.cos(off), y=y + away * math.sin(off), z=top)
    down = math.degrees(math.atan2(top - wall_height_m(target) / 2, away))
    return _seen(scene, simulator, (Point3(x=start.x, y=start.y, z=top), eye), off + math.pi, pitch_deg=-down)


def _first_look(scene: Scene, simulator: SimClient) -> Image:
    return _seen(scene, simulator, (), scene.start.yaw)


def _at_window(scene: Scene, simulator: SimClient) -> Image:
    slot = goal_slot(scene)
    x, y = (slot.centre[i] + slot.normal[i] * _WINDOW_OFF_M for i in (0, 1))
    top = max(wall_height_m(building) for building in scene.buildings) + _OVER_M
    start = scene.start.position
    over = ((start.x, start.y, top), (x, y, top), (x, y, slot.centre[2]))
    path = tuple(Point3(x=a, y=b, z=c) for a, b, c in over)
    return _seen(scene, simulator, path, math.atan2(-slot.normal[1], -slot.normal[0]))


def _seen(scene: Scene, simulator: SimClient, path: tuple[Point3, ...], yaw: float, *, pitch_deg: float = 0.0) -> Image:
    """One picture from the end of the path, or from wherever the way there was blocked."""
    camera = pinhole_camera("front", _SIDE, _SIDE, horizontal_fov_deg=75.0, pitch_deg=pitch_deg)
    episode = simulator.open(scene, Rig(name="preview", cameras=(camera,)))
    try:
        if path:
            simulator.move(episode.id, 1, Move(path=path, yaw=math.remainder(yaw, math.tau)))
        return decode_jpeg(simulator.observe(episode.id, ("front",)).views[0].image)
    finally:
        simulator.close(episode.id)


def _place_of(scene: Scene, place: WindowPlace | FreePlace) -> tuple[float, float]:
    """On the plan; a window that is not there lies at the building's first corner."""
    if isinstance(place, FreePlace):
        return place.position.x, place.position.y
    building = scene.building(place.building)
    try:
        slot = window_slot(building, place.facade, place.floor, place.column)
    except ValueError:
        return building.footprint[0].x, building.footprint[0].y
    return slot.centre[0], slot.centre[1]


def _title(scene: Scene) -> str:
    target = scene.building(scene.target)
    goal = scene.goal_object()
    what = "no goal" if goal is None else f"goal: {goal.colour} {goal.kind.replace('_', ' ')}"
    if goal is not None and isinstance(goal.place, WindowPlace):
        what += f" on floor {goal.place.floor}"
    return f"{scene.name}: {target.kind.replace('_', ' ')} of {target.floors} floors, {what}"


def _wide(views: int) -> int:
    return views * _SIDE + (views + 1) * _EDGE
