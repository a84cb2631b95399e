"""One building of each kind: walls, entrance, bands, roof, and what makes the kind recognisable."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Building
from contracts.scene_layout import columns_of, facades, floor_outline, wall_height_m
from services.sim.geometry.entrances import DoorSpot, Toward, door_spot, entrance
from services.sim.geometry.facade import Dress, build_facades, chance, lightness
from services.sim.geometry.mesh import Mesh, concatenate, mixed
from services.sim.geometry.outlines import Plan, band, grown, plan_of, rectangles, swept
from services.sim.geometry.parts import Assembly, stamped, wall_frame
from services.sim.geometry.roofs import chimney, flat_roof, pitched_roof, ridge_m, roof_furniture
from services.sim.geometry.shopfronts import build_shopfronts
from services.sim.geometry.solids import box, polygon, prism
from services.sim.geometry.temples import brackets, columns, hall_roof, pagoda_top, skirt
from services.sim.geometry.textures import TextureSet
from services.sim.geometry.tubes import rod

Kept = set[tuple[int, int, int]]


def build_building(
    assembly: Assembly, part: int, building: Building, textures: TextureSet, seed: int, kept: Kept, toward: Toward
) -> None:
    """Draws the building and says what of it is solid. The entrance is in the wall that looks `toward` most."""
    rng = chance(seed, f"dress of {building.id}")
    dress = _dress(building, textures, rng)
    build_facades(assembly, part, building, textures, dress, seed, kept)
    plans = [plan_of(floor_outline(building, k)) for k in range(1, building.floors + 1)]
    top = wall_height_m(building)
    h = building.floor_height_m
    for k, plan in enumerate(plans if building.setback_m else plans[:1]):
        z1 = (k + 1) * h if building.setback_m else top
        assembly.block(part, prism(plan, k * h if k else -0.2, z1, bottom=False))
    spot = door_spot(building, toward)
    if spot is not None:
        assembly.draw(part, entrance(assembly, part, building, textures, spot))
    if building.kind == "cultural":
        roof = _temple(assembly, part, building, plans, textures, spot)
    else:
        assembly.draw(part, _bands(building, textures))
        roof = _roof(building, plans[0], textures, rng)
    assembly.draw(part, roof)
    assembly.block(part, roof)
    build_shopfronts(assembly, part, building)


def _dress(building: Building, textures: TextureSet, rng: np.random.Generator) -> Dress:
    style, kind = building.style, building.kind
    metal = "#3d4246" if lightness(style.frame_colour) > 0.5 else style.frame_colour
    drawn = rng.random()
    if kind == "cultural":
        return Dress("timber", None, None, None, metal)
    if kind == "high_rise":
        spandrel = mixed(style.wall_colour, style.accent_colour, 0.55) if style.wall in ("panel", "concrete") else None
        return Dress("plain", textures.layer("stone"), mixed(style.wall_colour, "#4b4b4b", 0.45), spandrel, metal)
    if kind == "villa":
        surround = "shutters" if building.windows.shape == "french" or drawn < 0.45 else "surround"
        return Dress(surround, None, None, None, metal)
    surround = "lintel" if style.wall == "brick" else "surround"
    ground = textures.layer("stone") if style.wall == "plaster" and drawn < 0.6 else None
    return Dress(surround, ground, mixed(style.wall_colour, "#6a6258", 0.30), None, metal)


@lru_cache(maxsize=32)
def _bands(building: Building, textures: TextureSet) -> Mesh:
    """Plinth, string courses between the floors, corner strips and rain pipes; whatever the scene."""
    plan = plan_of(floor_outline(building, 1))
    style, h = building.style, building.floor_height_m
    top = wall_height_m(building)
    low = min(0.45, max(building.windows.sill_m - 0.15, 0.1))
    parts = swept(
        plan,
        [(0.0, 0.0), (0.05, 0.0), (0.05, low - 0.05), (0.0, low)],
        mixed(style.wall_colour, "#55504a", 0.5),
        textures.layer("stone"),
    )
    if style.string_courses:
        floors = range(1, building.floors) if building.kind == "low_rise" else range(1, building.floors, 1)
        for k in floors:
            slim = building.kind != "low_rise"
            profile = (
                band(0.035, k * h - 0.10, k * h + 0.06)
                if slim
                else [
                    (0.0, k * h - 0.14),
                    (0.05, k * h - 0.10),
                    (0.05, k * h),
                    (0.10, k * h + 0.02),
                    (0.10, k * h + 0.08),
                    (0.0, k * h + 0.10),
                ]
            )
            parts += swept(plan, profile, style.trim_colour)
    n = len(plan)
    for i in range(n):
        before, here, after = plan[i - 1], plan[i], plan[(i + 1) % n]
        u = (after - here) / np.linalg.norm(after - here)
        v = (here - before) / np.linalg.norm(here - before)
        if v[0] * u[1] - v[1] * u[0] < 0.5:
            continue
        if building.kind == "low_rise" and style.wall in ("plaster", "stone", "brick"):
            for frame in (wall_frame((u[1], -u[0]), u, (*here, 0.0)), wall_frame((v[1], -v[0]), -v, (*here, 0.0))):
                parts.append(_quoins(top, style.trim_colour, frame, bool(frame[:2, 1] @ u < 0.99)))
        pipe = here + u * 0.55 + np.array([u[1], -u[0]]) * 0.09
        if building.kind != "high_rise":
            parts.append(rod((*pipe, 0.1), (*pipe, top), 0.05, 6).recoloured("#8a8c8b"))
    return concatenate(parts)


def _quoins(top: float, colour: str, frame: NDArray[np.float64], mirrored: bool) -> Mesh:
    """Corner stones, long and short in turn, on one side of a corner."""
    stones = []
    z, k = 0.45, 0
    while z + 0.34 < top:
        w = 0.52 if k % 2 else 0.32
        stones.append(box((0.03, w, 0.32), (0.015, w / 2, z + 0.17), colour, without=("-x",)))
        z, k = z + 0.36, k + 1
    mesh = concatenate(stones)
    if mirrored:
        # the local y axis runs against the wall's direction here, so the frame is left-handed: faces turn round
        mesh = mesh.transformed(scale=(1, -1, 1))
        frame = frame.copy()
        frame[:2, 1] *= -1
    return stamped(mesh, [frame])


def _roof(building: Building, plan: Plan, textures: TextureSet, rng: np.random.Generator) -> list[Mesh]:
    style, top = building.style, wall_height_m(building)
    if building.roof in ("gable", "hip", "hall", "pagoda"):
        slope = 0.72 if building.kind == "villa" else 0.5
        colour, layer = (
            style.accent_colour,
            textures.layer("roof_tile" if lightness(style.accent_colour) > 0.2 else "slate"),
        )
        kind = "gable" if building.roof == "gable" else "hip"
        roof = pitched_roof(plan, top, kind, slope, style, textures, colour, layer)
        if roof is not None:
            return roof + _chimneys(plan, top, slope, textures, rng, 1 if building.kind == "villa" else 2)
    tall = building.kind == "high_rise"
    deck = flat_roof(plan, top, style, textures, 1.0 if tall else 0.7)
    return deck + roof_furniture(plan, top, rng, tall, textures)


def _chimneys(
    plan: Plan, top: float, slope: float, textures: TextureSet, rng: np.random.Generator, count: int
) -> list[Mesh]:
    wings = rectangles(plan)
    if not wings:
        return []
    wing = max(wings, key=lambda w: w.length_m * w.width_m)
    parts = []
    for k in range(count):
        x = (k + float(rng.uniform(0.25, 0.4))) / count * wing.length_m - wing.length_m / 2
        y = wing.width_m * 0.14
        at = wing.place([(x, y, 0)])[0]
        parts.append(chimney((float(at[0]), float(at[1])), top + 0.3, top + ridge_m(plan, slope) + 0.7, textures))
    return parts


def _temple(
    assembly: Assembly, part: int, building: Building, plans: list[Plan], textures: TextureSet, spot: DoorSpot | None
) -> list[Mesh]:
    """Platform, columns, brackets, tiers of eaves and the roof on top."""
    style, h = building.style, building.floor_height_m
    colour, layer = style.accent_colour, textures.layer("glazed_tile")
    timber = mixed(style.frame_colour, "#8c2f22", 0.5) if style.wall == "lacquer" else style.frame_colour
    base = grown(plans[0], 1.5)
    platform = [
        *swept(base, [(0.0, 0.0), (0.0, 0.14), (-0.06, 0.20)], "#b9b1a2", textures.layer("stone")),
        polygon(grown(plans[0], 1.44), 0.20, "#c4bcad", textures.layer("paving")),
    ]
    assembly.draw(part, platform)
    assembly.block(part, prism(base, 0.0, 0.2))
    roof: list[Mesh] = []
    for k, plan in enumerate(plans):
        top = (k + 1) * h
        last = k == building.floors - 1
        details = columns(grown(plan, 0.03), k * h + (0.2 if k == 0 else 0.0), top - 0.3, timber, 0.19)
        if building.roof == "hall":
            engaged = _between_windows(building, k + 1)
            if k == 0 and spot is not None:
                engaged = engaged[np.linalg.norm(engaged - spot.frame[:2, 3], axis=1) > 0.9]
            details += columns(engaged, k * h + (0.2 if k == 0 else 0.0), top - 0.3, timber, 0.17)
        details += brackets(plan, top - 0.2, style)
        # the wall goes on a little behind the eaves, so that nobody looks into the roof
        details += swept(plan, [(0.0, top), (0.0, top + 0.16)], style.wall_colour)
        if building.setback_m and k:
            details += swept(plan, band(0.12, k * h + 0.62, k * h + 0.78), style.trim_colour)
        assembly.draw(part, details)
        if not last:
            # a roof of its own between two storeys, kept below the upper windows' sills
            upper = plans[k + 1]
            tier = skirt(plan, upper, top - 0.30, top + 0.50, colour, layer, style)
            assembly.draw(part, tier)
            assembly.block(part, tier)
    top = wall_height_m(building)
    if building.roof == "pagoda":
        roof = pagoda_top(plans[-1], top, style, textures)
    elif building.roof == "hall":
        roof = hall_roof(plans[-1], top, style, textures)
    else:
        roof = pitched_roof(plans[-1], top, "hip", 0.6, style, textures, colour, layer) or flat_roof(
            plans[-1], top, style, textures
        )
    return roof


def _between_windows(building: Building, floor: int) -> Plan:
    """Where engaged columns stand: in the middle of the wall between two windows, just before it."""
    spots = []
    for wall in facades(building, floor):
        count = columns_of(building, wall.number)
        for c in range(count - 1):
            t = wall.length_m / 2 + (c + 1 - count / 2) * building.windows.pitch_m
            spots.append([wall.start[i] + wall.along[i] * t + wall.normal[i] * 0.06 for i in (0, 1)])
    return plan_of(spots) if spots else np.zeros((0, 2))
