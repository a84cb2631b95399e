"""The plan view and the height profile of one flight, as inline SVG in the page's colours."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from contracts.events import Event, SearchEvent
from contracts.geometry import Pose
from contracts.orchestrator import DeliveryResult
from contracts.scene import Building
from contracts.scene_layout import goal_window, wall_height_m
from evaluation.metrics.taxonomy import SEARCHING, in_plain_view
from evaluation.report.markup import Html, join, tag
from evaluation.task_set.task import Task
from mission.record import track_of

MARGIN_M = 9.0

Xy = tuple[float, float]
Xyz = tuple[float, float, float]


class SearchMap(NamedTuple):
    """The search's last map as cells of the plan, `cell_m` wide: facade it has inspected, facade it has not,
    and where it expects some out of sight; and the way it meant to fly next."""

    cell_m: float
    inspected: tuple[Xy, ...]
    uninspected: tuple[Xy, ...]
    expected: tuple[Xy, ...]
    way: tuple[Xy, ...]


class Flight(NamedTuple):
    """What is drawn of a flight: the way (metres, ENU), the stops with a question to a model, each with whether the
    window was in plain view while the drone was searching, and what the search knew where it kept a map."""

    track: tuple[Xyz, ...]
    stops: tuple[tuple[Xyz, bool], ...]
    nose: float | None
    search: SearchMap | None = None


def flight_of(task: Task, result: DeliveryResult | None, events: Sequence[Event]) -> Flight:
    """From the record where the run kept one, else from the result's stops, straight legs between them."""
    start = task.scene.start.position
    if result is None:
        return Flight((), (), None)
    stops = tuple(
        (_place(stop.pose), stop.phase in SEARCHING and in_plain_view(task, stop.pose)) for stop in result.stops
    )
    track = tuple((p.x, p.y, p.z) for p in track_of(events))
    if not track and (stops or result.pose is not None):
        track = (
            (start.x, start.y, start.z),
            *(place for place, _ in stops),
            *((_place(result.pose),) if result.pose is not None else ()),
        )
    return Flight(track, stops, result.pose.yaw if result.pose is not None else None, _search_map(events))


def _search_map(events: Sequence[Event]) -> SearchMap | None:
    searched = (event.data.drawing for event in reversed(events) if isinstance(event, SearchEvent))
    drawing = next((drawing for drawing in searched if drawing is not None), None)
    if drawing is None:
        return None
    return SearchMap(drawing.cell_m, drawing.inspected, drawing.uninspected, drawing.expected, drawing.way)


def plan_view(task: Task, flight: Flight, *, good: bool) -> Html:
    """North is up. The target's building is filled; its window a marked one, the outward side included."""
    building = task.scene.building(task.scene.target)
    low, high = _extent(building, flight, task)
    size = (high[0] - low[0], high[1] - low[1])
    unit = max(size) / 100.0  # one hundredth of the drawing, for strokes and dots

    def at(x: float, y: float) -> Xy:
        return x - low[0], high[1] - y

    parts: list[Html] = []
    for road in task.scene.ground.roads:
        ends = (at(road.start.x, road.start.y), at(road.end.x, road.end.y))
        parts.append(_line(ends, "pavement", road.width_m + 2 * road.pavement_m))
        parts.append(_line(ends, "road", road.width_m))
    for tree in task.scene.ground.trees:
        x, y = at(tree.position.x, tree.position.y)
        parts.append(tag("circle", cx=_r(x), cy=_r(y), r=_r(tree.crown_m), class_="tree"))
    for other in task.scene.buildings:
        corners = [at(p.x, p.y) for p in other.footprint]
        parts.append(tag("polygon", points=_points(corners), class_="house own" if other is building else "house"))
    if flight.search is not None:
        parts += _searched(flight.search, at, unit)
    parts += _window(task, at, unit)
    way = [at(x, y) for x, y, _ in flight.track]
    if len(way) > 1:
        parts.append(tag("polyline", points=_points(way), class_="track", stroke_width=_r(1.1 * unit)))
    for (east, north, _), seen in flight.stops:
        x, y = at(east, north)
        kind = "stop seen" if seen else "stop"
        told = tag("title", "the window was in plain view") if seen else ""
        radius, edge = (1.7, _r(0.4 * unit)) if seen else (1.1, None)
        parts.append(tag("circle", told, cx=_r(x), cy=_r(y), r=_r(radius * unit), class_=kind, stroke_width=edge))
    x, y = at(task.scene.start.position.x, task.scene.start.position.y)
    parts.append(tag("circle", tag("title", "start"), cx=_r(x), cy=_r(y), r=_r(1.9 * unit), class_="start"))
    if way:
        parts.append(_drone(way[-1], flight.nose, unit, good))
    parts.append(_scale(size, unit))
    return tag(
        "svg",
        *parts,
        viewBox=f"0 0 {_r(size[0])} {_r(size[1])}",
        class_="plan",
        role="img",
        aria_label=f"Plan view of {task.id}: buildings, target window, the way flown",
    )


