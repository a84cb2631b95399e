"""Roofs of ordinary houses: flat with a parapet, gable and hip. Each gives what is drawn; it can all be bumped into."""

import numpy as np
from numpy.typing import NDArray

from contracts.scene import FacadeStyle
from services.sim.geometry.mesh import Colour, Mesh, concatenate, make, mixed
from services.sim.geometry.outlines import Plan, Rectangle, grown, is_convex, rectangles, swept
from services.sim.geometry.solids import box, cylinder, polygon, prism, quad
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.tubes import rod

EAVES_M = 0.55


def flat_roof(plan: Plan, z: float, style: FacadeStyle, textures: TextureSet, parapet_m: float = 0.7) -> list[Mesh]:
    """A gravelled deck behind a parapet with a coping that juts out like a cornice."""
    wall = textures.layer(style.wall)
    inner = grown(plan, -0.25)
    top = z + parapet_m
    parts = [polygon(plan, z, "#8d8b86", textures.layer("gravel"))]
    parts += swept(plan, [(0.0, z), (0.0, top)], style.wall_colour, wall)
    parts += swept(plan, [(0.0, z + 0.02), (0.10, z + 0.08), (0.16, z + 0.20), (0.0, z + 0.20)], style.trim_colour)
    parts += swept(plan, [(0.0, top - 0.10), (0.09, top - 0.10), (0.09, top), (-0.25, top)], style.trim_colour)
    for i in range(len(plan)):
        a, b = inner[i], inner[(i + 1) % len(plan)]
        parts.append(quad([(*b, z), (*a, z), (*a, top), (*b, top)], style.wall_colour, wall))
    return parts


def roof_furniture(plan: Plan, z: float, rng: np.random.Generator, big: bool, textures: TextureSet) -> list[Mesh]:
    """What stands on a flat roof: the stair's head, air conditioners, a mast."""
    parts: list[Mesh] = []
    boxes = sorted(rectangles(plan), key=lambda r: -r.length_m * r.width_m)
    middle = boxes[0].middle if boxes else plan.mean(axis=0)
    along = boxes[0].along if boxes else np.array([1.0, 0.0])
    room = (boxes[0].length_m, boxes[0].width_m) if boxes else (6.0, 6.0)
    yaw = float(np.arctan2(along[1], along[0]))

    def put(mesh: Mesh, x: float, y: float) -> None:
        across = np.array([-along[1], along[0]])
        at = middle + along * x + across * y
        parts.append(mesh.transformed(yaw=yaw, move=(float(at[0]), float(at[1]), z)))

    w, d, h = (4.5, 3.5, 2.8) if big else (3.0, 2.4, 2.3)
    if room[0] > w + 3 and room[1] > d + 3:
        x = float(rng.uniform(-0.25, 0.25)) * room[0]
        head = concatenate(
            [
                box((w, d, h), (0, 0, h / 2), "#bcb9b2", textures.layer("plaster"), without=("-z",)),
                box((w + 0.3, d + 0.3, 0.15), (0, 0, h + 0.07), "#84837f"),
                box((0.9, 0.06, 2.0), (0.4, -d / 2 - 0.02, 1.0), "#5c6266"),
            ]
        )
        put(head, x, 0.0)
        if big:
            put(cylinder(0.06, 5.0, (0, 0, h), 6, "#9a9da0"), x + 1.0, 0.4)
            put(box((2.4, 1.6, 1.8), (0, 0, 0.9), "#a9adae", textures.layer("metal")), -x - 1.5, 0.6)
    for k in range(int(rng.integers(2, 5))):
        unit = concatenate(
            [
                box((0.9, 0.7, 0.75), (0, 0, 0.5), "#d5d6d4"),
                box((0.5, 0.02, 0.5), (0, -0.36, 0.5), "#4a4d50"),
                box((0.9, 0.5, 0.12), (0, 0, 0.06), "#6d6f70"),
            ]
        )
        x, y = (k / 4 - 0.4) * (room[0] - 3), (-1 if k % 2 else 1) * (room[1] / 2 - 1.4)
        put(unit, float(x), float(y))
    return parts


def pitched_roof(
    plan: Plan, z: float, kind: str, slope: float, style: FacadeStyle, textures: TextureSet, colour: Colour, layer: int
) -> list[Mesh] | None:
    """Gable or hip over each rectangle of the plan, or a tent over a convex one; None where neither can be."""
    wings = rectangles(plan)
    if wings:
        return [m for wing in wings for m in _wing(wing, z, kind, slope, style, textures, colour, layer)]
    if is_convex(plan):
        return _tent(plan, z, slope, style, colour, layer)
    return None


