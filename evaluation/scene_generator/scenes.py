"""From a plan to a scene document, the same one for the same plan and seed.

Every scene is sound by construction: objects only where their class allows, nothing in the ring in which the drone
laps, and the drone starts in the open in front of its facade.
"""

import math
import zlib

import numpy as np

from contracts.geometry import Point3
from contracts.scene import BalconyPlan, Building, Light, Scene, Start
from contracts.scene_layout import columns_of, facades
from contracts.sim import Catalogue
from evaluation.scene_generator.footprints import (
    Corner,
    corners_between,
    difficulty_of,
    distance_to_outline,
    outline,
    points,
)
from evaluation.scene_generator.placement import Placer, facade_at
from evaluation.scene_generator.scene_plan import Difficulty, SceneSpec, UnbuildableScene
from evaluation.scene_generator.style_families import FAMILIES, Dress, dress
from evaluation.scene_generator.surroundings import surround

START_Z_M = 1.2
_START_ROOM_M = 5.0


def build_scene(spec: SceneSpec, seed: int, catalogue: Catalogue, *, building_seed: int | None = None) -> Scene:
    """The scene of a plan; `catalogue` says which things there are and where they may stand.

    Scenes of one `building_seed` (without it: of one `seed`) and one plan share their buildings.

    Raises UnbuildableScene where the plan cannot stand: a class or colour the catalogue hasn't got, a facade without
    windows, a start that is hemmed in.
    """
    plan = outline(spec.footprint)
    if spec.start_facade >= len(plan):
        raise UnbuildableScene(f"a {spec.footprint.shape} has facades 0..{len(plan) - 1}, not {spec.start_facade}")
    standing = seed if building_seed is None else building_seed
    target = _target(spec, plan, _chance(standing, "target"))
    around = surround(spec, plan, _chance(standing, "around"))
    placer = Placer(spec, target, around.neighbours, catalogue, _chance(seed, "objects"))
    goal = placer.goal()
    decoys = tuple(placer.decoy(d) for d in spec.decoys)
    clutter = tuple(thing for _ in range(spec.clutter) if (thing := placer.clutter()) is not None)
    return Scene(
        name=spec.name,
        seed=seed,
        buildings=(target, *around.neighbours),
        target=target.id,
        objects=(goal, *decoys, *clutter),
        goal=goal.id,
        ground=around.ground,
        light=_light(spec, target, _chance(seed, "light")),
        start=_start(spec, plan, target),
    )


def scene_difficulty(spec: SceneSpec) -> Difficulty:
    """By the corners between the starting facade and the goal's, the shorter way round."""
    count = len(outline(spec.footprint))
    goal = (spec.start_facade - spec.goal.corners) % count
    return difficulty_of(corners_between(count, spec.start_facade, goal))


def _chance(seed: int, part: str) -> np.random.Generator:
    # one stream for each part, so that one tree more does not move the furniture
    return np.random.default_rng((seed, zlib.crc32(part.encode())))


def _target(spec: SceneSpec, plan: tuple[Corner, ...], rng: np.random.Generator) -> Building:
    family = spec.family or FAMILIES[spec.kind][int(rng.integers(len(FAMILIES[spec.kind])))]
    clothes = dress(spec.kind, family, spec.pagoda, rng)
    setback = 0.0
    if spec.pagoda:
        if spec.footprint.shape not in ("rectangle", "octagon"):
            raise UnbuildableScene(f"a pagoda sets back and needs a convex plan, not a {spec.footprint.shape}")
        setback = round(min(0.7, 0.2 * min(_spans(plan)) / max(1, spec.floors - 1)), 2)
    elif clothes.roof != "flat" and spec.footprint.shape not in ("rectangle", "l", "octagon"):
        clothes = clothes._replace(roof="flat")
    bare = Building(
        id="target",
        kind=spec.kind,
        footprint=points(plan, spec.rotation),
        floors=spec.floors,
        floor_height_m=clothes.floor_height_m,
        style=clothes.style,
        windows=clothes.windows,
        roof=clothes.roof,
        setback_m=setback,
    )
    return bare.model_copy(update={"balconies": _balconies(spec, bare, clothes)})


def _balconies(spec: SceneSpec, bare: Building, clothes: Dress) -> tuple[BalconyPlan, ...]:
    wanted = spec.balconies
    if wanted is None:
        return ()
    walls = range(len(bare.footprint)) if wanted.facades is None else wanted.facades
    return tuple(
        BalconyPlan(
            facades=(wall,),
            columns=tuple(range(wanted.first, columns_of(bare, wall), wanted.every)),
            depth_m=wanted.depth_m,
            railing=wanted.railing,
        )
        for wall in walls
        if columns_of(bare, wall) > wanted.first
    )[:16]


def _spans(plan: tuple[Corner, ...]) -> tuple[float, float]:
    xs, ys = [x for x, _ in plan], [y for _, y in plan]
    return max(xs) - min(xs), max(ys) - min(ys)


def _light(spec: SceneSpec, target: Building, rng: np.random.Generator) -> Light:
    sky = spec.sky or str(rng.choice(("clear", "cloudy", "overcast", "dusk"), p=(0.5, 0.3, 0.15, 0.05)))
    goal_wall = facades(target)[facade_at(target, spec.start_facade, spec.goal.corners)]
    start_wall = facades(target)[spec.start_facade]
    out = 0.6 * start_wall.normal[0] + goal_wall.normal[0], 0.6 * start_wall.normal[1] + goal_wall.normal[1]
    # from the side of the facades that matter, never straight on, so that their relief throws shadows
    azimuth = math.atan2(out[1], out[0]) + float(rng.choice((-1.0, 1.0))) * float(rng.uniform(0.25, 0.6))
    return Light(
        sun_azimuth=round(azimuth, 3),
        sun_elevation=round(float(rng.uniform(0.55, 0.95)), 3),
        sky=sky,
    )


def _start(spec: SceneSpec, plan: tuple[Corner, ...], target: Building) -> Start:
    wall = facades(target)[spec.start_facade]
    middle = tuple(wall.start[i] + wall.along[i] * wall.length_m / 2 for i in (0, 1))
    x, y = (middle[i] + wall.normal[i] * spec.start_distance_m for i in (0, 1))
    turned = tuple((p.x, p.y) for p in points(plan, spec.rotation))
    room = distance_to_outline((x, y), turned)
    if room < _START_ROOM_M:
        raise UnbuildableScene(
            f"the start before facade {spec.start_facade} of {spec.name} is {room:.1f} m from a wall; "
            f"it needs {_START_ROOM_M} m: choose an outer facade"
        )
    yaw = math.atan2(-wall.normal[1], -wall.normal[0])
    return Start(position=Point3(x=round(x, 3), y=round(y, 3), z=START_Z_M), yaw=round(yaw, 6))
