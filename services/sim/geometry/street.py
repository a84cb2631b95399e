"""What stands and lies round the buildings: ground, roads with pavements, trees, cars, lamps."""

import zlib
from math import atan2, cos, hypot, pi, sin

import numpy as np

from contracts.geometry import Point2
from contracts.scene import Car, Ground, Road, Scene, Tree
from services.sim.geometry.mesh import Mesh, concatenate, mixed
from services.sim.geometry.parts import Assembly
from services.sim.geometry.solids import box, cylinder, ellipsoid, extruded, frustum, quad, rod, standing_box
from services.sim.geometry.textures import TextureSet

KERB_M = 0.12
ROAD_LIFT_M = 0.02
FAR_M = 600.0
"""The ground goes on to the horizon; what lies beyond `half_size_m` is plain."""

_SURFACES = {
    "grass": ("grass", "#7f9a58"),
    "paving": ("paving", "#b9b4aa"),
    "asphalt": ("asphalt", "#7c7d80"),
    "gravel": ("gravel", "#b7aa94"),
}
_GREENS = ("#5f8a3c", "#6f9446", "#4f7d3a", "#7d9a4a")


def add_surroundings(assembly: Assembly, scene: Scene, textures: TextureSet) -> None:
    """Draws the ground and all that stands on it, and makes solid what can be bumped into."""
    ground = scene.ground
    part = assembly.part("surroundings", "ground")
    assembly.draw(part, _plain(ground, textures))
    assembly.block(part, _floor(ground.half_size_m * 2))
    for road in ground.roads:
        assembly.draw(part, _road(road, textures))
    for i, tree in enumerate(ground.trees):
        standing = assembly.part("surroundings", f"tree-{i + 1}")
        rng = np.random.default_rng([scene.seed, zlib.crc32(b"tree"), i])
        drawn, solid = _tree(tree, textures, rng)
        assembly.draw(standing, drawn)
        assembly.block(standing, solid)
    for i, car in enumerate(ground.cars):
        standing = assembly.part("surroundings", f"car-{i + 1}")
        drawn, solid = _car(car)
        assembly.draw(standing, drawn)
        assembly.block(standing, solid)
    for i, place in enumerate(ground.lamps):
        standing = assembly.part("surroundings", f"lamp-{i + 1}")
        lamp = _lamp(place)
        assembly.draw(standing, lamp)
        assembly.block(standing, lamp)


def _plain(ground: Ground, textures: TextureSet) -> Mesh:
    """The near ground in its surface, and plain ground from there to the horizon."""
    name, tint = _SURFACES[ground.surface]
    half = ground.half_size_m
    near = _floor(half, tint).relayered(textures.layer(name))
    far_tint = mixed(tint, "#9aa08c", 0.35)
    outer = [(-FAR_M, -FAR_M), (FAR_M, -FAR_M), (FAR_M, FAR_M), (-FAR_M, FAR_M)]
    inner = [(-half, -half), (half, -half), (half, half), (-half, half)]
    rim = []
    for k in range(4):
        a, b, c, d = outer[k], outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]
        rim.append(quad([(*a, 0.0), (*b, 0.0), (*c, 0.0), (*d, 0.0)], far_tint))
    return concatenate([near, *rim])


def _floor(half: float, colour: str = "#ffffff") -> Mesh:
    corners = [(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)]
    return quad(corners, colour, 0, [(x, y) for x, y, _ in corners])


def _road(road: Road, textures: TextureSet) -> Mesh:
    """Carriageway with edge lines and a dashed middle, kerbs and pavements; drawn along x, then laid in place."""
    dx, dy = road.end.x - road.start.x, road.end.y - road.start.y
    length, half, walk = max(hypot(dx, dy), 0.1), road.width_m / 2, road.pavement_m
    parts = [_strip(0.0, length, -half, half, ROAD_LIFT_M, "#808288", textures.layer("asphalt"))]
    line = ROAD_LIFT_M + 0.012
    for y in (-half + 0.25, half - 0.25):
        parts.append(_strip(0.0, length, y - 0.06, y + 0.06, line, "#d9d9d4"))
    for k in range(int(length / 6.0)):
        parts.append(_strip(k * 6.0 + 1.5, k * 6.0 + 4.5, -0.07, 0.07, line, "#e8e6dc"))
    if walk > 0:
        for side in (-1, 1):
            low, high = sorted((side * half, side * (half + walk)))
            parts.append(_strip(0.0, length, low, high, KERB_M, "#c4c0b6", textures.layer("paving")))
            y = side * (half + 0.08)
            parts.append(box((length, 0.16, KERB_M + 0.02), (length / 2, y, (KERB_M + 0.02) / 2), "#a9a69e"))
            edge = side * (half + walk)
            parts.append(box((length, 0.08, KERB_M), (length / 2, edge, KERB_M / 2), "#9d9a92"))
    flat = concatenate(parts)
    return flat.transformed(yaw=atan2(dy, dx), move=(road.start.x, road.start.y, 0.0))


def _strip(x0: float, x1: float, y0: float, y1: float, z: float, colour: str, layer: int = 0) -> Mesh:
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return quad(corners, colour, layer, [(x, y) for x, y, _ in corners])


