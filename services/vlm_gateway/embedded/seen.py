"""What the embedded model is given, and what it says it saw."""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.geometry import Box, PointLabel

Picture = NDArray[np.uint8]
"""(H, W, 3) RGB."""


class Shot(Protocol):
    """One picture. `key` is the same for the same picture and for no other; pixels are decoded when they are needed.
    `focal_px`: of the camera that took it, None where that is not known."""

    @property
    def key(self) -> Hashable: ...

    @property
    def focal_px(self) -> float | None: ...

    def rgb(self) -> Picture: ...


@dataclass(frozen=True, eq=False)
class Still:
    """Pixels that are at hand already; a picture of its own, whatever it shows."""

    pixels: Picture
    focal_px: float | None = None

    @property
    def key(self) -> Hashable:
        return self

    def rgb(self) -> Picture:
        return self.pixels


@dataclass(frozen=True)
class FloorsSeen:
    """`rows`: the middles of the window rows, 0..1 from the top, topmost first."""

    count: int
    rows: tuple[float, ...]


class BoxSeen(NamedTuple):
    box: Box
    confidence: float


class Sighting(NamedTuple):
    """`view_index` counts the views that were handed in from 0; `confidence` is calibrated: of sightings with 0.8, four
    in five are right."""

    view_index: int
    box: Box
    confidence: float


class Found(NamedTuple):
    """Sightings, the most confident first. From `claim` on a sighting may be claimed; what is less sure is worth
    another look from nearer."""

    sightings: tuple[Sighting, ...]
    claim: float


class MarkedPlace(Protocol):
    """A marked point: at (x, y) of the picture's width and height, with the metres one may fly towards it."""

    @property
    def label(self) -> PointLabel: ...
    @property
    def x(self) -> float: ...
    @property
    def distance_m(self) -> float: ...
