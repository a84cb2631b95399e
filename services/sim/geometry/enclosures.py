"""Hedges, garden walls and fences: what is drawn, and the plates that one bumps into."""

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin

import numpy as np

from contracts.geometry import Point2
from contracts.scene_street import Fence, Hedge
from services.sim.geometry.mesh import Mesh, concatenate, make, mixed
from services.sim.geometry.parts import stamped, wall_frame
from services.sim.geometry.solids import box, extruded
from services.sim.geometry.textures import TextureSet

_GREENS = ("#4f6f35", "#587a3c", "#486838")
_STEP_M = 0.35
_ROUGH_M = 0.045
_ARCH = 7
_PICKET_M, _PICKETS_M = 0.09, 0.15
_BAR_M, _BARS_M = 0.022, 0.13
_POSTS_M = 2.2


def hedge(plant: Hedge, textures: TextureSet, rng: np.random.Generator) -> Mesh:
    """Clipped to a rounded box, and uneven."""
    length_m, half, height_m = _length_m(plant.start, plant.end), plant.width_m / 2, plant.height_m
    round_m = min(half, 0.25, height_m / 3)
    across = [(-half * 0.9, 0.0), (-half, (height_m - round_m) / 2)]
    for k in range(_ARCH):
        a = pi * (1 - k / (_ARCH - 1))
        side = (half - round_m) * (1 if k > _ARCH // 2 else -1 if k < _ARCH // 2 else 0)
        across.append((side + round_m * cos(a), height_m - round_m + round_m * sin(a)))
    across += [(half, (height_m - round_m) / 2), (half * 0.9, 0.0)]
    profile = np.array(across)
    rows = max(2, round(length_m / _STEP_M) + 1)
    x = np.linspace(0.0, length_m, rows)
    p = np.concatenate([np.column_stack([np.full(len(profile), at), profile]) for at in x])
    p += rng.uniform(-_ROUGH_M, _ROUGH_M, p.shape) * (p[:, 2:] > 0.0)
    m, j = len(profile), np.arange(len(profile) - 1)
    strips = [
        np.concatenate([np.column_stack([a + j, a + j + 1, b + j + 1]), np.column_stack([a + j, b + j + 1, b + j])])
        for a, b in ((i * m, i * m + m) for i in range(rows - 1))
    ]
    out = np.column_stack([np.zeros(m), profile[:, 0] / half, np.clip(profile[:, 1] / height_m * 2 - 1, 0.0, 1.0)])
    normals = np.tile(out / np.linalg.norm(out, axis=1, keepdims=True).clip(1e-6), (rows, 1))
    green = _GREENS[int(rng.integers(len(_GREENS)))]
    run = np.concatenate([[0.0], np.hypot(*np.diff(profile, axis=0).T).cumsum()])
    uv = np.column_stack([p[:, 0], np.tile(run, rows)])
    body = make(p, np.concatenate(strips), normals, uv, green, textures.layer("leaves"))
    whole = concatenate([body, *_hedge_ends(p.reshape(rows, m, 3), green, textures.layer("leaves"))])
    light = 0.62 + 0.42 * np.clip(whole.positions[:, 2] / height_m, 0.0, 1.0)
    light *= rng.uniform(0.9, 1.06, whole.vertex_count)
    colours = np.clip(whole.colours * light[:, None], 0, 255).astype(np.uint8)
    shaded = Mesh(whole.positions, whole.normals, whole.uv, colours, whole.layer, whole.faces)
    return stamped(shaded, [_frame(plant.start, plant.end)])


def hedge_solid(plant: Hedge) -> Mesh:
    """A box as large."""
    length_m = _length_m(plant.start, plant.end)
    plain = box((length_m, plant.width_m, plant.height_m), (length_m / 2, 0.0, plant.height_m / 2))
    return stamped(plain, [_frame(plant.start, plant.end)])


def fence(plan: Fence, textures: TextureSet) -> Mesh:
    """Boards on two rails, bars between two, or a wall with a coping."""
    length_m = _length_m(plan.start, plan.end)
    if plan.kind == "wall":
        parts = _wall(plan, length_m, textures)
    elif plan.kind == "bars":
        parts = _bars(plan, length_m)
    else:
        parts = _pickets(plan, length_m, textures)
    return stamped(concatenate(parts), [_frame(plan.start, plan.end)])


def fence_solid(plan: Fence) -> Mesh:
    """A plate as high: nothing that flies fits between its bars."""
    length_m = _length_m(plan.start, plan.end)
    thick_m = 0.24 if plan.kind == "wall" else 0.06
    plate = box((length_m, thick_m, plan.height_m), (length_m / 2, 0.0, plan.height_m / 2))
    return stamped(plate, [_frame(plan.start, plan.end)])


def _hedge_ends(rows: np.ndarray[tuple[int, ...], np.dtype[np.float64]], green: str, layer: int) -> list[Mesh]:
    count = rows.shape[1]
    fan = np.column_stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)])
    return [
        make(ring, faces, np.tile((out, 0.0, 0.2), (count, 1)) / hypot(1.0, 0.2), ring[:, 1:], green, layer)
        for ring, faces, out in ((rows[0], fan[:, ::-1], -1.0), (rows[-1], fan, 1.0))
    ]