def _tree(tree: Tree, textures: TextureSet, rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """What is seen, and the plainer shape that is solid."""
    leaves = textures.layer("leaves")
    green = _GREENS[int(rng.integers(len(_GREENS)))]
    h, r = tree.height_m, tree.crown_m
    if tree.kind == "shrub":
        drawn = [_blob((0.0, 0.0, h * 0.45), (r, r, h * 0.55), green, leaves, rng)]
        drawn.append(_blob((r * 0.5, r * 0.2, h * 0.35), (r * 0.7, r * 0.6, h * 0.4), green, leaves, rng))
        solid = [ellipsoid((r, r, h * 0.55), (0.0, 0.0, h * 0.45))]
    elif tree.kind == "conifer":
        trunk = cylinder(0.12 + 0.015 * h, h * 0.2, segments=7, colour="#5b4632")
        dark = mixed(green, "#23452c", 0.6)
        tiers, drawn = 4, [trunk]
        for k in range(tiers):
            foot = h * (0.14 + 0.2 * k)
            wide, tall = r * (1.0 - 0.2 * k), h * (1.0 - (0.14 + 0.2 * k)) * (0.55 if k < tiers - 1 else 1.0)
            turned = frustum(wide, 0.0, tall, (0, 0, foot), 9, _hex(dark), leaves).transformed(
                yaw=float(rng.uniform(0, 6))
            )
            drawn.append(turned)
        solid = [trunk, frustum(r, 0.05, h * 0.86, (0, 0, h * 0.14), 8)]
    else:
        width = 0.10 + 0.018 * h
        trunk = frustum(width * 1.35, width, h * 0.55, segments=8, colour="#6b5440")
        top = h - r
        drawn = [trunk, _blob((0.0, 0.0, top), (r, r, r), green, leaves, rng)]
        for k in range(4):
            angle = float(rng.uniform(0, 0.8)) + k * pi / 2
            reach, size = r * float(rng.uniform(0.45, 0.65)), r * float(rng.uniform(0.5, 0.68))
            at = (reach * cos(angle), reach * sin(angle), top - r * float(rng.uniform(0.1, 0.5)))
            drawn.append(_blob(at, (size, size, size * 0.9), green, leaves, rng))
        solid = [trunk, ellipsoid((r * 1.05, r * 1.05, r), (0.0, 0.0, top))]
    move = (tree.position.x, tree.position.y, 0.0)
    return concatenate(drawn).transformed(move=move), concatenate(solid).transformed(move=move)


def _blob(
    centre: tuple[float, float, float],
    radii: tuple[float, float, float],
    colour: str,
    layer: int,
    rng: np.random.Generator,
) -> Mesh:
    """A clump of leaves: an ellipsoid with an uneven skin, each clump in a slightly different green."""
    tint = mixed(colour, "#d8e07a" if rng.random() < 0.5 else "#1f3a1c", float(rng.uniform(0.0, 0.22)))
    smooth = ellipsoid(radii, colour=_hex(tint), layer=layer)
    # the same push for vertices in the same place, or the seam of the sphere would tear
    phase = rng.uniform(0, 6, 3)
    wobble = 1.0 + 0.07 * np.sin(smooth.positions * (5.0 / max(radii)) + phase).sum(axis=1, keepdims=True)
    matrix = np.eye(4)
    matrix[:3, 3] = centre
    pushed = Mesh(
        (smooth.positions * wobble).astype(np.float32),
        smooth.normals,
        smooth.uv,
        smooth.colours,
        smooth.layer,
        smooth.faces,
    )
    return pushed.transformed(matrix)


def _car(car: Car) -> tuple[Mesh, Mesh]:
    """A saloon car of 4.3 m: body and glass house in profile, wheels, lights."""
    body = [(-2.1, 0.35), (2.1, 0.35), (2.12, 0.72), (1.95, 0.86), (0.95, 0.95), (-1.35, 0.98), (-2.08, 0.9)]
    house = [(-1.75, 0.93), (1.1, 0.93), (0.35, 1.42), (-1.05, 1.45)]
    turned = [(-x, z) for x, z in reversed(body)], [(-x, z) for x, z in reversed(house)]
    roof = [(-0.33, 1.40), (1.03, 1.43), (0.95, 1.49), (-0.28, 1.47)]
    parts = [
        extruded(turned[0], 1.72, car.colour),
        extruded(turned[1], 1.50, "#2b3138"),
        extruded(roof, 1.46, car.colour),
    ]
    # `extruded` draws silhouettes of (y, z) along x; the car's length runs along y until it is turned
    for y in (-1.3, 1.3):
        for x in (-0.8, 0.8):
            wheel = cylinder(0.33, 0.22, (0.0, 0.0, -0.11), 12, "#1c1d1f")
            hub = cylinder(0.17, 0.24, (0.0, 0.0, -0.12), 8, "#9a9da1")
            parts.append(concatenate([wheel, hub]).transformed(pitch=pi / 2).transformed(move=(x, y, 0.33)))
    for x in (-0.62, 0.62):
        parts.append(box((0.34, 0.06, 0.14), (x, -2.1, 0.68), "#f4f1dc"))
        parts.append(box((0.34, 0.06, 0.14), (x, 2.09, 0.76), "#b3262a"))
    drawn = concatenate(parts).transformed(yaw=pi / 2)  # its length along x, its front to +x
    solid = standing_box((4.3, 1.8, 1.5))
    move = (car.position.x, car.position.y, 0.0)
    return drawn.transformed(yaw=car.yaw, move=move), solid.transformed(yaw=car.yaw, move=move)


def _lamp(place: Point2) -> Mesh:
    """A street lamp of 5 m with a short arm."""
    parts = [
        frustum(0.14, 0.10, 0.5, segments=8, colour="#3d4247"),
        frustum(0.07, 0.05, 4.8, segments=8, colour="#4a5057"),
        rod((0.0, 0.0, 4.75), (0.0, 0.7, 4.95), 0.04, colour="#4a5057"),
        box((0.22, 0.5, 0.10), (0.0, 0.85, 4.95), "#4a5057"),
        box((0.18, 0.42, 0.02), (0.0, 0.85, 4.89), "#fff3cf"),
    ]
    return concatenate(parts).transformed(move=(place.x, place.y, 0.0))


def _hex(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
