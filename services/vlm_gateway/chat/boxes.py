"""Boxes as model families write them, translated to named fields in 0..1. The paper's own order (xmin, xmax, ymin,
ymax) is used by none of them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from contracts.geometry import Box
from services.vlm_gateway.presets import BoxOrder, BoxStyle

OVERSHOOT = 0.02
"""How far outside the picture an edge may lie, as a share of its side, before the box counts as unreadable."""
SMALLEST = 0.001


class BadBox(ValueError):
    """Numbers that are no box under the family's convention; the message says why."""


class Size(NamedTuple):
    width: int
    height: int


def smart_resize(size: Size, factor: int, min_pixels: int, max_pixels: int) -> Size:
    """The size that the Qwen-VL processors give a picture: both sides multiples of `factor`, the area within bounds,
    the aspect ratio kept as well as that allows."""
    height = max(factor, round(size.height / factor) * factor)
    width = max(factor, round(size.width / factor) * factor)
    if height * width > max_pixels:
        shrink = math.sqrt(size.height * size.width / max_pixels)
        height = max(factor, math.floor(size.height / shrink / factor) * factor)
        width = max(factor, math.floor(size.width / shrink / factor) * factor)
    elif height * width < min_pixels:
        grow = math.sqrt(min_pixels / (size.height * size.width))
        height = math.ceil(size.height * grow / factor) * factor
        width = math.ceil(size.width * grow / factor) * factor
    return Size(width, height)


def scale(style: BoxStyle, sent: Size, factor: int, min_pixels: int, max_pixels: int) -> tuple[float, float]:
    """What 1.0 of the width and of the height are in the convention's numbers."""
    if style == "unit":
        return 1.0, 1.0
    if style == "thousand":
        return 1000.0, 1000.0
    size = sent if style == "pixels" else smart_resize(sent, factor, min_pixels, max_pixels)
    return float(size.width), float(size.height)


def to_unit(numbers: Sequence[float], order: BoxOrder, full: tuple[float, float]) -> Box:
    """`numbers`: four, as the model wrote them; `full`: from `scale`. Edges slightly outside are moved to the
    picture's edge. Raises BadBox."""
    if len(numbers) != 4 or not all(math.isfinite(number) for number in numbers):
        raise BadBox("a box needs four finite numbers")
    first, second, third, fourth = numbers
    if order == "yxyx":
        x0, y0, x1, y1 = second, first, fourth, third
    elif order == "xywh":
        x0, y0, x1, y1 = first, second, first + third, second + fourth
    else:
        x0, y0, x1, y1 = first, second, third, fourth
    x0, x1, y0, y1 = x0 / full[0], x1 / full[0], y0 / full[1], y1 / full[1]
    if min(x0, y0) < -OVERSHOOT or max(x1, y1) > 1 + OVERSHOOT:
        raise BadBox(f"the box reaches outside the picture, whose far corner is {full[0]:g}, {full[1]:g}")
    x0, y0, x1, y1 = (min(1.0, max(0.0, edge)) for edge in (x0, y0, x1, y1))
    if x1 - x0 < SMALLEST or y1 - y0 < SMALLEST:
        raise BadBox("the box has no area: the smaller corner comes first, in the stated scale")
    return Box(x_min=x0, y_min=y0, x_max=x1, y_max=y1)


_NAMES: dict[BoxOrder, str] = {
    "xyxy": "[x_min, y_min, x_max, y_max]",
    "yxyx": "[y_min, x_min, y_max, x_max]",
    "xywh": "[x_min, y_min, width, height]",
}


def numbers_by_name(order: BoxOrder) -> str:
    """The four numbers by name."""
    return _NAMES[order]


def in_words(style: BoxStyle, order: BoxOrder, full: tuple[float, float]) -> str:
    """The convention as the prompt states it."""
    numbers = numbers_by_name(order)
    if style == "unit":
        return f"{numbers}, each from 0.0 (left or top) to 1.0 (right or bottom)"
    if style == "thousand":
        sides = "height or width" if order == "yxyx" else "width or height"
        return f"{numbers}, each an integer from 0 to 1000 (thousandths of the {sides})"
    return f"{numbers} in pixels of the picture, which is {full[0]:g} wide and {full[1]:g} high"
