"""Temple roofs: tiers of curved eaves with upturned corners, the hip-and-gable of a hall, spires and brackets."""

import numpy as np
from numpy.typing import NDArray

from contracts.scene import FacadeStyle
from services.sim.geometry.mesh import Colour, Mesh, concatenate, make, mixed
from services.sim.geometry.outlines import Plan, Rectangle, grown, rectangles
from services.sim.geometry.parts import stamped, wall_frame
from services.sim.geometry.solids import box, cylinder, ellipsoid, lathe
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.tubes import tube

OVERHANG_M = 1.25
THICK_M = 0.16
_GOLD = "#c9a24a"


def skirt(
    plan: Plan,
    inner: Plan,
    z_eaves: float,
    z_top: float,
    colour: Colour,
    layer: int,
    style: FacadeStyle,
    overhang_m: float = OVERHANG_M,
    lift_m: float = 0.55,
) -> list[Mesh]:
    """A ring of roof from eaves round `plan` up to `inner`, hollow in section, with its corners swept up."""
    outer = grown(plan, overhang_m)
    n, m = 10, 4
    s = np.linspace(0, 1, n + 1)
    t = np.linspace(0, 1, m + 1)[:, None]
    curl = np.abs(2 * s - 1) ** 4
    dark = mixed(colour, "#000000", 0.35)
    parts = []
    for i in range(len(plan)):
        j = (i + 1) % len(plan)
        a, b = outer[i], outer[j]
        # the eaves bend outwards towards the corners as they rise
        push = curl[:, None] * np.where(s[:, None] < 0.5, a - plan[i], b - plan[j]) * 0.16
        low = a + (b - a) * s[:, None] + push
        high = inner[i] + (inner[j] - inner[i]) * s[:, None]
        xy = low[None] + (high - low)[None] * t[..., None]
        z = z_eaves + curl * lift_m * (1 - t) ** 2 + (z_top - z_eaves) * t**1.45
        top = np.concatenate([xy, (z + THICK_M)[..., None]], -1)
        under = np.concatenate([xy, z[..., None]], -1)
        parts.append(_sheet(top, colour, layer))
        parts.append(_sheet(under[:, ::-1], mixed(style.wall_colour, "#3a2a20", 0.55), 0))
        parts.append(_sheet(np.stack([under[0], top[0]]), _edge_colour(style), 0))
        ridge = top[:, 0] + np.array([0, 0, 0.05])
        tip = ridge[0] + (ridge[0] - ridge[1]) * 0.10 + np.array([0, 0, 0.28])
        parts.append(tube(np.vstack([tip, ridge]), [0.05, *([0.10] * (m + 1))], 5, dark))
    return parts


def _edge_colour(style: FacadeStyle) -> Colour:
    return mixed(style.trim_colour, "#8a6a3c", 0.35)


