"""One picture of a delivery for people, drawn from its record alone."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.events import (
    Event,
    FloorCountEvent,
    LookEvent,
    SearchEvent,
    StandOffEvent,
    VerdictEvent,
)
from contracts.orchestrator import DeliveryResult
from mission.record import read_delivery, read_events, track_of, write_whole
from mission.wording import counted
from service_kit.lettering import draw_text, text_width, wrapped

Canvas = NDArray[np.uint8]
Colour = tuple[int, int, int]

WIDTH, MARGIN, PANEL = 1760, 24, 410
HEAD, PLAN = 118, 470
PAPER: Colour = (250, 249, 246)
INK: Colour = (32, 34, 38)
SOFT: Colour = (112, 116, 122)
LINE: Colour = (214, 212, 206)
TRACK: Colour = (28, 98, 196)
GOOD: Colour = (24, 128, 72)
BAD: Colour = (186, 44, 36)
OPEN: Colour = (138, 90, 0)
WALL: Colour = (148, 140, 128)
WAITING: Colour = (232, 156, 44)


def draw_summary(folder: Path) -> Path:
    """Writes `summary.png` into a record's folder.

    Raises ValueError where the folder holds no record, OSError where it can't be written.
    """
    delivery, events = read_delivery(folder), read_events(folder)
    if delivery is None or delivery.result is None:
        raise ValueError(f"{folder} holds no record of a delivery")
    path = folder / "summary.png"
    write_whole(path, summary_of(delivery.request, delivery.result, events, partial(_picture_in, folder)))
    return path


def summary_of(
    request: str, result: DeliveryResult, events: Sequence[Event], picture: Callable[[str], bytes | None]
) -> bytes:
    """A PNG file: start, floor count, sighting, last view, the way flown. `picture` gives the record's by name."""
    height = HEAD + 52 + PANEL + MARGIN + PLAN + MARGIN
    canvas: Canvas = np.full((height, WIDTH, 3), PAPER, np.uint8)
    _head(canvas, request, result)
    for at, panel in enumerate(_panels(events)):
        shown = None if panel.picture is None else _decoded(picture(panel.picture))
        if shown is not None and panel.middle is not None:
            shown = _closer(shown, panel.middle)
        _panel(canvas, MARGIN + at * (PANEL + MARGIN), HEAD, f"{at + 1}  {panel.title}", shown)
    top = HEAD + 52 + PANEL + MARGIN
    _plan(canvas[top : top + PLAN, MARGIN : MARGIN + 2 * PANEL + MARGIN], events)
    _facts(canvas, 2 * (PANEL + MARGIN) + MARGIN, top, result, events)
    _, png = cv2.imencode(".png", cv2.cvtColor(canvas, cv2.COLOR_RGB2BGR))
    return png.tobytes()


class Panel(NamedTuple):
    """One picture of the row; `middle` is where to look closer, 0..1 of the width and height."""

    title: str
    picture: str | None
    middle: tuple[float, float] | None = None


def _panels(events: Sequence[Event]) -> list[Panel]:
    counts = [e for e in events if isinstance(e, FloorCountEvent)]
    looks = [e for e in events if isinstance(e, LookEvent)]
    seen = [(e, e.data.accepted.box) for e in looks if e.phase == "explore" and e.data.accepted is not None]
    floors = counts[-1].data.floors_new if counts else None
    third = Panel("The last marked choice", _named(events, "marked"))
    if seen:
        look, box = seen[-1]
        middle = ((box.x_min + box.x_max) / 2, (box.y_min + box.y_max) / 2)
        third = Panel("The sighting, closer", _named([look], "sighting"), middle)
    return [
        Panel("At the foot of the building", _view(e for e in events if isinstance(e, StandOffEvent))),
        Panel(
            f"Floor count: {counted(floors, 'floor')} counted" if floors is not None else "Floor count: none",
            _view(reversed(counts)),
        ),
        third,
        Panel("Where it ended" if seen else "The last look", _view(looks[-1:])),
    ]


