"""The ground and what stands on it: surfaces, roads with pavements, cars, lamps, trees."""

from functools import cache, lru_cache
from itertools import pairwise
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from shapely import geometry as shape
from shapely.ops import unary_union

from contracts.geometry import Point2
from contracts.scene import Car, Road, Scene
from services.sim.geometry.backdrop import build_backdrop
from services.sim.geometry.enclosures import fence, fence_solid, hedge, hedge_solid
from services.sim.geometry.facade import chance
from services.sim.geometry.greenery import tree, tree_solid
from services.sim.geometry.mesh import Colour, Mesh, concatenate, make, mixed
from services.sim.geometry.outlines import grown, plan_of
from services.sim.geometry.overhead import pole, pole_solid, wire, wire_solid
from services.sim.geometry.parts import Assembly
from services.sim.geometry.solids import box, cylinder, ellipsoid, prism, quad, triangulated
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.tubes import rod

KERB_M = 0.12
LAMP_REACH_M, LAMP_M = 0.95, 5.05
"""How far north of its foot, and how high, a street lamp's light is."""
PIECE_M = 16.0
_SURFACES: dict[str, str] = {"grass": "#ffffff", "paving": "#c2bdb4", "asphalt": "#d8d8d8", "gravel": "#c9bfac"}


def build_surroundings(assembly: Assembly, scene: Scene, textures: TextureSet) -> None:
    """Everything that is neither a building nor an object, as one part."""
    part = assembly.part("surroundings", "surroundings")
    _ground(assembly, part, scene, textures)
    build_backdrop(assembly, part, scene, textures)
    trees = []
    for i, plant in enumerate(scene.ground.trees):
        trees.append(tree(plant, textures, chance(scene.seed, f"tree {i}")))
        assembly.block(part, tree_solid(plant))
    for mesh in trees:
        assembly.draw(part, mesh)
    for i, car in enumerate(scene.ground.cars):
        assembly.draw(part, _car(car, chance(scene.seed, f"car {i}")))
        body = box((4.3, 1.8, 1.45), (0, 0, 0.73)).transformed(yaw=car.yaw, move=(car.position.x, car.position.y, 0))
        assembly.block(part, body)
    for spot in scene.ground.lamps:
        assembly.draw(part, _lamp().transformed(move=(spot.x, spot.y, 0.0)))
        assembly.block(part, cylinder(0.12, 5.2, (spot.x, spot.y, 0.0), 6))
    _furniture(assembly, part, scene, textures)


def _furniture(assembly: Assembly, part: int, scene: Scene, textures: TextureSet) -> None:
    ground = scene.ground
    for i, plant in enumerate(ground.hedges):
        assembly.draw(part, hedge(plant, textures, chance(scene.seed, f"hedge {i}")))
        assembly.block(part, hedge_solid(plant))
    for plan in ground.fences:
        assembly.draw(part, fence(plan, textures))
        assembly.block(part, fence_solid(plan))
    for post in ground.poles:
        assembly.draw(part, pole(post, textures))
        assembly.block(part, pole_solid(post))
    for line in ground.wires:
        assembly.draw(part, wire(line))
        assembly.block(part, wire_solid(line))


def _ground(assembly: Assembly, part: int, scene: Scene, textures: TextureSet) -> None:
    """Surfaces that share edges and never overlap, cut into squares so that they are culled and vary in tone."""
    ground = scene.ground
    layer = textures.layer(ground.surface)
    footprints = tuple(b.footprint for b in scene.buildings)
    lie = _lie(ground.roads, ground.half_size_m, footprints, ground.surface, layer)
    rng = chance(scene.seed, "ground")
    tones = rng.uniform(0.90, 1.0, (lie.columns + 1, lie.columns + 1))
    for row in lie.rows:
        meshes = []
        for i, j, mesh, u in row:
            tone = (
                tones[i, j] * (1 - u[:, 0]) * (1 - u[:, 1])
                + tones[i + 1, j] * u[:, 0] * (1 - u[:, 1])
                + tones[i, j + 1] * (1 - u[:, 0]) * u[:, 1]
                + tones[i + 1, j + 1] * u[:, 0] * u[:, 1]
            )
            colours = np.clip(mesh.colours * tone[:, None], 0, 255).astype(np.uint8)
            meshes.append(Mesh(mesh.positions, mesh.normals, mesh.uv, colours, mesh.layer, mesh.faces))
        assembly.draw(part, meshes)
    stone = textures.layer("paving")
    for piece in lie.aprons:
        assembly.draw(part, _flat(piece, 0.0, "#b4aea4", stone))
    for piece in lie.pavements:
        assembly.draw(part, [_flat(piece, KERB_M, "#b9b5ae", stone), *_kerbs(piece)])
    for road in ground.roads:
        assembly.draw(part, _carriageway(road, textures.layer("road")))


