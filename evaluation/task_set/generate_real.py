"""Task sets of a mixture: buildings and goals of a fresh set, in the weather, light and starts that it draws.

Everything follows from the seed.
"""

import zlib
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from contracts.scene import Scene
from contracts.sim import Catalogue
from evaluation.scene_generator.building_plans import BuildingPlan
from evaluation.scene_generator.placement import entry_of
from evaluation.scene_generator.scene_plan import SceneSpec, UnbuildableScene
from evaluation.scene_generator.scenes import build_scene
from evaluation.sim_client import SimClient, SimulatorFault
from evaluation.task_set.generate import ATTEMPTS, CATEGORIES, CannotGenerate, Wanted, draw_spec, seed_of, task_of
from evaluation.task_set.mixture import Mixture
from evaluation.task_set.proof import NotSolvable, prove
from evaluation.task_set.real_world import RealScene, real_scene, with_twin
from evaluation.task_set.requests import noun_phrase
from evaluation.task_set.shortest import SECOND
from evaluation.task_set.stranger_requests import Wanted as Asked
from evaluation.task_set.stranger_requests import filled_by_stranger, fits, stranger_templates
from evaluation.task_set.task import Task

_LOW = ("villa", "low_rise")
_LOW_SHARE = 0.5
"""Of a set's buildings that can be of one storey."""


_TWIN_ATTEMPTS = 12
"""After so many a building has no two windows that a request could mean: its object is there once."""

Kind = Literal["there", "absent", "twin"]


class _Drawn(NamedTuple):
    plan: BuildingPlan
    spec: SceneSpec
    real: RealScene
    kind: Kind


def generate_real(
    wanted: Sequence[Wanted], prefix: str, simulator: SimClient, mixture: Mixture, made: Callable[[], None]
) -> list[Task]:
    """A whole set, in the order of its numbers; `made` is called after each. Raises CannotGenerate, SimulatorFault."""
    catalogue = simulator.catalogue()
    tasks = []
    for one in wanted:
        tasks.append(make_real_task(one, prefix, simulator, catalogue, mixture))
        made()
    return tasks


def make_real_task(wanted: Wanted, prefix: str, simulator: SimClient, catalogue: Catalogue, mixture: Mixture) -> Task:
    """The first draw that can be flown. Raises CannotGenerate, SimulatorFault."""
    why = ""
    kind = _kind(wanted, mixture)
    for attempt in range(ATTEMPTS):
        if kind == "twin" and attempt == _TWIN_ATTEMPTS:
            kind = "there"
        seed = seed_of(wanted.building, wanted.rank, attempt)
        category = CATEGORIES[(CATEGORIES.index(wanted.category) + attempt // 3) % len(CATEGORIES)]
        rng = np.random.default_rng((seed, zlib.crc32(b"real")))
        try:
            name = f"{prefix}-{wanted.number:03d}"
            drawn = _drawn(wanted._replace(category=category), name, seed, catalogue, mixture, kind, rng)
            proof = prove(drawn.real.scene, simulator, SECOND)
            scene = _as_drawn(drawn, rng)
        except (UnbuildableScene, NotSolvable) as error:
            why = str(error)
            continue
        except SimulatorFault as error:
            if "bad_start" not in str(error):
                raise
            why = str(error)
            continue
        task = task_of(drawn.spec, drawn.real.scene, seed, drawn.plan, category, proof, catalogue)
        changes: dict[str, object] = {
            "scene": scene,
            "start": drawn.real.start,
            "ambiguous": drawn.kind == "twin",
            "clearance_m": proof.way.clearance_m,
        }
        if mixture.requests == "strangers":
            changes |= _asked(drawn, catalogue, rng)
        return task.model_copy(update=changes)
    raise CannotGenerate(
        f"task {wanted.number} at {wanted.building.name}: none of {ATTEMPTS} draws can be flown, last: {why}"
    )


def _kind(wanted: Wanted, mixture: Mixture) -> Kind:
    """Drawn once for a task, or draws that can't be built would shift the mixture's shares."""
    rng = np.random.default_rng((seed_of(wanted.building, wanted.rank, 0), zlib.crc32(b"kind")))
    share = rng.random()
    if share < mixture.absent:
        return "absent"
    return "twin" if share < mixture.absent + mixture.twins else "there"


def _drawn(
    wanted: Wanted,
    name: str,
    seed: int,
    catalogue: Catalogue,
    mixture: Mixture,
    kind: Kind,
    rng: np.random.Generator,
) -> _Drawn:
    plan = wanted.building
    low = plan.sketch.kind in _LOW and not plan.sketch.pagoda
    if rng.random() < mixture.one_storey / _LOW_SHARE and low:
        plan = plan._replace(floors=1, balconies=None)
    spec = draw_spec(plan, wanted, name, wanted.category, seed, catalogue)
    if rng.random() < mixture.first_floor and plan.floors > 1:
        spec = spec.model_copy(update={"goal": spec.goal.model_copy(update={"floor": 1})})
    scene = build_scene(spec, seed, catalogue, building_seed=plan.seed)
    real = real_scene(scene, spec, mixture, rng)
    return _Drawn(plan, spec, real, kind)


def _as_drawn(drawn: _Drawn, rng: np.random.Generator) -> Scene:
    """The scene with the twin, or without the object. Raises UnbuildableScene."""
    scene = drawn.real.scene
    if drawn.kind == "twin":
        return with_twin(scene, rng)
    if drawn.kind == "absent":
        left = tuple(thing for thing in scene.objects if thing.id != scene.goal)
        return scene.model_copy(update={"objects": left, "goal": None})
    return scene


def _asked(drawn: _Drawn, catalogue: Catalogue, rng: np.random.Generator) -> dict[str, str]:
    """The request as a stranger puts it, and whose template it is."""
    goal, scene = drawn.spec.goal, drawn.real.scene
    thing = noun_phrase(entry_of(catalogue, goal.kind), goal.colour)
    others = [noun_phrase(entry_of(catalogue, o.kind), o.colour) for o in scene.objects if o.id != scene.goal]
    decoy = next((phrase for phrase in others if phrase != thing), "black bicycle")
    floors = [floor for floor in range(1, max(drawn.plan.floors, 3) + 1) if floor != goal.floor]
    asked = Asked(
        goal.floor, entry_of(catalogue, goal.kind), goal.colour, floors[int(rng.integers(len(floors)))], decoy
    )
    templates = [template for template in stranger_templates() if fits(template, asked)]
    template = templates[int(rng.integers(len(templates)))]
    return {"request": filled_by_stranger(template, asked), "template": template.id, "style": template.style}
