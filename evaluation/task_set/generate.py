"""Task sets: buildings, goals, requests, and the proof by flight that each delivery can be made.

Everything follows from the seed: building i takes seed + 1000 i, its tasks the seeds after that. The shipped set takes
the seeds from 200,000; what a model is fitted to takes those below.
"""

import zlib
from collections.abc import Callable, Sequence
from typing import NamedTuple, get_args

import numpy as np

from contracts.geometry import Point3
from contracts.scene import Scene, WindowPlace
from contracts.sim import Catalogue, CatalogueEntry
from evaluation.scene_generator.building_plans import BuildingPlan, building_plan, buildings_for
from evaluation.scene_generator.footprints import corners_between, difficulty_of
from evaluation.scene_generator.scene_plan import DecoySpec, Difficulty, GoalSpec, SceneSpec, UnbuildableScene
from evaluation.scene_generator.scenes import build_scene
from evaluation.sim_client import SimClient
from evaluation.task_set.proof import NotSolvable, Proof, prove
from evaluation.task_set.requests import Fill, draw_parcel, filled, noun_phrase, templates
from evaluation.task_set.shortest import FIRST, goal_slot
from evaluation.task_set.task import Category, Task

MAX_TASKS = 2_000
MAX_SEED = 2**30
_SEEDS_PER_BUILDING = 1_000
ATTEMPTS = 50
_FIRST_ATTEMPTS = 18
_CORNERS: dict[Difficulty, tuple[int, ...]] = {"easy": (0, 1), "moderate": (2, 3), "hard": (4, 5, 6)}
CATEGORIES: tuple[Category, ...] = get_args(Category)


class CannotGenerate(RuntimeError):
    """No solvable task was found where one was wanted; the message says for which building and why the last failed."""


class Wanted(NamedTuple):
    """One task still to be made: task number `number` of the set, `rank` among its building's."""

    number: int
    building: BuildingPlan
    rank: int
    category: Category