class _Lie(NamedTuple):
    """How the ground is divided. `rows` are drawn together, each cell with its place in the grid, its mesh and where
    its corners lie in it (0..1)."""

    columns: int
    rows: tuple[tuple[tuple[int, int, Mesh, NDArray[np.float64]], ...], ...]
    aprons: tuple[shape.Polygon, ...]
    pavements: tuple[shape.Polygon, ...]


@lru_cache(maxsize=16)
def _lie(
    ways: tuple[Road, ...], half: float, footprints: tuple[tuple[Point2, ...], ...], surface: str, layer: int
) -> _Lie:
    """The same in every scene of a street, whatever its seed."""
    carriage = unary_union([shape.Polygon(_strip(r, r.width_m / 2)) for r in ways])
    pavement = pavement_of(ways)
    aprons = [shape.Polygon(grown(plan_of([(p.x, p.y) for p in footprint]), 1.2)) for footprint in footprints]
    apron = unary_union(aprons).difference(unary_union([carriage, pavement]))
    rest = shape.box(-half, -half, half, half).difference(unary_union([carriage, pavement, apron]))
    pieces = np.arange(-half, half, PIECE_M)
    rows = []
    for i, x in enumerate(pieces):
        row: list[tuple[int, int, Mesh, NDArray[np.float64]]] = []
        for j, y in enumerate(pieces):
            cell = shape.box(x, y, min(x + PIECE_M, half), min(y + PIECE_M, half))
            for piece in _polygons(rest.intersection(cell)):
                mesh = _flat(piece, 0.0, _SURFACES[surface], layer)
                row.append((i, j, mesh, (mesh.positions[:, :2] - np.array([x, y])) / PIECE_M))
            if len(row) and (j % 4 == 3 or j == len(pieces) - 1):
                rows.append(tuple(row))
                row = []
    return _Lie(len(pieces), tuple(rows), tuple(_polygons(apron)), tuple(_polygons(pavement)))


@lru_cache(maxsize=16)
def pavement_of(ways: tuple[Road, ...]) -> shape.base.BaseGeometry:
    """What lies a kerb above the rest of the ground, on the plan."""
    carriage = unary_union([shape.Polygon(_strip(r, r.width_m / 2)) for r in ways])
    both = unary_union([shape.Polygon(_strip(r, r.width_m / 2 + r.pavement_m)) for r in ways])
    return both.difference(carriage)


def _strip(road: Road, half_width_m: float) -> list[tuple[float, float]]:
    (ax, ay), (bx, by) = (road.start.x, road.start.y), (road.end.x, road.end.y)
    length = max(hypot(bx - ax, by - ay), 1e-6)
    nx, ny = -(by - ay) / length * half_width_m, (bx - ax) / length * half_width_m
    return [(ax - nx, ay - ny), (bx - nx, by - ny), (bx + nx, by + ny), (ax + nx, ay + ny)]


def _carriageway(road: Road, layer: int) -> list[Mesh]:
    """In pieces of 8 m, one repeat of the markings each. Crossing roads lie in each other's plane."""
    a, d, c, b = (np.array(p) for p in _strip(road, road.width_m / 2))
    length = float(np.linalg.norm(d - a))
    n = max(1, round(length / 8.0))
    parts = []
    for k in range(n):
        t0, t1 = k / n, (k + 1) / n
        corners = [a + (d - a) * t0, a + (d - a) * t1, b + (c - b) * t1, b + (c - b) * t0]
        uv = [(0, k), (0, k + 1), (1, k + 1), (1, k)]
        parts.append(quad([(*p, 0.0) for p in corners], "#ffffff", layer, uv))
    return parts


def _polygons(area: shape.base.BaseGeometry) -> list[shape.Polygon]:
    if area.is_empty:
        return []
    if isinstance(area, shape.Polygon):
        return [area] if area.area > 1e-4 else []
    return [p for part in getattr(area, "geoms", []) for p in _polygons(part)]


def _flat(piece: shape.Polygon, z: float, colour: Colour, layer: int) -> Mesh:
    """A polygon with holes, facing up, uv in metres of the world."""
    ring = np.array(shape.polygon.orient(piece).exterior.coords)[:-1]
    holes = [np.array(hole.coords)[:-1] for hole in piece.interiors]
    faces = triangulated(ring, holes)
    p = np.concatenate([ring, *holes])
    return make(np.column_stack([p, np.full(len(p), z)]), faces, np.tile((0, 0, 1), (len(p), 1)), p, colour, layer)