def plan_key() -> Html:
    """What the marks of a plan mean."""
    marks = (
        ("start", tag("circle", cx=8, cy=7, r=5, class_="start")),
        ("stop with a question to a model", tag("circle", cx=8, cy=7, r=4, class_="stop")),
        ("stop with the window in plain view", tag("circle", cx=8, cy=7, r=5, class_="stop seen")),
        ("end, and where the nose points", tag("polygon", points="15,7 3,13 6,7 3,1", class_="end bad")),
        ("facade the search inspected", tag("rect", x=2, y=3, width=12, height=8, class_="cells inspected")),
        ("facade it did not", tag("rect", x=2, y=3, width=12, height=8, class_="cells uninspected")),
        ("facade it expected out of sight", tag("rect", x=2, y=3, width=12, height=8, class_="cells expected")),
        ("the customer's window, and its side", tag("polygon", points="6,0 10,0 14,14 2,14", class_="target")),
    )
    return tag(
        "p",
        *(tag("span", tag("svg", mark, viewBox="0 0 16 14", aria_hidden="true"), words) for words, mark in marks),
        class_="plankey",
    )


def height_profile(task: Task, flight: Flight, width: int = 300, height: int = 74) -> Html:
    """Height over the way flown; the band is the target's floor, the line its window."""
    if len(flight.track) < 2:
        return Html("")
    gone = [0.0]
    for a, b in zip(flight.track[:-1], flight.track[1:], strict=True):
        gone.append(gone[-1] + math.dist(a, b))
    top = max(wall_height_m(task.scene.building(task.scene.target)), *(z for _, _, z in flight.track)) * 1.05
    left = 31.0
    length = max(gone[-1], 1.0)

    def at(s: float, z: float) -> Xy:
        return left + s / length * (width - left - 4), 4 + (1 - z / top) * (height - 20)

    floor = (task.floor - 1) * task.floor_height_m
    upper, lower = at(0, floor + task.floor_height_m)[1], at(0, floor)[1]
    parts = [
        tag(
            "rect",
            tag("title", f"floor {task.floor}"),
            x=_r(left),
            y=_r(upper),
            width=_r(width - left - 4),
            height=_r(lower - upper),
            class_="floorband",
        ),
        tag("polyline", points=_points([at(0, 0), at(length, 0)]), class_="grid"),
        tag(
            "polyline",
            points=_points([at(s, p[2]) for s, p in zip(gone, flight.track, strict=True)]),
            class_="track",
            stroke_width=1.6,
        ),
        tag("text", f"{task.target_height_m:.0f} m", x=_r(left - 4), y=_r((upper + lower) / 2 + 3), text_anchor="end"),
        tag("text", "0", x=_r(left - 4), y=_r(at(0, 0)[1] + 3), text_anchor="end"),
        tag("text", f"height over {gone[-1]:.0f} m flown, floor {task.floor} marked", x=_r(left), y=height - 3),
    ]
    return tag(
        "svg",
        *parts,
        viewBox=f"0 0 {width} {height}",
        class_="profile",
        role="img",
        aria_label="Height over the way flown",
    )