def _wall(plan: Fence, length_m: float, textures: TextureSet) -> list[Mesh]:
    h, coping = plan.height_m, 0.08
    body = box((length_m, 0.22, h - coping), (length_m / 2, 0.0, (h - coping) / 2), plan.colour, without=("-z", "+z"))
    top = box((length_m + 0.06, 0.30, coping), (length_m / 2, 0.0, h - coping / 2), mixed(plan.colour, "#6b665e", 0.4))
    return [body.relayered(textures.layer("brick")), top]


def _pickets(plan: Fence, length_m: float, textures: TextureSet) -> list[Mesh]:
    h, half = plan.height_m, _PICKET_M / 2
    wood = textures.layer("timber")
    board = extruded(
        [(-half, 0.06), (half, 0.06), (half, h - 0.07), (0.0, h), (-half, h - 0.07)], 0.02, plan.colour, wood
    )
    board = board.transformed(yaw=pi / 2, move=(0.0, -0.035, 0.0))
    parts = [_in_row(board, length_m, _PICKETS_M, half)]
    for z in (0.2 * h, 0.78 * h):
        parts.append(box((length_m, 0.045, 0.08), (length_m / 2, 0.0, z), mixed(plan.colour, "#3c352c", 0.15), wood))
    post = box((0.09, 0.09, h), (0.0, 0.03, h / 2), mixed(plan.colour, "#3c352c", 0.15), wood, without=("-z",))
    return [*parts, _in_row(post, length_m, _POSTS_M, 0.045)]


def _bars(plan: Fence, length_m: float) -> list[Mesh]:
    h = plan.height_m
    metal = mixed(plan.colour, "#1d2023", 0.75)
    bar = box((_BAR_M, _BAR_M, h), (0.0, 0.0, h / 2), metal, without=("-z",))
    post = box((0.06, 0.06, h + 0.08), (0.0, 0.0, (h + 0.08) / 2), metal, without=("-z",))
    rails = [box((length_m, 0.03, 0.04), (length_m / 2, 0.0, z), metal) for z in (0.12, h - 0.10)]
    return [_in_row(bar, length_m, _BARS_M, _BAR_M), *rails, _in_row(post, length_m, _POSTS_M, 0.03)]


def _in_row(mesh: Mesh, length_m: float, apart_m: float, edge_m: float) -> Mesh:
    """Copies from one end to the other."""
    count = max(1, round((length_m - 2 * edge_m) / apart_m))
    frames = np.tile(np.eye(4), (count + 1, 1, 1))
    frames[:, 0, 3] = np.linspace(edge_m, length_m - edge_m, count + 1)
    return stamped(mesh, frames)


def _frame(start: Point2, end: Point2) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """x along, y to its left, z up."""
    a = atan2(end.y - start.y, end.x - start.x)
    along: Sequence[float] = (cos(a), sin(a))
    return wall_frame(along, (-along[1], along[0]), (start.x, start.y, 0.0))


def _length_m(start: Point2, end: Point2) -> float:
    return hypot(end.x - start.x, end.y - start.y)
