"""What closes the view: beyond the ground's edge, woods all round, and a town where there are roads.

Everything here is farther than the depth sensor reaches and than anybody can fly.
"""

import numpy as np

from contracts.scene import Scene
from services.sim.geometry.facade import chance
from services.sim.geometry.mesh import Mesh, concatenate, make, mixed
from services.sim.geometry.parts import Assembly
from services.sim.geometry.solids import prism, quad
from services.sim.geometry.textures import TextureSet

_WALLS = ("#b9aa94", "#a99f95", "#b5b2ac", "#a58a78", "#c3bba6", "#9fa6ac", "#ab8f80")
_ROOFS = ("#6d4a3e", "#585c62", "#74655a")
_SECTORS = 12


def build_backdrop(assembly: Assembly, part: int, scene: Scene, textures: TextureSet) -> None:
    """Draws rings about the origin, outside the ground's square."""
    half = scene.ground.half_size_m
    rng = chance(scene.seed, "backdrop")
    reach = half * 1.42 + 60.0
    _skirt_ground(assembly, part, scene, reach + 60.0, textures)
    for radius, low, high, colour in ((reach + 45.0, 16.0, 34.0, "#6f8a86"), (reach, 7.0, 14.0, "#56704a")):
        for mesh in _ring(radius, low, high, colour, textures.layer("leaves"), rng):
            assembly.draw(part, mesh)
    if not scene.ground.roads:
        return
    blocks: list[list[Mesh]] = [[] for _ in range(_SECTORS)]
    for k in range(46):
        angle = 2 * np.pi * (k + float(rng.uniform(-0.3, 0.3))) / 46
        distance = half * 1.42 + float(rng.uniform(4.0, 40.0))
        blocks[int(angle % (2 * np.pi) / (2 * np.pi) * _SECTORS)].append(_block(angle, distance, textures, rng))
    for group in blocks:
        assembly.draw(part, group)


def _skirt_ground(assembly: Assembly, part: int, scene: Scene, reach: float, textures: TextureSet) -> None:
    """The land between the ground's edge and the woods: four trapezoids, of grass."""
    h = scene.ground.half_size_m
    layer = textures.layer("grass")
    inner, outer = (
        ((-h, -h), (h, -h), (h, h), (-h, h)),
        ((-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)),
    )
    for i in range(4):
        j = (i + 1) % 4
        corners = [(*outer[i], 0.0), (*outer[j], 0.0), (*inner[j], 0.0), (*inner[i], 0.0)]
        assembly.draw(part, quad(corners, "#d8dcd0", layer, [c[:2] for c in corners]))


def _ring(radius: float, low: float, high: float, colour: str, layer: int, rng: np.random.Generator) -> list[Mesh]:
    """A wall of treetops, seen from inside, in sectors."""
    n = _SECTORS * 24
    a = np.linspace(0, 2 * np.pi, n + 1)
    slow = sum(np.sin(a * f + float(rng.uniform(0, 6.28))) / f**0.5 for f in (2, 3, 5, 7, 11, 17)) / 3.0
    quick = rng.uniform(-1, 1, n + 1)
    quick[-1] = quick[0]
    top = low + (high - low) * np.clip(0.5 + 0.38 * slow + 0.16 * quick, 0.0, 1.1)
    x, y = radius * np.cos(a), radius * np.sin(a)
    shade = rng.uniform(0.85, 1.05, n + 1)
    meshes = []
    per = n // _SECTORS
    for s in range(_SECTORS):
        i = np.arange(s * per, (s + 1) * per + 1)
        p = np.concatenate([np.column_stack([x[i], y[i], np.zeros(len(i))]), np.column_stack([x[i], y[i], top[i]])])
        m, k = len(i), np.arange(per)
        faces = np.concatenate([np.column_stack([k + 1, k, m + k]), np.column_stack([k + 1, m + k, m + k + 1])])
        normals = np.column_stack([-p[:, 0], -p[:, 1], np.full(len(p), radius * 0.6)])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        uv = np.column_stack([np.tile(a[i] * radius, 2), p[:, 2]]) * 0.25
        mesh = make(p, faces, normals, uv, colour, layer)
        light = np.concatenate([0.72 * shade[i], 1.0 * shade[i]])
        colours = np.clip(mesh.colours * light[:, None], 0, 255).astype(np.uint8)
        meshes.append(Mesh(mesh.positions, mesh.normals, mesh.uv, colours, mesh.layer, mesh.faces))
    return meshes


def _block(angle: float, distance: float, textures: TextureSet, rng: np.random.Generator) -> Mesh:
    """A far house: walls with spots for windows and a plain roof."""
    length, depth = float(rng.uniform(14, 30)), float(rng.uniform(10, 14))
    height = 3.0 * int(rng.integers(3, 7) if rng.random() < 0.8 else rng.integers(8, 14))
    colour = _WALLS[int(rng.integers(len(_WALLS)))]
    x, y = depth / 2, length / 2
    ring = [(-x, -y), (x, -y), (x, y), (-x, y)]
    parts = [prism(ring, 0.0, height, colour, textures.layer("town"), top=False)]
    roof = _ROOFS[int(rng.integers(len(_ROOFS)))]
    if height < 20:
        ridge = [(0.0, -y + 2, height + 3.5), (0.0, y - 2, height + 3.5)]
        parts.append(quad([(-x, y, height), (-x, -y, height), ridge[0], ridge[1]], roof))
        parts.append(quad([(x, -y, height), (x, y, height), ridge[1], ridge[0]], roof))
    else:
        parts.append(prism(ring, height, height + 0.8, mixed(colour, "#ffffff", 0.2)))
    turn = angle + float(rng.uniform(-0.25, 0.25))
    return concatenate(parts).transformed(yaw=turn, move=(distance * np.cos(angle), distance * np.sin(angle), 0.0))
