"""Annotations drawn into pictures: the five labelled points of eq. 7, and boxes."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box
from contracts.vlm_gateway import MarkedPoint
from service_kit.lettering import draw_text, text_width

Picture = NDArray[np.uint8]
"""(H, W, 3) uint8, RGB."""

_DISC = (225, 35, 35)
_BOX = (255, 214, 10)
_DARK = (20, 20, 20)
_WHITE = (255, 255, 255)
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def mark_points(rgb: Picture, points: Sequence[MarkedPoint]) -> Picture:
    """A copy with a lettered disc on each point and its safe distance beneath."""
    marked = rgb.copy()
    height, width = marked.shape[:2]
    unit = width / 800
    radius = max(5, round(20 * unit))
    for point in points:
        x, y = round(point.x * width), round(point.y * height)
        cv2.circle(marked, (x, y), radius + max(1, round(3 * unit)), _WHITE, -1, cv2.LINE_AA)
        cv2.circle(marked, (x, y), radius, _DISC, -1, cv2.LINE_AA)
        _text(marked, point.label, (x, y), 1.0 * unit, _WHITE, max(1, round(2.4 * unit)))
        tag = f"{point.distance_m:.1f} m"
        _text(marked, tag, (x, y + round(2.1 * radius)), 0.62 * unit, _DARK, max(2, round(5 * unit)))
        _text(marked, tag, (x, y + round(2.1 * radius)), 0.62 * unit, _WHITE, max(1, round(1.6 * unit)))
    return marked


def mark_box(rgb: Picture, box: Box, label: str = "", colour: tuple[int, int, int] = _BOX) -> Picture:
    """A copy with the box drawn round its thing, and a label above it."""
    marked = rgb.copy()
    height, width = marked.shape[:2]
    unit = width / 800
    left, top = round(box.x_min * width), round(box.y_min * height)
    right, bottom = round(box.x_max * width), round(box.y_max * height)
    for thick, ink in ((max(3, round(6 * unit)), _DARK), (max(1, round(3 * unit)), colour)):
        cv2.rectangle(marked, (left, top), (right, bottom), ink, thick, cv2.LINE_AA)
    if label:
        size = 20 * unit
        at = (max(4, min(left, width - text_width(label, size) - 4)), max(top - round(8 * unit), round(size)))
        draw_text(marked, label, at, size, colour, outline=_DARK)
    return marked


def _text(
    image: Picture, text: str, middle: tuple[int, int], scale: float, colour: tuple[int, int, int], thick: int
) -> None:
    (wide, tall), _ = cv2.getTextSize(text, _FONT, scale, thick)
    at = (middle[0] - wide // 2, middle[1] + tall // 2)
    cv2.putText(image, text, at, _FONT, scale, colour, thick, cv2.LINE_AA)
