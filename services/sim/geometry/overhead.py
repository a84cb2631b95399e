"""Poles, and the wires that hang from them or from walls: what is drawn, and what one bumps into."""

from math import ceil, hypot

import numpy as np
from numpy.typing import NDArray

from contracts.scene_street import OverheadWire, Pole
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.solids import cylinder, frustum
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.tubes import tube

_BLACK = "#1c1d1f"
_PIECE_M = 2.0
_FEWEST, _MOST = 6, 40


def pole(plan: Pole, textures: TextureSet) -> Mesh:
    """Tapered, with a cap."""
    foot, h = (plan.position.x, plan.position.y, 0.0), plan.height_m
    if plan.kind == "steel":
        shaft = frustum(0.10, 0.06, h, foot, 10, "#7d8286", textures.layer("metal"))
        return concatenate([cylinder(0.16, 0.35, foot, 10, "#5f6468"), shaft])
    shaft = frustum(0.15, 0.10, h, foot, 10, "#6e5a45", textures.layer("timber"))
    return concatenate([shaft, frustum(0.13, 0.02, 0.10, (foot[0], foot[1], h), 10, "#4b4f52")])


def pole_solid(plan: Pole) -> Mesh:
    """A plain cylinder, as thick as the pole at its foot."""
    return cylinder(0.15, plan.height_m, (plan.position.x, plan.position.y, 0.0), 8)


def wire(plan: OverheadWire) -> Mesh:
    """Round enough for what is mostly a pixel."""
    return tube(_hanging(plan), plan.diameter_m / 2, 6, _BLACK)


def wire_solid(plan: OverheadWire) -> Mesh:
    """Square rods end to end, about as thick."""
    return tube(_hanging(plan), plan.diameter_m / 2, 4)


def _hanging(plan: OverheadWire) -> NDArray[np.float64]:
    """(K, 3) along the wire."""
    span_m = hypot(plan.end.x - plan.start.x, plan.end.y - plan.start.y)
    pieces = min(max(ceil(span_m / _PIECE_M), _FEWEST), _MOST)
    share = np.linspace(0.0, 1.0, pieces + 1)
    start, end = (np.array([p.x, p.y, p.z]) for p in (plan.start, plan.end))
    path = start + np.outer(share, end - start)
    path[:, 2] = [plan.height_m(float(s)) for s in share]
    return path
