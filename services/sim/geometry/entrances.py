"""The way into a building: where the door is, and what it looks like."""

from math import atan2
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Building
from contracts.scene_layout import columns_of, facades
from services.sim.geometry.mesh import Mesh, concatenate
from services.sim.geometry.outlines import plan_of
from services.sim.geometry.parts import Assembly, stamped, wall_frame
from services.sim.geometry.solids import box, cylinder, quad
from services.sim.geometry.textures import TextureSet

Toward = tuple[float, float]


class DoorSpot(NamedTuple):
    """Where the entrance is: the wall's axes at its foot, its width and the free wall around it, metres."""

    frame: NDArray[np.float64]
    width_m: float
    room_m: float


def door_spot(building: Building, toward: Toward) -> DoorSpot | None:
    """Between two windows of the ground floor, as near to the middle of its facade as there is room."""
    grid = building.windows
    for wall in sorted(facades(building), key=lambda w: -(w.normal[0] * toward[0] + w.normal[1] * toward[1])):
        count = columns_of(building, wall.number)
        middle = [wall.length_m / 2 + (c - (count - 1) / 2) * grid.pitch_m for c in range(count)]
        edges = [0.2, *(m + s * (grid.width_m / 2 + 0.12) for m in middle for s in (-1, 1)), wall.length_m - 0.2]
        gaps = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 1.0]
        if gaps:
            a, b = min(gaps, key=lambda g: abs((g[0] + g[1]) / 2 - wall.length_m / 2))
            t = (a + b) / 2
            origin = (wall.start[0] + wall.along[0] * t, wall.start[1] + wall.along[1] * t, 0.0)
            room = min(b - a, 3.0)
            return DoorSpot(wall_frame(wall.normal, wall.along, origin), min(1.15, room - 0.24), room)
    return None


def entrance(assembly: Assembly, part: int, building: Building, textures: TextureSet, spot: DoorSpot) -> list[Mesh]:
    """The door, its frame and its canopy, as solid as they are drawn: depth shows how near one may come."""
    door = stamped(_door(building, spot.width_m, spot.room_m, textures), [spot.frame])
    assembly.block(part, door)
    return [door]


def _door(building: Building, width: float, room: float, textures: TextureSet) -> Mesh:
    """The door in the wall's axes."""
    style = building.style
    w, h = width / 2, 2.2
    leaf = "#7a3026" if building.kind == "cultural" else style.accent_colour
    name = "door" if building.kind in ("cultural", "villa") else "door_glazed"
    front = quad(
        [(0.03, -w, 0.16), (0.03, w, 0.16), (0.03, w, h), (0.03, -w, h)],
        leaf,
        textures.layer(name),
        [(0, 0), (1, 0), (1, 1), (0, 1)],
    )
    trim = style.frame_colour if building.kind == "cultural" else style.trim_colour
    parts = [
        front,
        box((0.10, 0.13, h), (0.05, -w - 0.065, h / 2), trim, without=("-x", "-z")),
        box((0.10, 0.13, h), (0.05, w + 0.065, h / 2), trim, without=("-x", "-z")),
        box((0.12, width + 0.3, 0.18), (0.06, 0, h + 0.09), trim, without=("-x",)),
        box((0.5, width + 0.5, 0.16), (0.25, 0, 0.08), "#a8a49c", textures.layer("paving"), without=("-x", "-z")),
    ]
    lamp = box((0.14, 0.14, 0.24), (0.10, w + 0.30, 1.95), "#f4ecd0")
    if building.kind == "villa":
        r = min(room, 2.2) / 2
        roof = concatenate(
            [
                box((1.35, 2 * r + 0.3, 0.12), (0.68, 0, 2.62), style.trim_colour, without=("-x",)),
                quad(
                    [(1.45, -r - 0.2, 2.68), (1.45, r + 0.2, 2.68), (0.0, r + 0.2, 3.0), (0.0, -r - 0.2, 3.0)],
                    style.accent_colour,
                    textures.layer("roof_tile"),
                ),
            ]
        )
        posts = [cylinder(0.09, 2.6, (1.2, y, 0.0), 10, style.trim_colour) for y in (-r, r)]
        parts += [roof, *posts, box((1.45, 2 * r + 0.4, 0.14), (0.72, 0, 0.07), "#b5afa5", textures.layer("paving"))]
    elif building.kind != "cultural":
        deep = 1.4 if building.kind == "high_rise" else 0.9
        wide = min(room - 0.1, width + (1.4 if building.kind == "high_rise" else 0.5))
        canopy = box((deep, wide, 0.14), (deep / 2, 0, h + 0.38), style.trim_colour, without=("-x",))
        parts += [canopy, lamp]
    return concatenate(parts)


def toward_start(building: Building, x: float, y: float) -> Toward:
    """The direction from the building to where people come from."""
    middle = plan_of([(p.x, p.y) for p in building.footprint]).mean(axis=0)
    a = atan2(y - middle[1], x - middle[0])
    return float(np.cos(a)), float(np.sin(a))
