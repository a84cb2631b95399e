"""What is looked at: crowded streets, where every window before the camera has something, and streets as deliveries
meet them. A seed decides everything.
"""

from typing import Literal, NamedTuple

import numpy as np

from contracts.scene import Scene, SceneObject, WindowPlace
from contracts.scene_layout import WindowSlot, window_slots
from contracts.sim import Catalogue, CatalogueEntry
from evaluation.scene_generator.random_specs import random_spec
from evaluation.scene_generator.scene_plan import BalconySpec
from evaluation.scene_generator.scenes import build_scene
from training.looks import HELD_OUT_FAMILY, relit

SPARSE_SHARE = 0.25
MOST_OBJECTS = 200
FLOORS_AROUND = 4
_TALL_M = 1.25
_ALSO = 0.5
_BARE = 0.08
_PLACES: tuple[tuple[str, float], ...] = (("sill", 0.6), ("wall", 0.19), ("pane", 0.13), ("hang", 0.08))


class Street(NamedTuple):
    """`walls`: facades of the target that the camera should look at; `floor`: about which height."""

    scene: Scene
    walls: tuple[int, ...]
    floor: int
    crowded: bool


def street(catalogue: Catalogue, seed: int, *, held_out: bool = False, sparse: bool | None = None) -> Street:
    """One street to take pictures of. Raises UnbuildableScene."""
    rng = np.random.default_rng((seed, 0x57EE7))
    crowd = rng.random() >= SPARSE_SHARE if sparse is None else not sparse
    spec = random_spec(catalogue, seed)
    if spec.family == HELD_OUT_FAMILY and not held_out:
        spec = spec.model_copy(update={"family": "blue_panel"})
    if crowd:
        railings: tuple[Literal["bars", "glass", "solid"], ...] = ("bars", "glass", "solid")
        railing = railings[int(rng.choice(3, p=(0.55, 0.35, 0.1)))]
        balconies = BalconySpec(every=2, first=int(rng.integers(2)), railing=railing)
        spec = spec.model_copy(update={"clutter": 0, "decoys": ()})
        if spec.kind != "cultural":
            spec = spec.model_copy(update={"balconies": balconies})
    scene = relit(build_scene(spec, seed, catalogue), rng, held_out=held_out)
    target = scene.building(scene.target)
    goal = next(o for o in scene.objects if o.id == scene.goal).place
    assert isinstance(goal, WindowPlace)
    others = [w for w in range(len(target.footprint)) if w != goal.facade]
    more = (int(rng.choice(others)),) if others else ()
    walls = (goal.facade, *more)
    if not crowd:
        return Street(scene, walls, goal.floor, False)
    floor = int(rng.integers(1, target.floors + 1))
    things = _crowd(catalogue, window_slots(target), walls, floor, rng)
    return Street(scene.model_copy(update={"objects": things, "goal": None}), walls, floor, True)


def _crowd(
    catalogue: Catalogue, slots: list[WindowSlot], walls: tuple[int, ...], floor: int, rng: np.random.Generator
) -> tuple[SceneObject, ...]:
    near = [s for s in slots if s.facade in walls and abs(s.floor - floor) <= FLOORS_AROUND]
    order = [near[int(i)] for i in rng.permutation(len(near))]
    order.sort(key=lambda s: s.facade != walls[0])
    things: list[SceneObject] = []
    last: tuple[CatalogueEntry, str] | None = None
    for slot in order:
        if len(things) >= MOST_OBJECTS:
            break
        if rng.random() < _BARE:
            continue
        for place in _places(slot, rng):
            entry, colour = _thing(catalogue, slot, place, last, rng)
            last = entry, colour
            flat = place in ("wall", "pane") or entry.category == "posters"
            things.append(
                SceneObject(
                    id=f"thing-{len(things)}",
                    kind=entry.kind,
                    colour=colour,
                    place=WindowPlace.model_validate(
                        {
                            "building": slot.building,
                            "facade": slot.facade,
                            "floor": slot.floor,
                            "column": slot.column,
                            "on": place,
                            "offset_m": 0.0 if place in ("wall", "hang") else float(rng.uniform(-0.3, 0.3)),
                        }
                    ),
                    scale=float(rng.uniform(0.85, 1.3)),
                    yaw=0.0 if flat else float(rng.uniform(-0.45, 0.45)),
                )
            )
    return tuple(things)


def _places(slot: WindowSlot, rng: np.random.Generator) -> list[str]:
    """Where at this window something is put: one place, often a second."""
    if slot.balcony is not None:
        return ["balcony", str(rng.choice(("wall", "hang", "pane")))] if rng.random() < _ALSO else ["balcony"]
    names = [name for name, _ in _PLACES]
    shares = np.array([share for _, share in _PLACES])
    count = 2 if rng.random() < _ALSO else 1
    return [str(p) for p in rng.choice(names, size=count, replace=False, p=shares / shares.sum())]


def _thing(
    catalogue: Catalogue,
    slot: WindowSlot,
    place: str,
    last: tuple[CatalogueEntry, str] | None,
    rng: np.random.Generator,
) -> tuple[CatalogueEntry, str]:
    """Something that may stand there; now and then of the last one's class or colour, as decoys are."""
    solid = place == "balcony" and slot.balcony is not None and slot.balcony.railing == "solid"
    fits = [e for e in catalogue.entries if place in e.places and (not solid or e.size_m[2] >= _TALL_M)]
    wanted = rng.random()
    if last is not None and wanted < 0.12 and last[0] in fits:
        return last[0], str(rng.choice(last[0].colours))
    if last is not None and wanted < 0.25:
        fits = [e for e in fits if last[1] in e.colours] or fits
    # what stands on balconies only is met nowhere else
    weights = np.array([2.0 if place == "balcony" and "sill" not in e.places else 1.0 for e in fits])
    entry = fits[int(rng.choice(len(fits), p=weights / weights.sum()))]
    if last is not None and 0.12 <= wanted < 0.25 and last[1] in entry.colours:
        return entry, last[1]
    return entry, str(rng.choice(entry.colours))