def ridge_m(plan: Plan, slope: float) -> float:
    """How high a pitched roof rises over its walls."""
    wings = rectangles(plan)
    width = max((w.width_m for w in wings), default=float(np.ptp(plan, axis=0).min()))
    return width / 2 * slope


def _wing(
    wing: Rectangle,
    z: float,
    kind: str,
    slope: float,
    style: FacadeStyle,
    textures: TextureSet,
    colour: Colour,
    layer: int,
) -> list[Mesh]:
    e, thick = EAVES_M, 0.16
    half, run = wing.length_m / 2, wing.width_m / 2
    rise, low = run * slope, z - e * slope
    out_y = run + e
    hip = kind == "hip"
    out_x = half + (e if hip else 0.4)
    end = max(out_x - out_y, 0.0) if hip else out_x
    peak = z + rise + thick
    if hip and out_x < out_y:
        peak = low + thick + out_x * slope
    down = low + thick
    parts = []
    for s in (-1, 1):
        a, b = (-out_x, out_x) if s < 0 else (out_x, -out_x)
        c, d = (end, -end) if s < 0 else (-end, end)
        corners = [(a, s * out_y, down), (b, s * out_y, down), (c, 0, peak), (d, 0, peak)]
        parts.append(_slope(wing, corners, colour, layer))
        if hip:
            side = [
                (-s * out_x, s * out_y, down),
                (-s * out_x, -s * out_y, down),
                (-s * end, 0, peak),
                (-s * end, 0, peak),
            ]
            parts.append(_slope(wing, side, colour, layer))
        else:
            parts += _gable(wing, s, half, run, z, rise, style, textures)
            rake = [
                (s * out_x, -s * out_y, low),
                (s * out_x, 0, peak - thick),
                (s * out_x, 0, peak),
                (s * out_x, -s * out_y, down),
            ]
            parts.append(_placed(wing, rake, style.trim_colour))
            rake = [
                (s * out_x, 0, peak - thick),
                (s * out_x, s * out_y, low),
                (s * out_x, s * out_y, down),
                (s * out_x, 0, peak),
            ]
            parts.append(_placed(wing, rake, style.trim_colour))
        fascia = [(a, s * out_y, low), (b, s * out_y, low), (b, s * out_y, down), (a, s * out_y, down)]
        parts.append(_placed(wing, fascia, style.trim_colour))
        if hip:
            t = s * out_x
            fascia = [(t, -s * out_y, low), (t, s * out_y, low), (t, s * out_y, down), (t, -s * out_y, down)]
            parts.append(_placed(wing, fascia, style.trim_colour))
    # the underside of the eaves
    under = [(-out_x, out_y, low), (out_x, out_y, low), (out_x, -out_y, low), (-out_x, -out_y, low)]
    if hip:
        parts.append(_placed(wing, under, style.trim_colour).shaded(0.72))
    else:
        for s in (-1, 1):
            a, b = (out_x, -out_x) if s < 0 else (-out_x, out_x)
            soffit = [(a, s * out_y, low), (b, s * out_y, low), (b, 0, peak - thick), (a, 0, peak - thick)]
            parts.append(_placed(wing, soffit, style.trim_colour).shaded(0.72))
    ridge = wing.place([(-end, 0, peak), (end, 0, peak)])
    if end > 0.1:
        parts.append(rod(ridge[0].tolist(), ridge[1].tolist(), 0.12, 6).recoloured(mixed(colour, "#000000", 0.25)))
    if hip:
        for sx in (-1, 1):
            for sy in (-1, 1):
                line = wing.place([(sx * out_x, sy * out_y, down), (sx * end, 0, peak)])
                parts.append(
                    rod(line[0].tolist(), line[1].tolist(), 0.09, 5).recoloured(mixed(colour, "#000000", 0.25))
                )
    return parts


