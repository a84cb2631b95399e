"""Words as flat shapes: the letters' outlines, of any script that `service_kit.lettering` writes."""

from functools import lru_cache

import cv2
import numpy as np

from service_kit.lettering import BOLD, draw_text, text_width
from services.sim.geometry.mesh import Colour, Mesh, concatenate, empty, make
from services.sim.geometry.solids import triangulated

_SIZE_PX = 96
_SMOOTH_PX = 0.9
_LEAST_PX2 = 8.0


def letters(text: str, width_m: float, height_m: float, colour: Colour) -> Mesh:
    """One line that faces +x about the origin, as large as fits into so much."""
    shape = _shape(text)
    if not shape.triangle_count:
        return shape
    low, high = shape.bounds
    scale = min(width_m / float(high[1] - low[1]), height_m / float(high[2] - low[2]))
    middle = (low + high) / 2 * scale
    return shape.transformed(scale=scale, move=(0.0, -float(middle[1]), -float(middle[2]))).recoloured(colour)


@lru_cache(maxsize=64)
def _shape(text: str) -> Mesh:
    """In pixels of the font: y to the right, z up."""
    width = text_width(text, _SIZE_PX, weight=BOLD) + 2 * _SIZE_PX
    canvas = np.zeros((3 * _SIZE_PX, width, 3), np.uint8)
    draw_text(canvas, text, (_SIZE_PX, 2 * _SIZE_PX), _SIZE_PX, (255, 255, 255), weight=BOLD)
    found, nesting = cv2.findContours((canvas[..., 0] > 127).astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outlines = [cv2.approxPolyDP(ring, _SMOOTH_PX, True).reshape(-1, 2).astype(np.float64) for ring in found]
    parts = []
    for number, ring in enumerate(outlines):
        if nesting[0][number][3] >= 0 or len(ring) < 3 or cv2.contourArea(found[number]) < _LEAST_PX2:
            continue
        holes = [hole for k, hole in enumerate(outlines) if nesting[0][k][3] == number and len(hole) >= 3]
        p = np.concatenate([ring, *holes])
        p = np.column_stack([np.zeros(len(p)), p[:, 0], -p[:, 1]])
        faces = triangulated(ring * (1, -1), [hole * (1, -1) for hole in holes])
        parts.append(make(p, faces, np.tile((1, 0, 0), (len(p), 1)), np.zeros((len(p), 2))))
    return concatenate(parts) if parts else empty()
