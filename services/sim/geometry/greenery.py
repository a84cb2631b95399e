"""Trees and shrubs: trunks, and crowns of lumpy balls or tiers."""

from functools import lru_cache

import numpy as np

from contracts.scene import Tree
from services.sim.geometry.mesh import Colour, Mesh, concatenate, mixed
from services.sim.geometry.solids import cylinder, ellipsoid, frustum, lathe
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.tubes import tube

_GREENS = ("#5f7f3a", "#6d8a40", "#54743a", "#7a8f45", "#4f6f40")
_NEEDLES = ("#3f5f42", "#47664a", "#385540")


def tree(plant: Tree, textures: TextureSet, rng: np.random.Generator) -> Mesh:
    """The whole plant, where it stands."""
    foot = (plant.position.x, plant.position.y, 0.0)
    if plant.kind == "shrub":
        return _shrub(plant, textures, rng).transformed(move=foot)
    if plant.kind == "conifer":
        return _conifer(plant, textures, rng).transformed(move=foot)
    return _broadleaf(plant, textures, rng).transformed(move=foot)


@lru_cache(maxsize=512)
def tree_solid(plant: Tree) -> Mesh:
    """A plain stand-in to bump into."""
    foot = (plant.position.x, plant.position.y, 0.0)
    h, c = plant.height_m, plant.crown_m
    if plant.kind == "shrub":
        return ellipsoid((c, c, h * 0.55), (foot[0], foot[1], h * 0.45), 8, 4)
    if plant.kind == "conifer":
        return frustum(c, 0.1, h * 0.85, (foot[0], foot[1], h * 0.15), 8)
    half = min(h * 0.36, c * 1.15)
    crown = ellipsoid((c, c, half), (foot[0], foot[1], h - half), 8, 5)
    return concatenate([cylinder(0.2, h - half, foot, 6), crown])


def _lump(
    radii: tuple[float, float, float],
    centre: tuple[float, float, float],
    colour: Colour,
    layer: int,
    rng: np.random.Generator,
    segments: int = 10,
    rings: int = 7,
) -> Mesh:
    """An uneven ball, lighter on top: the sun reaches there."""
    ball = _ball(segments, rings, colour, layer)
    p = ball.positions.astype(np.float64)
    axes = rng.normal(size=(7, 3)) * 2.6
    phase = rng.uniform(0, 6.28, 7)
    bump = 1.0 + 0.07 * np.sin(p @ axes.T + phase).sum(axis=1)
    shape = p * bump[:, None] * np.array(radii) + np.array(centre)
    light = np.clip(0.74 + 0.30 * p[:, 2] + 0.10 * (bump - 1) / 0.2, 0.45, 1.08)
    colours = np.clip(ball.colours * light[:, None], 0, 255).astype(np.uint8)
    size = float(np.mean(radii))
    return Mesh(
        shape.astype(np.float32), ball.normals, (ball.uv * size).astype(np.float32), colours, ball.layer, ball.faces
    )


@lru_cache(maxsize=512)
def _ball(segments: int, rings: int, colour: Colour, layer: int) -> Mesh:
    return ellipsoid(1.0, (0, 0, 0), segments, rings, colour, layer)


def _broadleaf(plant: Tree, textures: TextureSet, rng: np.random.Generator) -> Mesh:
    h, c = plant.height_m, plant.crown_m
    half = min(h * 0.36, c * 1.15)
    middle = h - half
    leaf, bark = textures.layer("leaves"), textures.layer("timber")
    green = _GREENS[int(rng.integers(len(_GREENS)))]
    lean = rng.uniform(-0.06, 0.06, 2) * h
    trunk = tube(
        [(0, 0, -0.1), (lean[0] * 0.4, lean[1] * 0.4, middle * 0.5), (lean[0], lean[1], middle)],
        [0.045 * h * 0.55, 0.03 * h * 0.55, 0.02 * h * 0.55],
        7,
        "#6b5a48",
        bark,
    )
    parts = [trunk, _lump((c * 0.72, c * 0.72, half * 0.80), (0, 0, middle + half * 0.15), green, leaf, rng, 12, 8)]
    count = 7
    for k in range(count):
        a = 2 * np.pi * (k + float(rng.uniform(0, 0.6))) / count
        r = c * float(rng.uniform(0.45, 0.60))
        size = c * float(rng.uniform(0.38, 0.52))
        z = middle + half * float(rng.uniform(-0.45, 0.35))
        shade = mixed(green, "#20301a" if k % 2 else "#9aa860", 0.14)
        parts.append(_lump((size, size, size * 0.85), (r * np.cos(a), r * np.sin(a), z), shade, leaf, rng))
    return concatenate(parts)


def _conifer(plant: Tree, textures: TextureSet, rng: np.random.Generator) -> Mesh:
    h, c = plant.height_m, plant.crown_m
    leaf, bark = textures.layer("leaves"), textures.layer("timber")
    green = _NEEDLES[int(rng.integers(len(_NEEDLES)))]
    parts = [cylinder(0.02 * h + 0.05, h * 0.3, (0, 0, -0.1), 7, "#5f4c3c", bark)]
    tiers, n = 7, 12
    for k in range(tiers):
        t = k / tiers
        z0 = h * (0.12 + 0.80 * t)
        r, high = c * (1 - t) ** 0.85 + 0.1, h * 0.24
        tier = lathe([(0.0, 0.05), (r, -0.12 * r), (r * 0.45, high * 0.42), (0.0, high)], n, green, leaf)
        p = tier.positions.astype(np.float64)
        angle = np.arctan2(p[:, 1], p[:, 0])
        ragged = 1.0 + 0.13 * np.cos(angle * n / 2 + k) + 0.05 * np.sin(angle * 5 + k * 2.1)
        p[:, :2] *= ragged[:, None]
        p[:, 2] += z0 - 0.1 * (ragged - 1) * r
        light = 0.70 + 0.32 * np.clip(np.hypot(p[:, 0], p[:, 1]) / max(r, 0.1), 0, 1)
        colours = np.clip(tier.colours * light[:, None], 0, 255).astype(np.uint8)
        parts.append(Mesh(p.astype(np.float32), tier.normals, tier.uv, colours, tier.layer, tier.faces))
    return concatenate(parts)


def _shrub(plant: Tree, textures: TextureSet, rng: np.random.Generator) -> Mesh:
    h, c = plant.height_m, plant.crown_m
    leaf = textures.layer("leaves")
    green = _GREENS[int(rng.integers(len(_GREENS)))]
    parts = [_lump((c * 0.8, c * 0.8, h * 0.55), (0, 0, h * 0.42), green, leaf, rng, 10, 6)]
    for k in range(3):
        a = 2.1 * k + float(rng.uniform(0, 1))
        parts.append(
            _lump(
                (c * 0.5, c * 0.5, h * 0.38),
                (c * 0.45 * np.cos(a), c * 0.45 * np.sin(a), h * 0.36),
                green,
                leaf,
                rng,
                8,
                5,
            )
        )
    return concatenate(parts)
