"""Which pictures of a failure tell most, small enough to carry them all in one page."""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.cameras import Camera
from contracts.events import DirectionEvent, Event, FloorCountEvent, LookEvent
from contracts.images import BadImage, image_header
from evaluation.metrics.episode import Reason
from evaluation.metrics.taxonomy import in_plain_view
from evaluation.task_set.task import Task
from mission.record import PICTURE_NAME

JPEG_QUALITY = 74
WIDEST_PX, NARROWEST_PX = 400, 160
_BYTES_AT_WIDEST, _GROWTH = 22_000, 1.7
"""What a street's picture takes in the page at its widest, and how that grows with the width: measured."""
DEFAULT_BYTES = 24_000_000
FEWEST, WIDE_ENOUGH_PX = 2, 260
FACADE_SIDE_DEG = 60.0
"""Where a drone that flies clockwise has the building."""


class Shown(NamedTuple):
    """A picture's file name in the record, and what it shows; those with the lowest `rank` tell most."""

    name: str
    caption: str
    rank: int = 0


class Picture(NamedTuple):
    """A picture ready for the page: a `data:` address."""

    source: str
    caption: str


@dataclass
class Album:
    """Downscales `planned` pictures so that all find room in `limit_bytes`; `left_out` counts those that found none.

    Each picture may be as wide as what is left allows, so that pictures that take more or less than usual even out."""

    planned: int
    limit_bytes: int = DEFAULT_BYTES
    used_bytes: int = 0
    left_out: int = 0
    _heaviness: float = 1.0

    def picture(self, path: Path, caption: str) -> Picture | None:
        """Null where the file is gone, is no picture, or the page is full."""
        edge_px = edge_for(self.planned, (self.limit_bytes - self.used_bytes) / self._heaviness)
        self.planned -= 1
        image = _read(path, edge_px)
        if image is None:
            return None
        coded = _coded(image, edge_px)
        if self.used_bytes + len(coded) > self.limit_bytes:
            coded = _coded(image, NARROWEST_PX)
        if not coded or self.used_bytes + len(coded) > self.limit_bytes:
            self.left_out += 1
            return None
        self.used_bytes += len(coded)
        # what these pictures take, beside what a street's picture took when it was measured
        usual = _BYTES_AT_WIDEST * math.pow(edge_px / WIDEST_PX, _GROWTH)
        self._heaviness += 0.3 * (max(0.5, len(coded) / usual) - self._heaviness)
        return Picture(f"data:image/jpeg;base64,{coded}", caption)


def edge_for(pictures: int, limit_bytes: float = DEFAULT_BYTES) -> int:
    """How wide each of so many pictures may be, so that all of them find room."""
    share = max(0, limit_bytes) / max(1, pictures) / _BYTES_AT_WIDEST
    return max(NARROWEST_PX, min(WIDEST_PX, round(WIDEST_PX * math.pow(share, 1 / _GROWTH))))


def most_telling(shown: Sequence[Sequence[Shown]], limit_bytes: int = DEFAULT_BYTES) -> list[list[Shown]]:
    """Each failure's pictures, fewer of each where otherwise none would be wide enough to see something."""
    most = max((len(each) for each in shown), default=0)
    while most > FEWEST and edge_for(sum(min(most, len(each)) for each in shown), limit_bytes) < WIDE_ENOUGH_PX:
        most -= 1
    kept = []
    for each in shown:
        best = sorted(range(len(each)), key=lambda at: each[at].rank)[:most]
        kept.append([each[at] for at in sorted(best)])
    return kept


def _coded(image: NDArray[np.uint8], edge_px: int) -> str:
    """As JPEG in base64, at most `edge_px` wide and high; empty where it can't be encoded."""
    height, width = image.shape[:2]
    scale = min(1.0, edge_px / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    done, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return base64.b64encode(jpeg.tobytes()).decode("ascii") if done else ""


def _read(path: Path, edge_px: int) -> NDArray[np.uint8] | None:
    """(H, W, 3) BGR, decoded at half its size where that is enough: three times as fast."""
    try:
        data = path.read_bytes()
        header = image_header(data)
    except (OSError, BadImage):
        return None
    half = max(header.width, header.height) >= 2 * edge_px
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_REDUCED_COLOR_2 if half else cv2.IMREAD_COLOR)
    return None if image is None else image.astype(np.uint8, copy=False)


def evidence(task: Task, reason: Reason, events: Sequence[Event]) -> list[Shown]:
    """The pictures that show why: the floors as counted, the thing that was claimed, the look in which the window was
    in plain view, or the last look and choice; without any of these the last pictures there are."""
    looks = [e for e in events if isinstance(e, LookEvent) and e.pictures]
    if reason == "floor":
        counted = [e for e in events if isinstance(e, FloorCountEvent) and e.pictures][-4:]
        shown = [Shown(e.pictures[0], _first(e.message), -k) for k, e in enumerate(counted)]
    elif reason == "wrong_object":
        sighted = [e for e in looks if e.picture("sighting")][-2:]
        shown = [Shown(e.picture("sighting") or "", f"claimed: {_first(e.message)}", -k) for k, e in enumerate(sighted)]
    elif reason == "missed_object":
        plain = [e for e in looks if in_plain_view(task, e.data.pose)]
        shown = [one for look in (plain or looks)[-1:] for one in _views(look, _bearing_deg(task, look))]
    else:
        choices = [e for e in events if isinstance(e, DirectionEvent) and e.pictures][-1:]
        shown = [one for look in looks[-1:] for one in _views(look, FACADE_SIDE_DEG)]
        shown += [Shown(e.pictures[0], _first(e.message)) for e in choices]
    if not shown:
        last = [e for e in events if e.pictures][-1:]
        shown = [Shown(name, _first(e.message), k) for e in last for k, name in enumerate(e.pictures[:5])]
    return [one for one in shown if PICTURE_NAME.fullmatch(one.name)]


def _views(look: LookEvent, towards_deg: float) -> list[Shown]:
    """A look's views, the one nearest to that bearing first in rank."""
    found = ((look.picture(view.picture), view.camera) for view in look.data.views)
    return [
        Shown(name, _where(camera), 1 + round(abs(math.remainder(camera.heading_deg - towards_deg, 360.0))))
        for name, camera in found
        if name is not None
    ]


def _bearing_deg(task: Task, look: LookEvent) -> float:
    """The window's bearing from a look, positive to the right of the nose."""
    pose = look.data.pose
    return math.degrees(pose.yaw - math.atan2(task.target.y - pose.y, task.target.x - pose.x))


def _where(camera: Camera) -> str:
    """Where it looks, for people."""
    degrees, pitch = round(camera.heading_deg), round(camera.pitch_deg)
    side = "ahead" if degrees == 0 else f"{abs(degrees)}° {'right' if degrees > 0 else 'left'}"
    return side if pitch == 0 else f"{side}, {abs(pitch)}° {'up' if pitch > 0 else 'down'}"


def _first(message: str, most: int = 90) -> str:
    return message if len(message) <= most else message[: most - 1].rstrip() + "…"
