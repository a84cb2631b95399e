"""One window, and one balcony: templates in a wall's own axes (x out of the wall, y along it, z up).

A window's origin is the middle of its opening in the wall's plane, a balcony's the middle of its floor at the wall.
"""

from functools import lru_cache
from math import cos, pi, sin

import numpy as np

from contracts.scene import BalconyPlan, FacadeStyle, WindowGrid
from services.sim.geometry.mesh import Mesh, concatenate, make, mixed
from services.sim.geometry.solids import box, quad
from services.sim.geometry.tubes import rod

SLAB_M = 0.16
FRAME_M = 0.07
RAIL_M = 1.0


def bar(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], colour: str, layer: int = 0) -> Mesh:
    """A box by its extents, without its back."""
    size = (x[1] - x[0], y[1] - y[0], z[1] - z[0])
    middle = ((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, (z[0] + z[1]) / 2)
    return box(size, middle, colour, layer, without=("-x",))


@lru_cache(maxsize=256)
def window(grid: WindowGrid, style: FacadeStyle, wall_layer: int, dress: str, door_drop_m: float = 0.0) -> Mesh:
    """Everything of a window but its pane: reveals, frame, mullions, ledge and, as `dress` says (plain, surround,
    lintel, shutters), what surrounds it. `door_drop_m` > 0 lets it down to a balcony's floor: no ledge then."""
    w, r = grid.width_m / 2, grid.reveal_m
    top, low = grid.height_m / 2, -grid.height_m / 2 - door_drop_m
    wall, frame, trim = style.wall_colour, style.frame_colour, style.trim_colour
    parts = _reveals(w, low, top, r, wall, wall_layer)
    f = FRAME_M
    front = (-r, -r + 0.06)
    parts += [
        bar(front, (-w, -w + f), (low, top), frame),
        bar(front, (w - f, w), (low, top), frame),
        bar(front, (-w + f, w - f), (top - f, top), frame),
        bar(front, (-w + f, w - f), (low, low + f), frame),
    ]
    slim = (-r, -r + 0.045)
    if grid.shape != "lattice":
        parts.append(bar(slim, (-0.03, 0.03), (low + f, top - f), frame))
    if grid.shape == "french":
        for z in (low + (top - low) * k / 3 for k in (1, 2)):
            parts.append(bar(slim, (-w + f, w - f), (z - 0.02, z + 0.02), frame))
    elif grid.shape != "lattice" and grid.height_m >= 1.3:
        z = top - 0.32 * grid.height_m
        parts.append(bar(slim, (-w + f, w - f), (z - 0.025, z + 0.025), frame))
    if grid.shape == "arched":
        parts += _arch(w, top, wall, wall_layer)
    if door_drop_m == 0.0:
        side = min(0.1, (grid.pitch_m - grid.width_m) / 2 - 0.05)
        parts.append(bar((0.0, grid.ledge_m), (-w - side, w + side), (low - 0.07, low), trim))
        if dress in ("surround", "lintel", "shutters"):
            parts += [
                bar((0.0, grid.ledge_m * 0.6), (y - 0.05, y + 0.05), (low - 0.22, low - 0.07), trim) for y in (-w, w)
            ]
    if dress == "surround":
        b = 0.11
        parts += [
            bar((0.0, 0.045), (-w - b, -w), (low, top), trim),
            bar((0.0, 0.045), (w, w + b), (low, top), trim),
            bar((0.0, 0.06), (-w - b, w + b), (top, top + 0.14), trim),
            bar((0.0, 0.11), (-w - b - 0.05, w + b + 0.05), (top + 0.14, top + 0.20), trim),
        ]
    elif dress == "lintel":
        parts.append(bar((0.0, 0.04), (-w - 0.16, w + 0.16), (top, top + 0.24), trim))
        parts.append(bar((0.0, 0.075), (-0.11, 0.11), (top - 0.02, top + 0.30), trim))
    elif dress == "shutters":
        s = min(w, (grid.pitch_m - grid.width_m) / 2 - 0.04)
        for y in ((-w - s, -w - 0.02), (w + 0.02, w + s)):
            parts.append(bar((0.0, 0.05), y, (low, top), style.accent_colour))
            n = 6
            for k in range(n):
                z = low + (top - low) * (k + 0.5) / n
                parts.append(bar((0.05, 0.065), (y[0] + 0.05, y[1] - 0.05), (z - 0.07, z + 0.07), style.accent_colour))
    elif dress == "timber":
        b = 0.13
        dark = style.frame_colour
        parts += [
            bar((0.0, 0.07), (-w - b, -w), (low - 0.1, top + 0.1), dark),
            bar((0.0, 0.07), (w, w + b), (low - 0.1, top + 0.1), dark),
            bar((0.0, 0.09), (-w - 0.25, w + 0.25), (top, top + 0.14), dark),
        ]
    return concatenate(parts)


def pane(grid: WindowGrid, door_drop_m: float = 0.0) -> Mesh:
    """The glass, uv 0..1, to be given a layer."""
    w, x = grid.width_m / 2 - FRAME_M + 0.005, -grid.reveal_m + 0.004
    top, low = grid.height_m / 2, -grid.height_m / 2 - door_drop_m
    return quad([(x, -w, low), (x, w, low), (x, w, top), (x, -w, top)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)])


