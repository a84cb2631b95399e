"""Pictures of coloured shapes at known boxes."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 716, 434
"""Chosen so that the conventions differ measurably: no side near 1000, and the sizes to which processors with patches
of 28 and 32 pixels resize it (728 x 448 and 704 x 448) are 2 to 3 % from it and from each other."""

COLOURS: dict[str, tuple[int, int, int]] = {
    "red": (220, 20, 30),
    "green": (20, 150, 40),
    "blue": (20, 60, 220),
    "yellow": (245, 215, 20),
    "black": (10, 10, 10),
    "purple": (140, 30, 160),
}
KINDS = ("rectangle", "ellipse", "diamond")
_BACKGROUND = (250, 250, 247)
_COLUMNS, _ROWS = 3, 2


class Corners(NamedTuple):
    """A box in 0..1 of the picture's width and height."""

    x0: float
    y0: float
    x1: float
    y1: float


class Shape(NamedTuple):
    colour: str
    kind: str
    box: Corners

    @property
    def name(self) -> str:
        return f"{self.colour} {self.kind}"


class ShapePicture(NamedTuple):
    """`rgb`: (HEIGHT, WIDTH, 3) uint8."""

    rgb: NDArray[np.uint8]
    shapes: tuple[Shape, ...]


def draw(chance: np.random.Generator) -> ShapePicture:
    """Six shapes, each of its own colour, none touching another; where and how large is `chance`'s."""
    rgb = np.full((HEIGHT, WIDTH, 3), _BACKGROUND, np.uint8)
    cells = chance.permutation(_COLUMNS * _ROWS)
    cell_w, cell_h = WIDTH / _COLUMNS, HEIGHT / _ROWS
    shapes = []
    for cell, colour in zip(cells, COLOURS, strict=True):
        kind = str(chance.choice(KINDS))
        width, height = cell_w * chance.uniform(0.35, 0.85), cell_h * chance.uniform(0.35, 0.85)
        left = (cell % _COLUMNS) * cell_w + 0.05 * cell_w + chance.uniform(0.0, 0.9 * cell_w - width)
        top = (cell // _COLUMNS) * cell_h + 0.05 * cell_h + chance.uniform(0.0, 0.9 * cell_h - height)
        x0, y0, x1, y1 = (round(edge) for edge in (left, top, left + width, top + height))
        _fill(rgb, kind, COLOURS[colour], (x0, y0, x1, y1))
        shapes.append(Shape(colour, kind, Corners(x0 / WIDTH, y0 / HEIGHT, x1 / WIDTH, y1 / HEIGHT)))
    return ShapePicture(rgb, tuple(shapes))


def _fill(rgb: NDArray[np.uint8], kind: str, colour: tuple[int, int, int], box: tuple[int, int, int, int]) -> None:
    """Covers pixels x0..x1-1 and y0..y1-1."""
    x0, y0, x1, y1 = box
    right, bottom = x1 - 1, y1 - 1
    middle_x, middle_y = (x0 + right) // 2, (y0 + bottom) // 2
    if kind == "rectangle":
        cv2.rectangle(rgb, (x0, y0), (right, bottom), colour, -1)
    elif kind == "ellipse":
        centre, axes = ((x0 + right) / 2, (y0 + bottom) / 2), (right - x0, bottom - y0)
        cv2.ellipse(rgb, (centre, axes, 0.0), colour, -1)
    else:
        corners = np.array([(middle_x, y0), (right, middle_y), (middle_x, bottom), (x0, middle_y)], np.int32)
        cv2.fillConvexPoly(rgb, corners, colour)
