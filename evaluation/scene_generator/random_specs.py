"""Plans drawn by chance: every building type, plan, facade family, light and difficulty, deterministic in the seed."""

import zlib
from typing import Literal

import numpy as np

from contracts.scene import BuildingKind
from contracts.sim import Catalogue, CatalogueEntry
from evaluation.scene_generator.footprints import outline
from evaluation.scene_generator.scene_plan import (
    BalconySpec,
    DecoySpec,
    Difficulty,
    FootprintSpec,
    GoalSpec,
    SceneSpec,
    Shape,
    Surroundings,
    UnbuildableScene,
)
from evaluation.scene_generator.scenes import build_scene
from evaluation.scene_generator.style_families import FAMILIES

_KINDS: tuple[BuildingKind, ...] = ("low_rise", "high_rise", "villa", "cultural")
_CORNERS: dict[Difficulty, tuple[int, ...]] = {"easy": (0, 1), "moderate": (2, 3), "hard": (4, 5)}
_ATTEMPTS = 40


def random_spec(
    catalogue: Catalogue,
    seed: int,
    kind: BuildingKind | None = None,
    difficulty: Difficulty | None = None,
    goal_kind: str | None = None,
) -> SceneSpec:
    """A plan that `build_scene(spec, seed, catalogue)` accepts; what is given is kept, the rest is drawn.

    Raises UnbuildableScene where no plan was found, which a catalogue without window objects brings about.
    """
    rng = np.random.default_rng((seed, zlib.crc32(b"plan")))
    reason = ""
    for _ in range(_ATTEMPTS):
        spec = _draw(catalogue, seed, kind, difficulty, goal_kind, rng)
        try:
            build_scene(spec, seed, catalogue)
        except UnbuildableScene as error:
            reason = str(error)
            continue
        return spec
    raise UnbuildableScene(f"no plan found for seed {seed} in {_ATTEMPTS} attempts; the last said: {reason}")