def _reveals(w: float, low: float, top: float, r: float, wall: str, layer: int) -> list[Mesh]:
    """The wall's thickness round the opening; what lies above is the darkest."""
    return [
        quad([(-r, -w, low), (-r, -w, top), (0, -w, top), (0, -w, low)], wall, layer).shaded(0.80),
        quad([(0, w, low), (0, w, top), (-r, w, top), (-r, w, low)], wall, layer).shaded(0.80),
        quad([(0, -w, top), (-r, -w, top), (-r, w, top), (0, w, top)], wall, layer).shaded(0.62),
        quad([(-r, -w, low), (0, -w, low), (0, w, low), (-r, w, low)], wall, layer).shaded(0.92),
    ]


def _arch(w: float, top: float, wall: str, layer: int) -> list[Mesh]:
    """Fills the opening's upper corners, so that a half-round arch remains."""
    rise, n = min(w, 0.7), 5
    parts = []
    for side in (-1.0, 1.0):
        rim = [(side * w * cos(a), top - rise + rise * sin(a)) for a in (k / n * pi / 2 for k in range(n + 1))]
        p = np.array([(0.0, side * w, top)] + [(0.0, y, z) for y, z in rim])
        fan = [(0, k + 1, k) if side > 0 else (0, k, k + 1) for k in range(1, n + 1)]
        uv = p[:, 1:3]
        parts.append(make(p, fan, np.tile((1, 0, 0), (len(p), 1)), uv, wall, layer))
    return parts


def balcony_width_m(grid: WindowGrid) -> float:
    return min(grid.width_m + 1.1, grid.pitch_m - 0.1)


@lru_cache(maxsize=256)
def balcony(plan: BalconyPlan, grid: WindowGrid, style: FacadeStyle, metal: str) -> Mesh:
    """Slab and railing."""
    w, d = balcony_width_m(grid) / 2, plan.depth_m
    slab = box((d, 2 * w, SLAB_M), (d / 2, 0, -SLAB_M / 2), style.trim_colour, without=("-x",))
    parts = [slab]
    sides: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = (
        ((d - 0.05, -w + 0.05), (d - 0.05, w - 0.05)),
        ((0.02, -w + 0.05), (d - 0.05, -w + 0.05)),
        ((0.02, w - 0.05), (d - 0.05, w - 0.05)),
    )
    for (x0, y0), (x1, y1) in sides:
        length = float(np.hypot(x1 - x0, y1 - y0))
        cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
        across = (length + 0.05, 0.05) if y0 == y1 else (0.05, length + 0.05)
        if plan.railing == "solid":
            parts.append(box((*across, RAIL_M - 0.08), (cx, cy, (RAIL_M - 0.08) / 2), style.wall_colour))
            parts.append(box((across[0] + 0.06, across[1] + 0.06, 0.08), (cx, cy, RAIL_M - 0.04), style.trim_colour))
            continue
        parts.append(box((*across, 0.05), (cx, cy, RAIL_M), metal))
        parts.append(box((across[0] - 0.02, across[1] - 0.02, 0.03), (cx, cy, 0.10), metal))
        if plan.railing == "bars":
            n = max(1, round(length / 0.13))
            for k in range(n + 1):
                x, y = x0 + (x1 - x0) * k / n, y0 + (y1 - y0) * k / n
                size = 0.045 if k in (0, n) else 0.026
                parts.append(box((size, size, RAIL_M), (x, y, RAIL_M / 2), metal, without=("-z", "+z")))
        else:
            parts += _glass_rail(x0, y0, x1, y1, length, metal)
    return concatenate(parts)


def _glass_rail(x0: float, y0: float, x1: float, y1: float, length: float, metal: str) -> list[Mesh]:
    """Clear glass shows as its posts, its edges and a few slanting gleams: what stands behind it stays visible."""
    n = max(1, round(length / 1.0))
    parts = []
    for k in range(n + 1):
        x, y = x0 + (x1 - x0) * k / n, y0 + (y1 - y0) * k / n
        parts.append(box((0.05, 0.05, RAIL_M), (x, y, RAIL_M / 2), metal, without=("-z", "+z")))
    gleam = mixed(metal, "#e6f2f6", 0.85)
    for k in range(n):
        for at, lean in ((0.22, 0.22), (0.34, 0.22)):
            a, b = (k + at) / n, (k + at + lean) / n
            start = (x0 + (x1 - x0) * a, y0 + (y1 - y0) * a, 0.2)
            end = (x0 + (x1 - x0) * b, y0 + (y1 - y0) * b, RAIL_M - 0.1)
            parts.append(rod(start, end, 0.010, 3).recoloured(gleam))
    return parts


@lru_cache(maxsize=256)
def balcony_solid(plan: BalconyPlan, grid: WindowGrid) -> tuple[Mesh, ...]:
    """What of a balcony can be bumped into: its slab and its railing as plates."""
    w, d = balcony_width_m(grid) / 2, plan.depth_m
    return (
        box((d, 2 * w, SLAB_M), (d / 2, 0, -SLAB_M / 2)),
        box((0.06, 2 * w - 0.08, RAIL_M), (d - 0.05, 0, RAIL_M / 2)),
        box((d, 0.06, RAIL_M), (d / 2, -w + 0.05, RAIL_M / 2)),
        box((d, 0.06, RAIL_M), (d / 2, w - 0.05, RAIL_M / 2)),
    )