def _kerbs(piece: shape.Polygon) -> list[Mesh]:
    parts = []
    oriented = shape.polygon.orient(piece)
    for ring in (oriented.exterior, *oriented.interiors):
        p = np.array(ring.coords)
        for a, b in pairwise(p):
            parts.append(quad([(*a, 0.0), (*b, 0.0), (*b, KERB_M), (*a, KERB_M)], "#a5a29c"))
    return parts


def _car(car: Car, rng: np.random.Generator) -> Mesh:
    """A small saloon or hatchback, nose along +x."""
    return car_shape(car.colour, bool(rng.random() < 0.5)).transformed(
        yaw=car.yaw, move=(car.position.x, car.position.y, 0.02)
    )


@lru_cache(maxsize=256)
def car_shape(paint: str, estate: bool) -> Mesh:
    """Nose along +x, wheels on z = 0."""
    glass = "#1f272e"
    lower = [(-2.1, 0.32), (2.1, 0.32), (2.15, 0.62), (1.95, 0.80), (0.95, 0.92), (-1.75, 0.95), (-2.12, 0.85)]
    tail = -1.95 if estate else -1.45
    upper = [(0.95, 0.92), (0.25, 1.42), (-1.2, 1.45), (tail, 0.95)]
    parts = [_side_extruded(lower, 0.86, 0.90, paint), _side_extruded(upper, 0.62, 0.80, paint)]
    for s in (-1, 1):
        panes = [
            [(0.75, 0.97), (0.22, 1.36), (-0.42, 1.38), (-0.42, 0.97)],
            [(-0.50, 0.97), (-0.50, 1.38), (-1.15, 1.38), (tail + 0.22, 0.97)],
        ]
        for pane in panes:
            p = [(x, s * (0.815 - 0.30 * (z - 0.95)), z) for x, z in pane]
            face = quad(p, glass)
            parts.append(face if face.normals[0, 1] * s > 0 else face.flipped())
    parts.append(quad([(0.93, -0.68, 0.96), (0.93, 0.68, 0.96), (0.32, 0.58, 1.40), (0.32, -0.58, 1.40)], glass))
    rear = [(tail - 0.01, 0.66, 1.0), (tail - 0.01, -0.66, 1.0), (-1.24, -0.58, 1.40), (-1.24, 0.58, 1.40)]
    parts.append(quad(rear, glass))
    for x in (-1.35, 1.35):
        for s in (-1, 1):
            wheel = cylinder(0.32, 0.2, (0, 0, -0.1), 12, "#1b1c1e")
            hub = cylinder(0.18, 0.02, (0, 0, 0.1), 10, "#a9adb1")
            parts.append(concatenate([wheel, hub]).transformed(roll=-s * np.pi / 2, move=(x, s * 0.80, 0.32)))
    for s in (-1, 1):
        parts.append(box((0.06, 0.36, 0.14), (2.08, s * 0.58, 0.70), "#f3f1e6"))
        parts.append(box((0.06, 0.30, 0.14), (-2.10, s * 0.62, 0.78), "#a5281e"))
    return concatenate(parts)


def _side_extruded(profile: list[tuple[float, float]], top_half: float, low_half: float, colour: Colour) -> Mesh:
    """A side view (x, z), counter-clockwise seen from -y, drawn out across y, a little narrower at its top."""
    flat = prism(profile, -1.0, 1.0, colour, bottom=True)
    p = flat.positions.astype(np.float64)
    z = p[:, 1]
    share = (z - z.min()) / max(float(np.ptp(z)), 1e-6)
    half = low_half + (top_half - low_half) * share
    # prism x, y, z -> car x, z, -y keeps the handedness
    moved = np.column_stack([p[:, 0], -p[:, 2] * half, p[:, 1]])
    n = flat.normals
    normals = np.column_stack([n[:, 0], -n[:, 2], n[:, 1]])
    return Mesh(moved.astype(np.float32), normals.astype(np.float32), flat.uv, flat.colours, flat.layer, flat.faces)


@cache
def _lamp() -> Mesh:
    grey = "#4c5054"
    return concatenate(
        [
            cylinder(0.14, 0.5, (0, 0, 0), 8, grey),
            rod((0, 0, 0.4), (0, 0, 5.0), 0.06, 7).recoloured(grey),
            rod((0, 0, 4.95), (0.0, 0.9, 5.15), 0.04, 6).recoloured(grey),
            ellipsoid((0.14, 0.34, 0.07), (0.0, 0.95, 5.12), 8, 4, mixed(grey, "#f0ead8", 0.75)),
        ]
    )