def _window(task: Task, at: Callable[[float, float], Xy], unit: float) -> list[Html]:
    slot = goal_window(task.scene)
    if slot is None:
        x, y = at(task.target.x, task.target.y)
        return [tag("circle", tag("title", "target"), cx=_r(x), cy=_r(y), r=_r(2 * unit), class_="target")]
    (cx, cy, _), n, u = slot.centre, slot.normal, slot.along
    half, out = max(slot.width_m / 2, 1.6 * unit), 5.0 * unit
    wedge = [
        at(cx - u[0] * half, cy - u[1] * half),
        at(cx + u[0] * half, cy + u[1] * half),
        at(cx + u[0] * half * 2 + n[0] * out, cy + u[1] * half * 2 + n[1] * out),
        at(cx - u[0] * half * 2 + n[0] * out, cy - u[1] * half * 2 + n[1] * out),
    ]
    return [
        tag("polygon", points=_points(wedge), class_="targetside"),
        tag(
            "polyline",
            tag("title", "the customer's window"),
            points=_points(wedge[:2]),
            class_="targetwindow",
            stroke_width=_r(2.0 * unit),
        ),
    ]


def _searched(known: SearchMap, at: Callable[[float, float], Xy], unit: float) -> list[Html]:
    side = _r(known.cell_m)
    parts = []
    for kind, cells, words in (
        ("expected", known.expected, "facade expected out of sight"),
        ("uninspected", known.uninspected, "facade not yet inspected"),
        ("inspected", known.inspected, "facade inspected"),
    ):
        corners = [at(x - known.cell_m / 2, y + known.cell_m / 2) for x, y in cells]
        squares = "".join(f"M{_r(x)} {_r(y)}h{side}v{side}h-{side}z" for x, y in corners)
        if squares:
            parts.append(tag("path", tag("title", words), d=squares, class_=f"cells {kind}"))
    if len(known.way) > 1:
        points = _points([at(x, y) for x, y in known.way])
        title = tag("title", "where the search meant to go on")
        parts.append(tag("polyline", title, points=points, class_="meant", stroke_width=_r(0.7 * unit)))
    return parts


def _drone(end: Xy, nose: float | None, unit: float, good: bool) -> Html:
    kind = "end good" if good else "end bad"
    if nose is None:
        return tag("circle", tag("title", "where it ended"), cx=_r(end[0]), cy=_r(end[1]), r=_r(2 * unit), class_=kind)
    turned = [(2.9, 0.0), (-2.0, 1.9), (-1.0, 0.0), (-2.0, -1.9)]
    corners = [
        (
            end[0] + unit * (a * math.cos(nose) - b * math.sin(nose)),
            end[1] - unit * (a * math.sin(nose) + b * math.cos(nose)),
        )
        for a, b in turned
    ]
    return tag(
        "polygon",
        tag("title", "where it ended, and where it looks"),
        points=_points(corners),
        class_=kind,
        stroke_width=_r(0.5 * unit),
    )


def _scale(size: Xy, unit: float) -> Html:
    right, y = size[0] - 2.5 * unit, size[1] - 2.5 * unit
    return join(
        (
            _line(((right - 10.0, y), (right, y)), "scalebar", 0.6 * unit),
            tag("text", "10 m", x=_r(right), y=_r(y - 1.4 * unit), text_anchor="end", font_size=_r(4 * unit)),
        )
    )


def _extent(building: Building, flight: Flight, task: Task) -> tuple[Xy, Xy]:
    """A square about the target's building and the way flown, no larger than it needs to be."""
    start = task.scene.start.position
    near = [(x, y) for x, y, _ in flight.track]
    points = [*((p.x, p.y) for p in building.footprint), (start.x, start.y), *near]
    low = (min(p[0] for p in points) - MARGIN_M, min(p[1] for p in points) - MARGIN_M)
    high = (max(p[0] for p in points) + MARGIN_M, max(p[1] for p in points) + MARGIN_M)
    side = max(high[0] - low[0], high[1] - low[1])
    middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2)
    return (middle[0] - side / 2, middle[1] - side / 2), (middle[0] + side / 2, middle[1] + side / 2)


def _place(pose: Pose) -> Xyz:
    return pose.x, pose.y, pose.z


def _line(ends: tuple[Xy, Xy], kind: str, width: float) -> Html:
    (x1, y1), (x2, y2) = ends
    return tag("line", x1=_r(x1), y1=_r(y1), x2=_r(x2), y2=_r(y2), class_=kind, stroke_width=_r(width))


def _points(points: Sequence[Xy]) -> str:
    return " ".join(f"{_r(x)},{_r(y)}" for x, y in points)


def _r(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")