def _sheet(p: NDArray[np.float64], colour: Colour, layer: int) -> Mesh:
    """A curved sheet of points (rows, columns, 3): columns run to the right seen from outside, rows upwards."""
    rows, columns, _ = p.shape
    du = np.gradient(p, axis=1)
    dv = np.gradient(p, axis=0) if rows > 2 else np.broadcast_to(p[1] - p[0], p.shape)
    normals = np.cross(du, dv)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    step_u = np.linalg.norm(np.diff(p[0], axis=0), axis=1)
    step_v = np.linalg.norm(np.diff(p[:, columns // 2], axis=0), axis=1)
    u = np.concatenate([[0], np.cumsum(step_u)])
    v = np.concatenate([[0], np.cumsum(step_v)])
    uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), -1)
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return make(p, faces, normals, uv, colour, layer)


def brackets(plan: Plan, z: float, style: FacadeStyle) -> list[Mesh]:
    """Rows of stepped timber brackets under the eaves, with a painted beam above the wall."""
    wood, light = mixed(style.frame_colour, "#000000", 0.1), style.trim_colour
    one = concatenate(
        [
            box((0.34, 0.13, 0.15), (0.17, 0, -0.34), wood, without=("-x",)),
            box((0.62, 0.13, 0.15), (0.31, 0, -0.16), light, without=("-x",)),
            box((0.16, 0.46, 0.12), (0.28, 0, -0.25), wood),
        ]
    )
    parts = []
    for a, b in zip(plan, np.roll(plan, -1, axis=0), strict=True):
        length = float(np.linalg.norm(b - a))
        u = (b - a) / length
        normal = (float(u[1]), float(-u[0]))
        count = max(2, round(length / 1.1))
        spots = [a + u * length * (k + 0.5) / count for k in range(count)]
        parts.append(stamped(one, [wall_frame(normal, u.tolist(), (*p, z)) for p in spots]))
        beam = box((0.12, length, 0.22), (0.06, length / 2, -0.52), style.accent_colour, without=("-x",))
        parts.append(stamped(beam, [wall_frame(normal, u.tolist(), (*a, z))]))
    return parts


def columns(spots: Plan, z0: float, z1: float, colour: Colour, radius_m: float = 0.2) -> list[Mesh]:
    """Round columns on stone feet."""
    shaft = concatenate(
        [
            cylinder(radius_m * 1.5, 0.22, (0, 0, 0), 10, "#b8b0a2"),
            lathe([(radius_m, 0.2), (radius_m * 0.92, z1 - z0)], 10, colour),
        ]
    )
    frames = [wall_frame((1, 0), (0, 1), (float(x), float(y), z0)) for x, y in spots]
    return [stamped(shaft, frames)] if frames else []


def pagoda_top(plan: Plan, z: float, style: FacadeStyle, textures: TextureSet) -> list[Mesh]:
    """The uppermost roof, drawn up to a point, and the spire with its rings."""
    middle = plan.mean(axis=0)
    radius = float(np.linalg.norm(plan - middle, axis=1).min())
    tip = z + 0.35 + radius * 0.85
    parts = skirt(
        plan, middle + (plan - middle) * 0.06, z - 0.25, tip, style.accent_colour, textures.layer("glazed_tile"), style
    )
    x, y = float(middle[0]), float(middle[1])
    parts.append(
        lathe(
            [(0.42, 0), (0.42, 0.25), (0.55, 0.35), (0.30, 0.6), (0.10, 0.75), (0.07, 3.6), (0.0, 3.9)], 10, _GOLD
        ).transformed(move=(x, y, tip - 0.05))
    )
    for k in range(6):
        parts.append(cylinder(0.36 - 0.04 * k, 0.10, (x, y, tip + 1.0 + 0.34 * k), 10, _GOLD))
    parts.append(ellipsoid(0.16, (x, y, tip + 3.55), 8, 5, _GOLD))
    return parts


def hall_roof(plan: Plan, z: float, style: FacadeStyle, textures: TextureSet) -> list[Mesh]:
    """Hip below, gable above, over a rectangle; a curved tent over other convex plans."""
    colour, layer = style.accent_colour, textures.layer("glazed_tile")
    wings = rectangles(plan)
    if not wings:
        middle = plan.mean(axis=0)
        reach = float(np.linalg.norm(plan - middle, axis=1).min())
        return skirt(plan, middle + (plan - middle) * 0.05, z - 0.3, z + reach * 0.7, colour, layer, style, 1.5, 0.7)
    parts: list[Mesh] = []
    for wing in wings:
        corners = wing.corners()
        inset = 0.30 * wing.width_m
        rise = inset * 0.62
        parts += skirt(corners, grown(corners, -inset), z - 0.35, z + rise, colour, layer, style, 1.5, 0.75)
        parts += _upper_gable(wing, inset, z + rise, style, colour, layer)
    return parts


def _upper_gable(wing: Rectangle, inset: float, z: float, style: FacadeStyle, colour: Colour, layer: int) -> list[Mesh]:
    half, run = wing.length_m / 2 - inset, wing.width_m / 2 - inset
    out, rise, m = half + 0.45, run * 0.95 + 0.4, 5
    t = np.linspace(0, 1, m + 1)
    y, dz = run * (1 - t) + 0.15 * (1 - t), -0.12 + rise * t**1.25
    parts = []
    for s in (-1, 1):
        x = np.linspace(-out, out, 3) if s < 0 else np.linspace(out, -out, 3)
        rows = np.stack(
            [np.column_stack([x, np.full(3, s * y[k]), np.full(3, z + dz[k] + THICK_M)]) for k in range(m + 1)]
        )
        sheet = wing.place(rows.reshape(-1, 3)).reshape(m + 1, 3, 3)
        parts.append(_sheet(sheet, colour, layer))
        low = sheet - np.array([0, 0, THICK_M])
        parts.append(_sheet(low[:, ::-1], mixed(style.wall_colour, "#3a2a20", 0.55), 0))
        for end in (0, 2):
            edge = np.stack([low[:, end], sheet[:, end]], 1)
            parts.append(_sheet(edge if end else edge[:, ::-1], _edge_colour(style), 0).two_sided())
    wood = mixed(style.frame_colour, "#000000", 0.15)
    for s in (-1, 1):
        rim = [(s * half, -run - 0.1, z - 0.3), (s * half, run + 0.1, z - 0.3), (s * half, 0, z + rise - 0.1)]
        p = wing.place(rim)
        face = make(p, [(0, 1, 2)], np.tile([*(wing.along * s), 0.0], (3, 1)), np.zeros((3, 2)), style.wall_colour)
        parts.append(face)
        board = wing.place([(s * (half + 0.04), 0, z + rise * k) for k in (0.0, 0.8)])
        parts.append(tube(board, 0.09, 4, wood))
        board = wing.place([(s * (half + 0.04), q * run * 0.5, z + rise * 0.28) for q in (-1, 1)])
        parts.append(tube(board, 0.09, 4, wood))
    dark = mixed(colour, "#000000", 0.3)
    top = z + rise + THICK_M
    parts.append(tube(wing.place([(-out, 0, top + 0.1), (out, 0, top + 0.1)]), 0.2, 6, dark))
    for s in (-1, 1):
        horn = [
            (s * (out - 0.5), 0, top + 0.2),
            (s * (out - 0.05), 0, top + 0.35),
            (s * (out + 0.1), 0, top + 0.75),
            (s * (out - 0.2), 0, top + 1.05),
        ]
        parts.append(tube(wing.place(horn), [0.22, 0.22, 0.15, 0.04], 6, dark))
    return parts
