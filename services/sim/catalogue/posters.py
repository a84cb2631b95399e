"""Posters: a drawn picture on a sheet of the named colour, for a wall or a pane.

A class's pictures share one texture layer, side by side, because the renderer's layers are square and few.
"""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from services.sim.catalogue import pictures
from services.sim.catalogue.palette import Paint
from services.sim.catalogue.registry import MOUNTED, Shape, catalogued
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import box, quad

WIDTH_M, HEIGHT_M = 0.9, 1.2
THICKNESS_M = 0.03
_COLUMNS, _ROWS = 3, 2
_CELL = (256, 170)
_GUARD = 3
"""Pixels round a picture that repeat its edge, so that mip levels don't mix it with its neighbour."""

_POSTERS: tuple[tuple[str, Callable[[pictures.Sheet], None], tuple[str, ...], tuple[str, ...]], ...] = (
    (
        "cat",
        pictures.cat,
        ("poster of a cat", "picture of a cat", "cat picture", "cat painting", "cat print"),
        ("yellow", "red", "blue", "green", "pink", "white"),
    ),
    (
        "tree",
        pictures.tree,
        ("poster of a tree", "picture of a tree", "tree picture", "tree painting", "tree print"),
        ("yellow", "blue", "orange", "white", "pink", "purple"),
    ),
    (
        "sailing boat",
        pictures.sailing_boat,
        (
            "poster of a sailing boat",
            "sailboat poster",
            "poster of a sailboat",
            "picture of a sailing boat",
            "picture of a sailboat",
            "boat poster",
            "ship poster",
        ),
        ("blue", "red", "orange", "green", "yellow", "purple"),
    ),
    (
        "guitar",
        pictures.guitar,
        ("poster of a guitar", "picture of a guitar", "guitar picture", "guitar print"),
        ("red", "green", "blue", "purple", "black", "yellow"),
    ),
    (
        "mountain",
        pictures.mountain,
        (
            "poster of a mountain",
            "mountains poster",
            "poster of mountains",
            "picture of a mountain",
            "picture of mountains",
            "mountain picture",
        ),
        ("blue", "orange", "yellow", "pink", "green", "purple"),
    ),
    (
        "heart",
        pictures.heart,
        ("poster of a heart", "poster with a heart", "picture of a heart", "heart picture"),
        ("white", "yellow", "blue", "green", "black", "purple"),
    ),
    (
        "rocket",
        pictures.rocket,
        ("poster of a rocket", "picture of a rocket", "rocket picture", "spaceship poster", "space rocket poster"),
        ("blue", "purple", "black", "orange", "green", "pink"),
    ),
)


@cache
def poster_layers() -> tuple[tuple[str, NDArray[np.uint8]], ...]:
    """The pictures the renderer's texture array must have: (name, (512, 510, 3) uint8 sRGB), one per class."""
    return tuple((_layer(kind), _sheet(draw, colours)) for kind, draw, _, colours in _POSTERS)


def _layer(subject: str) -> str:
    return f"poster {subject}"


def _sheet(draw: Callable[[pictures.Sheet], None], colours: tuple[str, ...]) -> NDArray[np.uint8]:
    height, width = _CELL
    sheet = np.zeros((height * _ROWS, width * _COLUMNS, 3), np.uint8)
    for i, colour in enumerate(colours):
        row, column = divmod(i, _COLUMNS)
        inner = cv2.resize(
            pictures.drawn(draw, colour), (width - 2 * _GUARD, height - 2 * _GUARD), interpolation=cv2.INTER_AREA
        )
        cell = cv2.copyMakeBorder(inner, _GUARD, _GUARD, _GUARD, _GUARD, cv2.BORDER_REPLICATE)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = cell
    return sheet


def _poster(subject: str, colours: tuple[str, ...]) -> Shape:
    def shape(paint: Paint) -> Mesh:
        row, column = divmod(colours.index(paint.colour), _COLUMNS)
        height, width = _CELL
        gu, gv = _GUARD / (width * _COLUMNS), _GUARD / (height * _ROWS)
        u0, u1 = column / _COLUMNS + gu, (column + 1) / _COLUMNS - gu
        v0, v1 = 1 - (row + 1) / _ROWS + gv, 1 - row / _ROWS - gv
        board = box((THICKNESS_M, WIDTH_M, HEIGHT_M), colour="#efece4", without=("+x",))
        x, w, h = THICKNESS_M / 2, WIDTH_M / 2, HEIGHT_M / 2
        corners = [(x, -w, -h), (x, w, -h), (x, w, h), (x, -w, h)]
        uv = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
        return concatenate([board, quad(corners, "#ffffff", paint.textures.layer(_layer(subject)), uv)])

    shape.__name__ = f"{subject.replace(' ', '_')}_poster"
    return shape


for _subject, _draw, _synonyms, _colours in _POSTERS:
    catalogued(
        "posters",
        f"{_subject} poster",
        *_synonyms,
        colours=_colours,
        places=MOUNTED,
        size_m=(THICKNESS_M, WIDTH_M, HEIGHT_M),
    )(_poster(_subject, _colours))
