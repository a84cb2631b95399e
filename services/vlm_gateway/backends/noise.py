"""Faults for the oracle, on purpose: what a model may get wrong, in the measure that a researcher asks for.

Every fault follows from the settings' seed, the scene, the number of the move and the question, and from nothing that
happened before: two policies that stand in the same scene after as many moves meet the same faults.
"""

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contracts.geometry import Box
from contracts.sim import Truth, TruthView, VisibleObject
from contracts.vlm_gateway import Match, Role
from services.vlm_gateway.model_configs import OracleNoise

_SMALLEST = 1e-3
_FALSE_CONFIDENCE = (0.4, 1.0)


class Count(NamedTuple):
    """Floors, and the rows they stand for, topmost first."""

    floors: int
    rows: tuple[float, ...]


class Faults:
    """The faults of one question at one stop."""

    def __init__(self, noise: OracleNoise, truth: Truth, role: Role, about: str) -> None:
        """`about`: what tells this question's faults from others of the role: the view's direction, or its name."""
        self._noise = noise
        key = f"{truth.scene}/{truth.moves}/{role}/{about}"
        rng = np.random.default_rng((noise.seed, zlib.crc32(key.encode())))
        # drawn always and in one order, so that one rate does not move the faults of another
        self._refusal, self._miss, self._false, self._count = (float(v) for v in rng.random(4))
        self._up = bool(rng.random() < 0.5)
        self._rng = rng

    @property
    def refuses(self) -> bool:
        return self._refusal < self._noise.refusal_rate

    @property
    def misses(self) -> bool:
        return self._miss < self._noise.miss_rate

    @property
    def claims_falsely(self) -> bool:
        return self._false < self._noise.false_claim_rate

    def miscounted(self, count: Count) -> Count:
        """One too many or too few, where the count is wrong; the rows go along."""
        if self._count >= self._noise.floor_miscount_rate:
            return count
        if self._up or not count.rows:
            extra = (count.rows[0] if count.rows else 1.0) / 2
            return Count(count.floors + 1, (extra, *count.rows))
        return Count(count.floors - 1, count.rows[1:])

    def jittered(self, box: Box) -> Box:
        """Every edge off by a normal share of the box's size."""
        if self._noise.box_jitter == 0.0:
            return box
        off = self._rng.normal(0.0, self._noise.box_jitter, 4)
        width, height = box.x_max - box.x_min, box.y_max - box.y_min
        x_min, x_max = _ordered(box.x_min + off[0] * width, box.x_max + off[1] * width)
        y_min, y_max = _ordered(box.y_min + off[2] * height, box.y_max + off[3] * height)
        return Box(x_min=x_min, y_min=y_min, x_max=x_max, y_max=y_max)

    def false_match(self, views: Sequence[TruthView]) -> Match | None:
        """Something else that is in sight, taken for the object; a piece of wall where nothing else is."""
        others = [(view, thing) for view in views for thing in view.objects if not thing.goal and _shows(thing)]
        low, high = _FALSE_CONFIDENCE
        confidence = float(self._rng.uniform(low, high))
        if others:
            view, thing = others[int(self._rng.integers(len(others)))]
            return Match(camera=view.camera, box=thing.box, confidence=confidence)
        walls = [(view, view.building_box) for view in views if view.building_box is not None]
        if not walls:
            return None
        view, wall = walls[int(self._rng.integers(len(walls)))]
        u, v = (float(x) for x in self._rng.uniform(0.1, 0.8, 2))
        width, height = wall.x_max - wall.x_min, wall.y_max - wall.y_min
        x_min, x_max = _ordered(wall.x_min + u * width, wall.x_min + (u + 0.1) * width)
        y_min, y_max = _ordered(wall.y_min + v * height, wall.y_min + (v + 0.1) * height)
        box = Box(x_min=x_min, y_min=y_min, x_max=x_max, y_max=y_max)
        return Match(camera=view.camera, box=box, confidence=confidence)


def _shows(thing: VisibleObject) -> bool:
    return thing.pixels >= 30


def _ordered(low: float, high: float) -> tuple[float, float]:
    """Two edges inside the picture, apart, the lower one first."""
    a, b = sorted((float(low), float(high)))
    a = min(max(a, 0.0), 1.0 - _SMALLEST)
    return a, min(1.0, max(b, a + _SMALLEST))