def _closer(picture: Canvas, middle: tuple[float, float]) -> Canvas:
    """A square about a place, half as wide as the picture's shorter side."""
    height, width = picture.shape[:2]
    side = min(height, width) // 2
    left = min(max(round(middle[0] * width) - side // 2, 0), width - side)
    top = min(max(round(middle[1] * height) - side // 2, 0), height - side)
    return picture[top : top + side, left : left + side]


def _view(events: Iterable[Event]) -> str | None:
    return next((name for e in events if (name := e.picture("view")) is not None), None)


def _named(events: Sequence[Event], short: str) -> str | None:
    return next((name for e in reversed(events) if (name := e.picture(short)) is not None), None)


def _picture_in(folder: Path, name: str) -> bytes | None:
    try:
        return (folder / "pictures" / name).read_bytes()
    except OSError:
        return None


def _decoded(jpeg: bytes | None) -> Canvas | None:
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) if jpeg else None
    return None if image is None else cv2.cvtColor(image, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)


def _head(canvas: Canvas, request: str, result: DeliveryResult) -> None:
    lines = wrapped(f'"{request}"', WIDTH - 2 * MARGIN - 330, 26)[:2]
    for at, line in enumerate(lines):
        draw_text(canvas, line, (MARGIN, 52 + 38 * at), 26, INK)
    label = result.outcome.replace("_", " ")
    wide = text_width(label, 30) + 44
    left = WIDTH - MARGIN - wide
    cv2.rectangle(canvas, (left, 22), (WIDTH - MARGIN, 78), _colour_of(result), -1, cv2.LINE_AA)
    draw_text(canvas, label, (left + 22, 60), 30, (255, 255, 255))


def _colour_of(result: DeliveryResult) -> Colour:
    """Of the outcome: what nobody judged is neither good nor bad."""
    return {"delivered": GOOD, "stopped_not_judged": OPEN}.get(result.outcome, BAD)


def _panel(canvas: Canvas, left: int, top: int, title: str, picture: Canvas | None) -> None:
    draw_text(canvas, title, (left, top + 32), 21, INK)
    top += 48
    if picture is None:
        cv2.rectangle(canvas, (left, top), (left + PANEL, top + PANEL), LINE, 2)
        draw_text(canvas, "not reached", (left + PANEL // 2 - 70, top + PANEL // 2), 21, SOFT)
        return
    scale = PANEL / max(picture.shape[:2])
    height, width = (max(1, round(side * scale)) for side in picture.shape[:2])
    canvas[top : top + PANEL, left : left + PANEL] = LINE
    top, left = top + (PANEL - height) // 2, left + (PANEL - width) // 2
    canvas[top : top + height, left : left + width] = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)


def _plan(canvas: Canvas, events: Sequence[Event]) -> None:
    """The way flown, seen from above: measured poses, and what the depth cameras saw of walls."""
    height, width = canvas.shape[:2]
    cv2.rectangle(canvas, (0, 0), (width - 1, height - 1), LINE, 2)
    draw_text(canvas, "The way flown, from above", (18, 34), 21, INK)
    track = [(p.x, p.y) for p in track_of(events)]
    walls = [point for e in events if isinstance(e, LookEvent) for point in e.data.returns]
    if not track:
        return
    near = [w for w in walls if min(math.dist(w, t) for t in track) < 18.0]
    points = np.array(track + near, float)
    low, high = points.min(axis=0) - 2.0, points.max(axis=0) + 2.0
    scale = min((width - 60) / (high[0] - low[0]), (height - 100) / (high[1] - low[1]), 40.0)
    middle = (low + high) / 2

    def at(p: Sequence[float]) -> tuple[int, int]:
        return (
            round(width / 2 + (p[0] - middle[0]) * scale),
            round((height + 30) / 2 - (p[1] - middle[1]) * scale),
        )

    for wall in near:
        cv2.circle(canvas, at(wall), 3, WALL, -1, cv2.LINE_AA)
    _inspected(canvas, events, at, scale)
    cv2.polylines(canvas, [np.array([at(p) for p in track], np.int32)], False, TRACK, 3, cv2.LINE_AA)
    for event in events:
        if isinstance(event, LookEvent) and event.phase == "explore":
            cv2.circle(canvas, at((event.data.pose.x, event.data.pose.y)), 7, TRACK, -1, cv2.LINE_AA)
    cv2.circle(canvas, at(track[0]), 11, INK, -1, cv2.LINE_AA)
    draw_text(canvas, "start", (at(track[0])[0] + 16, at(track[0])[1] + 22), 18, INK)
    verdict = next((e.data for e in reversed(events) if isinstance(e, VerdictEvent)), None)
    end = OPEN if verdict is None or not verdict.judged else GOOD if verdict.delivered else BAD
    cv2.circle(canvas, at(track[-1]), 11, end, -1, cv2.LINE_AA)
    ten = round(10 * scale)
    cv2.line(canvas, (width - 30 - ten, height - 22), (width - 30, height - 22), SOFT, 2)
    draw_text(canvas, "10 m", (width - 30 - ten, height - 32), 16, SOFT)


def _inspected(
    canvas: Canvas, events: Sequence[Event], at: Callable[[Sequence[float]], tuple[int, int]], scale: float
) -> None:
    """The search's last map, where its policy keeps one: facade inspected, not yet inspected, expected."""
    drawings = (e.data.drawing for e in reversed(events) if isinstance(e, SearchEvent))
    last = next((drawing for drawing in drawings if drawing is not None), None)
    if last is None:
        return
    half = max(2, round(last.cell_m * scale / 2))
    for points, colour in ((last.expected, LINE), (last.uninspected, WAITING), (last.inspected, GOOD)):
        for point in points:
            x, y = at(point)
            cv2.rectangle(canvas, (x - half, y - half), (x + half, y + half), colour, -1)
    for (x, text), colour in zip(
        ((320, "inspected"), (470, "not yet"), (590, "expected")), (GOOD, WAITING, LINE), strict=True
    ):
        cv2.rectangle(canvas, (x, 22), (x + 14, 36), colour, -1)
        draw_text(canvas, text, (x + 20, 35), 16, SOFT)


def _facts(canvas: Canvas, left: int, top: int, result: DeliveryResult, events: Sequence[Event]) -> None:
    calls = sum(c.calls for c in result.model_calls.values())
    hits = sum(c.cache_hits for c in result.model_calls.values())
    height = f", at {result.final_height_m:.1f} m" if result.final_height_m is not None else ""
    rows = [
        ("Understood", f"floor {result.floor or '?'}, {result.object or 'no object'}"),
        ("Floor", f"{result.floor or '?'}{height}"),
        ("Stops with a model query", f"{result.steps} ({result.exploration_steps} of them exploring)"),
        ("Way flown", f"{result.path_m:.1f} m in {result.flight_s:.0f} s of flight"),
        ("Model calls", f"{calls}, {hits} from the cache"),
        ("Wall time", f"{result.timings_s.get('total', 0.0):.1f} s"),
        ("Pictures by", result.renderer or "nobody"),
    ]
    cv2.rectangle(canvas, (left, top), (WIDTH - MARGIN, top + PLAN - 1), LINE, 2)
    y = top + 46
    for name, value in rows:
        draw_text(canvas, name, (left + 24, y), 20, SOFT)
        draw_text(canvas, value, (left + 330, y), 20, INK)
        y += 46
    y += 8
    for line in wrapped(result.message, WIDTH - MARGIN - left - 48, 21)[:3]:
        draw_text(canvas, line, (left + 24, y), 21, _colour_of(result))
        y += 36
