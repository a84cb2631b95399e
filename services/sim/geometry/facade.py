"""The walls of a building: real openings with windows set back in them, and balconies; a few floors at a time."""

import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Building
from contracts.scene_layout import WindowSlot, columns_of, facades, window_slot
from services.sim.geometry.mesh import Colour, Mesh, concatenate, make, mixed, rgb
from services.sim.geometry.parts import Assembly, stamped, wall_frame
from services.sim.geometry.pictures import BARE_PANES, DRESSED_PANES, LATTICES
from services.sim.geometry.solids import box
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.windows import balcony, balcony_solid, pane, window

FLOORS_PER_CHUNK = 3
THRESHOLD_M = 0.06


class Dress(NamedTuple):
    """How a building's walls are finished beyond the document's style: the windows' surround, another wall for the
    ground floor, the spandrels' colour under the windows, the metal of railings."""

    surround: str
    ground_layer: int | None
    ground_colour: Colour | None
    spandrel: Colour | None
    metal: str


def chance(seed: int, name: str) -> np.random.Generator:
    """A stream of its own for everything that has a name."""
    return np.random.default_rng((seed, zlib.crc32(name.encode())))


def build_facades(
    assembly: Assembly,
    part: int,
    building: Building,
    textures: TextureSet,
    dress: Dress,
    seed: int,
    kept: set[tuple[int, int, int]],
) -> None:
    """Draws all walls and windows. `kept` names the windows (facade, floor, column) that keep their sill although they
    have a balcony, because something stands on it."""
    step = 1 if building.setback_m > 0 else FLOORS_PER_CHUNK
    rng = chance(seed, f"panes of {building.id}")
    for f in range(len(building.footprint)):
        count = columns_of(building, f)
        for low in range(1, building.floors + 1, step):
            floors = range(low, min(low + step, building.floors + 1))
            slots = [window_slot(building, f, k, c) for k in floors for c in range(count)]
            doors = [s for s in slots if s.balcony is not None and (f, s.floor, s.column) not in kept]
            meshes = [_wall(building, f, floors, textures, dress, doors)]
            meshes += _windows(building, slots, doors, textures, dress, rng)
            assembly.draw(part, meshes)
            _block_ledges(assembly, part, building, slots, doors)
            outside = [s for s in slots if s.balcony is not None]
            if outside:
                _balconies(assembly, part, building, outside, dress)


def slot_frame(slot: WindowSlot, z: float | None = None) -> NDArray[np.float64]:
    """(4, 4) the wall's axes at the middle of the opening, or at another height."""
    x, y, middle = slot.centre
    return wall_frame(slot.normal, slot.along, (x, y, middle if z is None else z))


def floor_z(building: Building, floor: int) -> float:
    return (floor - 1) * building.floor_height_m


def _drop_m(building: Building) -> float:
    return max(building.windows.sill_m - THRESHOLD_M, 0.0)