def wanted_tasks(seed: int, count: int) -> list[Wanted]:
    """Which building, and which category, each task of a set gets. Raises ValueError for a count or seed out of
    bounds."""
    if not 1 <= count <= MAX_TASKS:
        raise ValueError(f"a set has 1 to {MAX_TASKS} tasks, not {count}")
    if not 0 <= seed <= MAX_SEED:
        raise ValueError(f"the seed must lie in 0..{MAX_SEED}, not {seed}")
    plans = [building_plan(i, seed + i * _SEEDS_PER_BUILDING) for i in range(buildings_for(count))]
    shares = [count // len(plans) + (i < count % len(plans)) for i in range(len(plans))]
    rng = np.random.default_rng((seed, zlib.crc32(b"categories")))
    wanted: list[Wanted] = []
    for plan, share in zip(plans, shares, strict=True):
        turn = int(rng.integers(len(CATEGORIES)))
        for rank in range(share):
            category = CATEGORIES[(turn + rank) % len(CATEGORIES)]
            wanted.append(Wanted(len(wanted) + 1, plan, rank, category))
    return wanted


def make_task(wanted: Wanted, prefix: str, simulator: SimClient, catalogue: Catalogue) -> Task:
    """The first solvable draw. Raises CannotGenerate, SimulatorFault."""
    plan = wanted.building
    why = ""
    for attempt in range(ATTEMPTS):
        seed = seed_of(plan, wanted.rank, attempt)
        # a building without balconies has no place for furniture: later attempts take another category
        category = CATEGORIES[(CATEGORIES.index(wanted.category) + attempt // 3) % len(CATEGORIES)]
        try:
            spec = draw_spec(plan, wanted, f"{prefix}-{wanted.number:03d}", category, seed, catalogue)
            scene = build_scene(spec, seed, catalogue, building_seed=plan.seed)
            proof = prove(scene, simulator, FIRST)
        except (UnbuildableScene, NotSolvable) as error:
            why = str(error)
            continue
        return task_of(spec, scene, seed, plan, category, proof, catalogue)
    raise CannotGenerate(f"task {wanted.number} at {plan.name}: none of {ATTEMPTS} draws can be flown, last: {why}")


def seed_of(plan: BuildingPlan, rank: int, attempt: int) -> int:
    """A seed for every attempt of a building's tasks, of which there are fewer than twenty. Most tasks are found in the
    first attempts; the others go on in a range of their own."""
    if attempt < _FIRST_ATTEMPTS:
        return plan.seed + 1 + 20 * rank + attempt
    return plan.seed + 401 + (ATTEMPTS - _FIRST_ATTEMPTS) * (rank % 18) + attempt - _FIRST_ATTEMPTS


def generate(wanted: Sequence[Wanted], prefix: str, simulator: SimClient, made: Callable[[], None]) -> list[Task]:
    """A whole set, in the order of its numbers; `made` is called after each. Raises CannotGenerate, SimulatorFault."""
    catalogue = simulator.catalogue()
    tasks = []
    for one in wanted:
        tasks.append(make_task(one, prefix, simulator, catalogue))
        made()
    return tasks


def draw_spec(
    plan: BuildingPlan, wanted: Wanted, name: str, category: Category, seed: int, catalogue: Catalogue
) -> SceneSpec:
    """One draw of a task's scene. Raises UnbuildableScene."""
    rng = np.random.default_rng((seed, zlib.crc32(b"task")))
    entries = sorted((e for e in catalogue.entries if e.category == category and set(e.places) != {"free"}), key=_kind)
    if not entries:
        raise UnbuildableScene(f"the catalogue has no {category} that stand at a window")
    entry = entries[int(rng.integers(len(entries)))]
    colour = entry.colours[int(rng.integers(len(entry.colours)))]
    corners = [c for c in _CORNERS[plan.difficulty(wanted.rank)] if c <= plan.corners // 2]
    return SceneSpec(
        name=name,
        kind=plan.sketch.kind,
        footprint=plan.footprint,
        floors=plan.floors,
        family=plan.family,
        pagoda=plan.sketch.pagoda,
        balconies=plan.balconies,
        goal=GoalSpec(
            kind=entry.kind,
            colour=colour,
            floor=int(rng.integers(min(2, plan.floors), plan.floors + 1)),
            corners=corners[int(rng.integers(len(corners)))],
            scale=round(float(rng.uniform(0.9, 1.3)), 2),
        ),
        decoys=_decoys(plan, entry, colour, catalogue, rng),
        clutter=int(rng.integers(3, 14)),
        surroundings=plan.surroundings,
        start_facade=int(rng.integers(plan.corners)),
        start_distance_m=round(float(rng.uniform(8, 10)), 1),
        rotation=plan.rotation,
    )


def _kind(entry: CatalogueEntry) -> str:
    return entry.kind


def _decoys(
    plan: BuildingPlan, entry: CatalogueEntry, colour: str, catalogue: Catalogue, rng: np.random.Generator
) -> tuple[DecoySpec, ...]:
    decoys: list[DecoySpec] = []
    if len(entry.colours) > 1 and rng.random() < 0.65:
        decoys.append(DecoySpec(like="colour"))
    if any(e.kind != entry.kind and colour in e.colours for e in catalogue.entries) and rng.random() < 0.65:
        decoys.append(DecoySpec(like="kind"))
    if plan.floors >= 10 and rng.random() < 0.5:
        decoys.append(DecoySpec(like="floor"))
    if plan.surroundings.neighbours != "none" and rng.random() < 0.5:
        decoys.append(DecoySpec(like="neighbour"))
    return tuple(decoys)


def task_of(
    spec: SceneSpec,
    scene: Scene,
    seed: int,
    plan: BuildingPlan,
    category: Category,
    proof: Proof,
    catalogue: Catalogue,
) -> Task:
    """The task of a scene that was proved."""
    rng = np.random.default_rng((seed, zlib.crc32(b"request")))
    known = {e.kind: e for e in catalogue.entries}
    thing = noun_phrase(known[spec.goal.kind], spec.goal.colour)
    others = [noun_phrase(known[o.kind], o.colour) for o in scene.objects if o.id != scene.goal]
    decoy = next((phrase for phrase in others if phrase != thing), "black bicycle")
    floors = [f for f in range(1, max(spec.floors, 3) + 1) if f != spec.goal.floor]
    template = templates()[int(rng.integers(len(templates())))]
    fill = Fill(spec.goal.floor, thing, floors[int(rng.integers(len(floors)))], decoy, draw_parcel(rng))
    goal = next(o for o in scene.objects if o.id == scene.goal)
    assert isinstance(goal.place, WindowPlace)
    slot = goal_slot(scene)
    corners = corners_between(plan.corners, spec.start_facade, goal.place.facade)
    x, y, z = (round(v, 3) for v in slot.centre)
    return Task(
        id=spec.name,
        seed=seed,
        request=filled(template, fill),
        template=template.id,
        style=template.style,
        scene=scene,
        building=plan.name,
        building_kind=spec.kind,
        footprint=spec.footprint.shape,
        floors=spec.floors,
        floor=spec.goal.floor,
        object=thing,
        object_kind=spec.goal.kind,
        object_colour=spec.goal.colour,
        category=category,
        target=Point3(x=x, y=y, z=z),
        target_height_m=z,
        floor_height_m=scene.building(scene.target).floor_height_m,
        corners=corners,
        difficulty=difficulty_of(corners),
        shortest_horizontal_m=round(proof.way.horizontal_m, 3),
        shortest_spatial_m=round(proof.way.spatial_m, 3),
    )