def _gable(
    wing: Rectangle, s: int, half: float, run: float, z: float, rise: float, style: FacadeStyle, textures: TextureSet
) -> list[Mesh]:
    """The triangle of wall under a gable, with a round window."""
    p = wing.place([(s * half, -s * run, z), (s * half, s * run, z), (s * half, 0, z + rise)])
    normal = np.array([*(wing.along * s), 0.0])
    uv = np.array([(-run, 0), (run, 0), (0, rise)])
    parts = [make(p, [(0, 1, 2)], np.tile(normal, (3, 1)), uv, style.wall_colour, textures.layer(style.wall))]
    if rise > 1.6:
        n, r = 12, min(0.45, rise * 0.18)
        for radius, out, colour, layer in (
            (r + 0.1, 0.02, style.trim_colour, 0),
            (r, 0.03, "#ffffff", textures.layer("pane_dark")),
        ):
            a = np.linspace(0, 2 * np.pi, n, endpoint=False)
            disc = np.column_stack(
                [np.full(n, s * (half + out)), s * radius * np.cos(a), z + rise * 0.38 + radius * np.sin(a)]
            )
            fan = [(0, k, k + 1) for k in range(1, n - 1)]
            flat = np.column_stack([0.5 + 0.5 * np.cos(a), 0.5 + 0.5 * np.sin(a)])
            parts.append(make(wing.place(disc), fan, np.tile(normal, (n, 1)), flat, colour, layer))
    return parts


def _slope(wing: Rectangle, corners: list[tuple[float, float, float]], colour: Colour, layer: int) -> Mesh:
    """A roof plane: u along the eaves, v up the slope."""
    p = wing.place(corners)
    eaves = p[1] - p[0]
    eaves /= np.linalg.norm(eaves)
    normal = np.cross(p[1] - p[0], (p[2] + p[3]) / 2 - p[0])
    normal /= np.linalg.norm(normal)
    up = np.cross(normal, eaves)
    uv = np.column_stack([(p - p[0]) @ eaves, (p - p[0]) @ up])
    return make(p, [(0, 1, 2), (0, 2, 3)], np.tile(normal, (4, 1)), uv, colour, layer)


def _placed(wing: Rectangle, corners: list[tuple[float, float, float]], colour: Colour) -> Mesh:
    return quad(wing.place(corners), colour)


def _tent(plan: Plan, z: float, slope: float, style: FacadeStyle, colour: Colour, layer: int) -> list[Mesh]:
    """Planes rising from every edge to one point above the middle."""
    eaves = grown(plan, EAVES_M)
    low, down = z - EAVES_M * slope, z - EAVES_M * slope + 0.16
    middle = plan.mean(axis=0)
    nearest = min(_distance(middle, a, b) for a, b in zip(eaves, np.roll(eaves, -1, axis=0), strict=True))
    tip = np.array([*middle, down + nearest * slope])
    parts = [polygon(eaves, low, style.trim_colour, up=False).shaded(0.72)]
    parts += swept(eaves, [(0.0, low), (0.0, down)], style.trim_colour)
    for a, b in zip(eaves, np.roll(eaves, -1, axis=0), strict=True):
        p = np.array([(*a, down), (*b, down), tip])
        normal = np.cross(p[1] - p[0], p[2] - p[0])
        normal /= np.linalg.norm(normal)
        u = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
        uv = np.column_stack([(p - p[0]) @ u, (p - p[0]) @ np.cross(normal, u)])
        parts.append(make(p, [(0, 1, 2)], np.tile(normal, (3, 1)), uv, colour, layer))
        parts.append(rod((*a, down), tip.tolist(), 0.09, 5).recoloured(mixed(colour, "#000000", 0.25)))
    return parts


def _distance(p: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """From a point to the line through a and b, (2,) each."""
    (ux, uy), (vx, vy) = b - a, p - a
    return float(abs(ux * vy - uy * vx) / np.hypot(ux, uy))


def chimney(at: tuple[float, float], z0: float, z1: float, textures: TextureSet) -> Mesh:
    """Of brick, with a cap and two pots."""
    x, y = at
    return concatenate(
        [
            prism(
                [(x - 0.4, y - 0.3), (x + 0.4, y - 0.3), (x + 0.4, y + 0.3), (x - 0.4, y + 0.3)],
                z0,
                z1,
                "#9a5f4a",
                textures.layer("brick"),
            ),
            box((0.95, 0.75, 0.14), (x, y, z1), "#a9a39a"),
            cylinder(0.12, 0.35, (x - 0.18, y, z1 + 0.07), 8, "#b06a4e"),
            cylinder(0.12, 0.35, (x + 0.18, y, z1 + 0.07), 8, "#b06a4e"),
        ]
    )