def _wall(
    building: Building, f: int, floors: range, textures: TextureSet, dress: Dress, doors: list[WindowSlot]
) -> Mesh:
    """A grid of cells without the openings: corners are shared, so that no light comes through the seams."""
    grid, style = building.windows, building.style
    wall = facades(building, floors[0])[f]
    count = columns_of(building, f)
    middle = [wall.length_m / 2 + (c - (count - 1) / 2) * grid.pitch_m for c in range(count)]
    edges = [0.0, *(t + s * grid.width_m / 2 for t in middle for s in (-1, 1)), wall.length_m]
    rows: list[float] = []
    for k in floors:
        z = floor_z(building, k)
        rows += [z, z + THRESHOLD_M, z + grid.sill_m, z + grid.sill_m + grid.height_m]
    rows.append(floor_z(building, floors[-1] + 1))
    open_to_floor = {(s.floor, s.column) for s in doors}
    ys, zs = np.array(edges), np.array(rows)
    p = np.stack(np.meshgrid(ys, zs), -1).reshape(-1, 2)
    n = len(ys)
    faces: list[tuple[int, int, int]] = []
    spandrels: list[tuple[int, int, int]] = []
    ground: list[tuple[int, int, int]] = []
    for j in range(len(zs) - 1):
        floor, band = floors[j // 4], j % 4
        for i in range(n - 1):
            column = (i - 1) // 2 if i % 2 else None
            if column is not None and (band == 2 or (band == 1 and (floor, column) in open_to_floor)):
                continue
            if zs[j + 1] - zs[j] < 1e-6:
                continue
            a, b, c, d = j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i
            into = faces
            if floor == 1 and dress.ground_layer is not None:
                into = ground
            elif dress.spandrel is not None and column is not None and band != 3:
                into = spandrels
            into += [(a, b, c), (a, c, d)]
    layer = textures.layer(style.wall)
    meshes = [
        _cells(wall.start, wall.along, wall.normal, p, faces, style.wall_colour, layer),
        _cells(wall.start, wall.along, wall.normal, p, spandrels, dress.spandrel or style.wall_colour, layer),
        _cells(
            wall.start,
            wall.along,
            wall.normal,
            p,
            ground,
            dress.ground_colour or style.wall_colour,
            dress.ground_layer or 0,
        ),
    ]
    whole = concatenate([m for m in meshes if m.triangle_count])
    top = building.floors * building.floor_height_m
    # a little darkness where the wall meets the ground and under the eaves
    up = whole.positions[:, 2]
    light = 1.0 - 0.20 * np.exp(-up / 0.35) - 0.16 * np.exp(-(top - up) / 0.3)
    shaded = np.clip(whole.colours * light[:, None], 0, 255).astype(np.uint8)
    return Mesh(whole.positions, whole.normals, whole.uv, shaded, whole.layer, whole.faces)


def _cells(
    start: tuple[float, float],
    along: tuple[float, float],
    normal: tuple[float, float],
    p: NDArray[np.float64],
    faces: list[tuple[int, int, int]],
    colour: Colour,
    layer: int,
) -> Mesh:
    xyz = np.column_stack([np.array(start) + p[:, :1] * np.array(along), p[:, 1]])
    return make(xyz, np.array(faces, np.uint32).reshape(-1, 3), np.tile((*normal, 0.0), (len(p), 1)), p, colour, layer)


def _windows(
    building: Building,
    slots: list[WindowSlot],
    doors: list[WindowSlot],
    textures: TextureSet,
    dress: Dress,
    rng: np.random.Generator,
) -> list[Mesh]:
    grid, style = building.windows, building.style
    layer = textures.layer(style.wall)
    low = set(doors)
    meshes = []
    for group, drop in (([s for s in slots if s not in low], 0.0), (doors, _drop_m(building))):
        if not group:
            continue
        template = window(grid, style, layer, dress.surround if drop == 0 else "plain", drop)
        meshes.append(stamped(template, [slot_frame(s) for s in group]))
        glass = stamped(pane(grid, drop), [slot_frame(s) for s in group])
        layers = np.array([_pane_layer(building, textures, rng) for _ in group], np.uint16)
        tint = rng.uniform(0.86, 1.0, len(group))[:, None] * np.array([1.0, 1.0, 1.0])
        corners = glass.vertex_count // len(group)
        colours = np.repeat(np.rint(tint * 255).astype(np.uint8), corners, axis=0)
        meshes.append(Mesh(glass.positions, glass.normals, glass.uv, colours, np.repeat(layers, corners), glass.faces))
    return meshes


def _pane_layer(building: Building, textures: TextureSet, rng: np.random.Generator) -> int:
    """Drawn for every window in turn, so that the same window looks the same whatever stands elsewhere."""
    drawn, which = rng.random(), rng.random()
    if building.windows.shape == "lattice":
        names = list(LATTICES)[:1]
    elif drawn < building.windows.curtains:
        names = list(DRESSED_PANES)
    else:
        # a lit room is rare by day
        names = ["pane_dark", "pane_dark", "pane_dim", "pane_dim", "pane_dark", *list(BARE_PANES)[2:]]
    return textures.layer(names[int(which * len(names))])


def _block_ledges(
    assembly: Assembly, part: int, building: Building, slots: list[WindowSlot], doors: list[WindowSlot]
) -> None:
    grid = building.windows
    low = set(doors)
    with_ledge = [s for s in slots if s not in low]
    if with_ledge:
        ledge = box((grid.ledge_m, grid.width_m + 0.1, 0.07), (grid.ledge_m / 2, 0, -grid.height_m / 2 - 0.035))
        assembly.block(part, stamped(ledge, [slot_frame(s) for s in with_ledge]))


def _balconies(assembly: Assembly, part: int, building: Building, slots: list[WindowSlot], dress: Dress) -> None:
    by_plan: dict[int, list[WindowSlot]] = {}
    for s in slots:
        by_plan.setdefault(next(i for i, b in enumerate(building.balconies) if b is s.balcony), []).append(s)
    meshes = []
    for i, group in sorted(by_plan.items()):
        plan = building.balconies[i]
        frames = [slot_frame(s, floor_z(building, s.floor)) for s in group]
        meshes.append(stamped(balcony(plan, building.windows, building.style, dress.metal), frames))
        for solid in balcony_solid(plan, building.windows):
            assembly.block(part, stamped(solid, frames))
    assembly.draw(part, meshes)


def darker(colour: Colour, share: float) -> tuple[int, int, int]:
    """The colour with so much black in it."""
    return mixed(colour, (0, 0, 0), share)


def lightness(colour: Colour) -> float:
    return float(rgb(colour).mean() / 255)
