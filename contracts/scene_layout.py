"""Where a scene document's facades, windows and balconies lie: the meaning of `contracts.scene`, as numbers.

All positions in metres, ENU. Used by whoever builds, judges or draws a scene; plain Python, nothing measured.
"""

import math
from functools import lru_cache
from typing import NamedTuple

from contracts.scene import BalconyPlan, Building, Scene, WindowPlace


class Facade(NamedTuple):
    """One wall of one floor: from `start` along the unit vector `along` for `length_m`; `normal` points outwards."""

    number: int
    start: tuple[float, float]
    along: tuple[float, float]
    normal: tuple[float, float]
    length_m: float


class WindowSlot(NamedTuple):
    """One window: centre of its opening in the wall's plane, the outward normal, its size."""

    building: str
    facade: int
    floor: int
    column: int
    centre: tuple[float, float, float]
    along: tuple[float, float]
    normal: tuple[float, float]
    width_m: float
    height_m: float
    balcony: BalconyPlan | None

    @property
    def sill_z(self) -> float:
        return self.centre[2] - self.height_m / 2


@lru_cache(maxsize=256)
def floor_outline(building: Building, floor: int) -> tuple[tuple[float, float], ...]:
    """The walls' ground plan of one floor (1 = ground): the footprint, moved inward where the building sets back.

    Raises ValueError for a floor the building hasn't got, or a setback that leaves nothing.
    """
    if not 1 <= floor <= building.floors:
        raise ValueError(f"building {building.id} has floors 1..{building.floors}, not {floor}")
    points = [(p.x, p.y) for p in building.footprint]
    inset = building.setback_m * (floor - 1)
    if inset == 0.0:
        return tuple(points)
    moved = []
    n = len(points)
    for i in range(n):
        (ax, ay), (bx, by), (cx, cy) = points[i - 1], points[i], points[(i + 1) % n]
        ux, uy = _unit(bx - ax, by - ay)
        vx, vy = _unit(cx - bx, cy - by)
        cross = ux * vy - uy * vx
        if cross < 1e-9:
            raise ValueError(f"building {building.id}: setback_m needs a convex footprint")
        # the two edges moved inward (to their left) meet at b + inset / cross * (v - u)
        moved.append((bx + inset / cross * (vx - ux), by + inset / cross * (vy - uy)))
    if any(_dot(moved[i], moved[(i + 1) % n], points[i], points[(i + 1) % n]) <= 0 for i in range(n)):
        raise ValueError(f"building {building.id}: a setback of {building.setback_m} m leaves no floor {floor}")
    return tuple(moved)


@lru_cache(maxsize=256)
def facades(building: Building, floor: int = 1) -> tuple[Facade, ...]:
    """The walls of one floor, in the footprint's order."""
    outline = floor_outline(building, floor)
    walls = []
    for i, (ax, ay) in enumerate(outline):
        bx, by = outline[(i + 1) % len(outline)]
        ux, uy = _unit(bx - ax, by - ay)
        walls.append(Facade(i, (ax, ay), (ux, uy), (uy, -ux), math.hypot(bx - ax, by - ay)))
    return tuple(walls)


def columns_of(building: Building, facade: int) -> int:
    """How many windows stand side by side on a facade: the same on every floor, as many as its shortest floor holds."""
    grid = building.windows
    length = facades(building, building.floors)[facade].length_m
    return (
        max(0, math.floor((length - 2 * grid.margin_m - grid.width_m) / grid.pitch_m + 1e-9) + 1)
        if (length >= 2 * grid.margin_m + grid.width_m)
        else 0
    )


def window_slot(building: Building, facade: int, floor: int, column: int) -> WindowSlot:
    """One window of the grid. Raises ValueError where the building has none there."""
    if not 0 <= facade < len(building.footprint):
        raise ValueError(f"building {building.id} has facades 0..{len(building.footprint) - 1}, not {facade}")
    count = columns_of(building, facade)
    if not 0 <= column < count:
        raise ValueError(f"facade {facade} of building {building.id} has {count} window columns; there is no {column}")
    wall = facades(building, floor)[facade]
    grid = building.windows
    t = wall.length_m / 2 + (column - (count - 1) / 2) * grid.pitch_m
    x = wall.start[0] + wall.along[0] * t
    y = wall.start[1] + wall.along[1] * t
    z = (floor - 1) * building.floor_height_m + grid.sill_m + grid.height_m / 2
    plan = next(
        (b for b in building.balconies if facade in b.facades and column in b.columns and floor >= b.from_floor),
        None,
    )
    return WindowSlot(
        building.id,
        facade,
        floor,
        column,
        (x, y, z),
        wall.along,
        wall.normal,
        grid.width_m,
        grid.height_m,
        plan,
    )


def window_of(scene: Scene, place: WindowPlace) -> WindowSlot:
    """Raises ValueError where the building has no such window."""
    return window_slot(scene.building(place.building), place.facade, place.floor, place.column)


def goal_window(scene: Scene) -> WindowSlot | None:
    """The customer's window, if the scene has a goal that stands at one. Raises ValueError where the building has no
    such window."""
    goal = scene.goal_object()
    return window_of(scene, goal.place) if goal is not None and isinstance(goal.place, WindowPlace) else None


def window_slots(building: Building) -> list[WindowSlot]:
    """Every window of the building: facade by facade, floor by floor, column by column."""
    return [
        window_slot(building, f, floor, c)
        for f in range(len(building.footprint))
        for floor in range(1, building.floors + 1)
        for c in range(columns_of(building, f))
    ]


def wall_height_m(building: Building) -> float:
    """From the ground to the top of the highest floor's walls."""
    return building.floors * building.floor_height_m


def _unit(x: float, y: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    if length < 1e-6:
        raise ValueError("a footprint has two equal corners in a row")
    return x / length, y / length


def _dot(a: tuple[float, float], b: tuple[float, float], p: tuple[float, float], q: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (q[0] - p[0]) + (b[1] - a[1]) * (q[1] - p[1])
