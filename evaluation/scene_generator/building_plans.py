"""The buildings of a task set: 22 plans over four types and six footprints, and what a seed leaves open in them."""

import zlib
from typing import Literal, NamedTuple

import numpy as np

from contracts.scene import BuildingKind
from evaluation.scene_generator.footprints import outline
from evaluation.scene_generator.scene_plan import BalconySpec, Difficulty, Family, FootprintSpec, Shape, Surroundings
from evaluation.scene_generator.style_families import FAMILIES

TASKS_PER_BUILDING = 300 / 22


class Sketch(NamedTuple):
    """What a plan fixes; `floors` is a range, `balconies` whether there are any."""

    kind: BuildingKind
    shape: Shape
    floors: tuple[int, int]
    balconies: bool = True
    pagoda: bool = False


SKETCHES: tuple[Sketch, ...] = (
    Sketch("low_rise", "rectangle", (4, 6)),
    Sketch("high_rise", "octagon", (14, 18)),
    Sketch("villa", "t", (2, 3)),
    Sketch("cultural", "octagon", (4, 6), balconies=False, pagoda=True),
    Sketch("low_rise", "u", (3, 5)),
    Sketch("high_rise", "rectangle", (24, 24)),
    Sketch("villa", "rectangle", (2, 3)),
    Sketch("cultural", "rectangle", (2, 2), balconies=False),
    Sketch("low_rise", "t", (4, 6)),
    Sketch("high_rise", "plus", (9, 12)),
    Sketch("villa", "l", (3, 3)),
    Sketch("cultural", "octagon", (3, 5), balconies=False, pagoda=True),
    Sketch("low_rise", "l", (3, 5), balconies=False),
    Sketch("high_rise", "rectangle", (12, 16)),
    Sketch("villa", "t", (2, 3)),
    Sketch("cultural", "rectangle", (3, 5), balconies=False, pagoda=True),
    Sketch("low_rise", "plus", (3, 5)),
    Sketch("high_rise", "t", (8, 11)),
    Sketch("villa", "rectangle", (3, 3), balconies=False),
    Sketch("cultural", "l", (2, 2), balconies=False),
    Sketch("low_rise", "rectangle", (5, 6)),
    Sketch("high_rise", "l", (16, 21)),
)

_SHARES: dict[bool, tuple[Difficulty, ...]] = {
    True: ("hard", "moderate", "easy", "hard", "moderate", "hard", "easy", "moderate", "hard"),
    False: ("easy", "moderate"),
}
_HARD_CORNERS = 4


class BuildingPlan(NamedTuple):
    """One building with its street: everything that its tasks share."""

    name: str
    seed: int
    sketch: Sketch
    footprint: FootprintSpec
    floors: int
    family: Family
    balconies: BalconySpec | None
    surroundings: Surroundings
    rotation: float

    @property
    def corners(self) -> int:
        return len(outline(self.footprint))

    def difficulty(self, task: int) -> Difficulty:
        """The class of this building's task number `task`: hard ones need a plan of eight corners or more."""
        cycle = _SHARES[self.corners // 2 >= _HARD_CORNERS]
        return cycle[task % len(cycle)]


def building_plan(number: int, seed: int) -> BuildingPlan:
    """Building `number` of a set; sketches repeat after 22, with other sizes, clothes and streets."""
    sketch = SKETCHES[number % len(SKETCHES)]
    rng = np.random.default_rng((seed, zlib.crc32(b"building")))
    families = FAMILIES[sketch.kind]
    return BuildingPlan(
        name=f"b{number + 1:02d}-{sketch.kind.replace('_', '-')}-{sketch.shape}",
        seed=seed,
        sketch=sketch,
        footprint=_footprint(sketch, rng),
        floors=int(rng.integers(sketch.floors[0], sketch.floors[1] + 1)),
        family=families[int(rng.integers(len(families)))],
        balconies=_balconies(sketch, rng),
        surroundings=_surroundings(rng),
        rotation=round(float(rng.uniform(0.0, 6.283)), 3),
    )


def buildings_for(count: int) -> int:
    """How many buildings a set of `count` tasks has: in proportion to 300 over 22, at least four where it can."""
    return max(min(4, count), round(count / TASKS_PER_BUILDING))


def _footprint(sketch: Sketch, rng: np.random.Generator) -> FootprintSpec:
    villa = sketch.kind == "villa"

    def size(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 1)

    if sketch.pagoda:
        width = size(15, 20)
        return FootprintSpec(shape=sketch.shape, width_m=width, depth_m=width)
    match sketch.shape:
        case "octagon":
            return FootprintSpec(shape="octagon", width_m=size(18, 24))
        case "rectangle":
            return FootprintSpec(width_m=size(14, 19) if villa else size(18, 30), depth_m=size(10, 18))
        case "u":
            return FootprintSpec(shape="u", width_m=size(35, 38), depth_m=size(17, 22), arm_m=10)
        case "plus":
            arm = size(9, 10.5)
            return FootprintSpec(shape="plus", width_m=arm + size(14, 18), depth_m=arm + size(12, 16), arm_m=arm)
        case _:
            arm = size(8.0, 9.0) if villa else size(9, 11)
            width = arm + (size(9, 12) if villa else size(12, 18))
            return FootprintSpec(shape=sketch.shape, width_m=width, depth_m=arm + size(7, 12), arm_m=arm)


def _balconies(sketch: Sketch, rng: np.random.Generator) -> BalconySpec | None:
    if not sketch.balconies:
        return None
    railings: tuple[Literal["bars", "glass"], ...] = ("bars", "glass")
    return BalconySpec(
        every=int(rng.integers(2, 4)), first=int(rng.integers(0, 2)), railing=railings[int(rng.integers(2))]
    )


def _surroundings(rng: np.random.Generator) -> Surroundings:
    around: tuple[Literal["none", "street", "ring"], ...] = ("none", "street", "ring")
    return Surroundings(
        neighbours=around[int(rng.choice(3, p=(0.3, 0.45, 0.25)))],
        gap_m=round(float(rng.uniform(24, 34)), 1),
        trees=int(rng.integers(4, 20)),
        shrubs=int(rng.integers(0, 10)),
        cars=int(rng.integers(0, 7)),
        surface=("grass", "paving", "gravel", "asphalt")[int(rng.choice(4, p=(0.5, 0.3, 0.1, 0.1)))],
    )
