"""Upright rectangles inside the buildings through which nobody sees: what lies behind one need not be drawn."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from shapely import geometry as shape

from contracts.scene import Building, Scene
from contracts.scene_layout import floor_outline

_INSET_M = 0.7
"""Deeper than any window is set back in its wall."""
_SHORTEST_M = 2.0


def occluders(scene: Scene) -> NDArray[np.float64]:
    """(K, 5): x, y of one end, x, y of the other, the top; metres. They stand on the ground."""
    found = [row for building in scene.buildings for row in _of(building)]
    return np.array(found, np.float64).reshape(-1, 5)


def _of(building: Building) -> list[tuple[float, float, float, float, float]]:
    """Along the walls and across, as far as it stays inside of every floor."""
    top = building.floors * building.floor_height_m
    core = shape.Polygon(floor_outline(building, building.floors)).buffer(-_INSET_M, join_style="mitre")
    pieces = [core] if isinstance(core, shape.Polygon) else list(core.geoms)
    rows = []
    for piece in pieces:
        if piece.is_empty:
            continue
        grown = piece.buffer(1e-6)
        corners = list(piece.exterior.coords)[:-1]
        for a, b in combinations(corners, 2):
            line = shape.LineString((a, b))
            if line.length >= _SHORTEST_M and grown.covers(line):
                rows.append((a[0], a[1], b[0], b[1], top))
    return rows
