"""Which pictures of a failure tell most, small enough to carry them all in one page."""

import base64
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2

from contracts.geometry import Pose
from contracts.orchestrator import Event
from orchestrator.record import PICTURE_NAME
from vld.metrics.taxonomy import in_plain_view
from vld.records import Reason, Task

JPEG_QUALITY = 74
WIDEST_PX, NARROWEST_PX = 400, 160
_BYTES_AT_WIDEST, _GROWTH = 22_000, 1.7
"""What a street's picture takes in the page at its widest, and how that grows with the width: measured."""
DEFAULT_BYTES = 24_000_000
_VIEW = re.compile(r"\d{4}_view([+-]\d+)?\.jpg")


class Shown(NamedTuple):
    """A picture's file name in the record, and what it shows."""

    name: str
    caption: str


class Picture(NamedTuple):
    """A picture ready for the page: a `data:` address."""

    source: str
    caption: str


@dataclass
class Album:
    """Downscales pictures until `limit_bytes` are used up; `left_out` counts those that found no room."""

    edge_px: int
    limit_bytes: int = DEFAULT_BYTES
    used_bytes: int = 0
    left_out: int = 0

    def picture(self, path: Path, caption: str) -> Picture | None:
        """Null where the file is gone, is no picture, or the page is full."""
        image = cv2.imread(str(path))
        if image is None:
            return None
        height, width = image.shape[:2]
        scale = min(1.0, self.edge_px / max(height, width))
        small = cv2.resize(
            image, (max(1, round(width * scale)), max(1, round(height * scale))), interpolation=cv2.INTER_AREA
        )
        done, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        coded = base64.b64encode(jpeg.tobytes()).decode("ascii") if done else ""
        if not coded or self.used_bytes + len(coded) > self.limit_bytes:
            self.left_out += 1
            return None
        self.used_bytes += len(coded)
        return Picture(f"data:image/jpeg;base64,{coded}", caption)


def edge_for(pictures: int, limit_bytes: int = DEFAULT_BYTES) -> int:
    """How wide each of so many pictures may be, so that all of them find room."""
    share = limit_bytes / max(1, pictures) / _BYTES_AT_WIDEST
    return max(NARROWEST_PX, min(WIDEST_PX, round(WIDEST_PX * math.pow(share, 1 / _GROWTH))))


def evidence(task: Task, reason: Reason, events: Sequence[Event]) -> list[Shown]:
    """The pictures that show why: the floors as counted, the thing that was claimed, the look in which the window was
    in plain view, or the last look and choice; without any of these the last pictures there are."""
    looks = [e for e in events if e.kind == "look" and e.pictures]
    if reason == "floor":
        counted = [e for e in events if e.kind == "floor_count" and e.pictures][-4:]
        shown = [Shown(e.pictures[0], _first(e.message)) for e in counted]
    elif reason == "wrong_object":
        sighted = [e for e in looks if _named(e, "sighting")][-2:]
        shown = [Shown(_named(e, "sighting") or "", f"claimed: {_first(e.message)}") for e in sighted]
    elif reason == "missed_object":
        plain = [e for e in looks if in_plain_view(task, Pose.model_validate(e.data["pose"]))]
        shown = _views((plain or looks)[-1:])
    else:
        choices = [e for e in events if e.kind == "direction" and e.pictures][-1:]
        shown = _views(looks[-1:]) + [Shown(e.pictures[0], _first(e.message)) for e in choices]
    if not shown:
        last = [e for e in events if e.pictures][-1:]
        shown = [Shown(name, _first(e.message)) for e in last for name in e.pictures[:5]]
    return [one for one in shown if PICTURE_NAME.fullmatch(one.name)]


def _views(looks: Sequence[Event]) -> list[Shown]:
    return [
        Shown(name, _towards(found.group(1)))
        for event in looks
        for name in event.pictures
        if (found := _VIEW.fullmatch(name))
    ]


def _named(event: Event, short: str) -> str | None:
    return next((name for name in event.pictures if name.endswith(f"_{short}.jpg")), None)


def _towards(heading: str | None) -> str:
    degrees = int(heading or 0)
    return "ahead" if degrees == 0 else f"{abs(degrees)}° {'right' if degrees > 0 else 'left'}"


def _first(message: str, most: int = 90) -> str:
    return message if len(message) <= most else message[: most - 1].rstrip() + "…"