def _draw(
    catalogue: Catalogue,
    seed: int,
    kind: BuildingKind | None,
    difficulty: Difficulty | None,
    goal_kind: str | None,
    rng: np.random.Generator,
) -> SceneSpec:
    building = kind or _KINDS[int(rng.integers(4))]
    hardness = difficulty or ("easy", "moderate", "hard")[int(rng.choice(3, p=(0.4, 0.35, 0.25)))]
    pagoda = building == "cultural" and bool(rng.random() < 0.5)
    footprint = _footprint(building, pagoda, hardness, rng)
    floors = _floors(building, pagoda, rng)
    entries = [
        e for e in sorted(catalogue.entries, key=_kind_of) if goal_kind in (None, e.kind) and set(e.places) != {"free"}
    ]
    if not entries:
        raise UnbuildableScene(f"the catalogue has nothing called {goal_kind!r} that stands at a window")
    entry = entries[int(rng.integers(len(entries)))]
    colour = str(rng.choice(entry.colours))
    facades = len(outline(footprint))
    allowed = [c for c in _CORNERS[hardness] if c <= facades // 2] or [facades // 2]
    neighbours: tuple[Literal["none", "street", "ring"], ...] = ("none", "street", "ring")
    around = neighbours[int(rng.choice(3, p=(0.5, 0.3, 0.2)))]
    return SceneSpec(
        name=f"scene-{seed}",
        kind=building,
        footprint=footprint,
        floors=floors,
        family=FAMILIES[building][int(rng.integers(len(FAMILIES[building])))],
        pagoda=pagoda,
        balconies=_balconies(building, entry, rng),
        goal=GoalSpec(
            kind=entry.kind,
            colour=colour,
            floor=int(rng.integers(min(2, floors), floors + 1)),
            corners=int(rng.choice(allowed)),
            scale=round(float(rng.uniform(0.9, 1.3)), 2),
        ),
        decoys=_decoys(catalogue, entry, colour, floors, around, rng),
        clutter=int(rng.integers(3, 14)),
        surroundings=Surroundings(
            neighbours=around,
            gap_m=round(float(rng.uniform(24, 34)), 1),
            trees=int(rng.integers(4, 20)),
            shrubs=int(rng.integers(0, 10)),
            cars=int(rng.integers(0, 7)),
            surface=("grass", "paving", "gravel", "asphalt")[int(rng.choice(4, p=(0.5, 0.3, 0.1, 0.1)))],
        ),
        start_distance_m=round(float(rng.uniform(8, 10)), 1),
    )


def _kind_of(entry: CatalogueEntry) -> str:
    return entry.kind


def _footprint(kind: BuildingKind, pagoda: bool, hardness: Difficulty, rng: np.random.Generator) -> FootprintSpec:
    if pagoda:
        octagonal = hardness == "hard" or rng.random() < 0.5
        width = round(float(rng.uniform(15, 20)), 1)
        return FootprintSpec(shape="octagon" if octagonal else "rectangle", width_m=width, depth_m=width)
    shapes: tuple[Shape, ...] = ("rectangle", "l", "u", "t", "plus", "octagon")
    shares = (0.55, 0.2, 0.05, 0.1, 0.05, 0.05)
    if kind in ("villa", "cultural"):
        shares = (0.7, 0.2, 0.0, 0.1, 0.0, 0.0)
    if hardness == "hard":
        shares = (0.0, 0.0, 0.15, 0.4, 0.2, 0.25)
    shape = shapes[int(rng.choice(6, p=shares))]
    if shape == "octagon":
        return FootprintSpec(shape=shape, width_m=round(float(rng.uniform(17, 24)), 1))
    grown = 1.0 if kind != "villa" else 0.7
    width = round(float(rng.uniform(18, 30)) * grown, 1)
    depth = round(float(rng.uniform(12, 18)) * grown, 1)
    if shape == "rectangle":
        return FootprintSpec(width_m=width, depth_m=depth)
    if shape == "u":
        return FootprintSpec(shape=shape, width_m=36, depth_m=round(float(rng.uniform(17, 22)), 1), arm_m=10)
    arm = round(float(rng.uniform(8.5, 11)), 1)
    return FootprintSpec(
        shape=shape, width_m=width + arm * 0.6, depth_m=arm + round(float(rng.uniform(7, 12)), 1), arm_m=arm
    )


def _floors(kind: BuildingKind, pagoda: bool, rng: np.random.Generator) -> int:
    low, high = {"low_rise": (3, 6), "high_rise": (8, 24), "villa": (2, 3), "cultural": (3, 6) if pagoda else (1, 2)}[
        kind
    ]
    return int(rng.integers(low, high + 1))


def _balconies(kind: BuildingKind, entry: CatalogueEntry, rng: np.random.Generator) -> BalconySpec | None:
    needed = "balcony" in entry.places and not set(entry.places) & {"sill", "wall", "pane", "hang"}
    if not needed and (kind == "cultural" or rng.random() < 0.5):
        return None
    railings: tuple[Literal["bars", "glass", "solid"], ...] = ("bars", "glass", "solid")
    return BalconySpec(
        every=int(rng.integers(2, 5)),
        first=int(rng.integers(0, 2)),
        railing=railings[int(rng.integers(2 if needed else 3))],
    )


def _decoys(
    catalogue: Catalogue,
    entry: CatalogueEntry,
    colour: str,
    floors: int,
    around: Literal["none", "street", "ring"],
    rng: np.random.Generator,
) -> tuple[DecoySpec, ...]:
    likes: list[Literal["colour", "kind", "floor", "neighbour"]] = []
    if len(entry.colours) > 1:
        likes.append("colour")
    if any(e.kind != entry.kind and colour in e.colours for e in catalogue.entries):
        likes.append("kind")
    if floors >= 10:
        likes.append("floor")
    if around != "none":
        likes.append("neighbour")
    return tuple(DecoySpec(like=like) for like in likes if rng.random() < 0.6)
