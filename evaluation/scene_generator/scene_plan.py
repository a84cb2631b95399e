"""What a scene is asked to be: the plan that `scenes.build_scene` turns into a scene document.

A plan and a seed decide everything; whatever a plan leaves open (null) the seed decides.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from contracts.base import Name, Radians, Wire
from contracts.scene import BuildingKind

Shape = Literal["rectangle", "l", "u", "t", "plus", "octagon"]
Difficulty = Literal["easy", "moderate", "hard"]
PlaceOn = Literal["sill", "balcony", "wall", "pane", "hang"]
Family = Literal[
    "pastel_plaster",
    "red_brick",
    "white_render",
    "grey_concrete",
    "blue_panel",
    "sandstone",
    "garden_plaster",
    "painted_wood",
    "cottage_brick",
    "red_lacquer",
    "temple_wood",
    "temple_stone",
]
Side = Annotated[float, Field(ge=4.0, le=120.0)]


class FootprintSpec(Wire):
    """`width_m` along facade 0, `depth_m` across it, `arm_m` how thick the arms of an l, u, t or plus are.

    An octagon is regular and `width_m` across; it needs neither of the others.
    """

    shape: Shape = "rectangle"
    width_m: Side = 24.0
    depth_m: Side = 12.0
    arm_m: Side = 10.0

    @model_validator(mode="after")
    def _has_room_for_its_arms(self) -> Self:
        spare = {"l": 1, "u": 2, "t": 1, "plus": 1}.get(self.shape)
        if spare is not None and min(self.width_m - spare * self.arm_m, self.depth_m - self.arm_m) < 4.0:
            raise ValueError(f"a {self.shape} of {self.width_m} x {self.depth_m} m has no room for {self.arm_m} m arms")
        return self


class BalconySpec(Wire):
    """Balconies at every `every`-th window column, counted from `first`, on these facades (null: all of them)."""

    facades: tuple[int, ...] | None = None
    every: int = Field(default=3, ge=1, le=10)
    first: int = Field(default=1, ge=0, le=9)
    depth_m: float = Field(default=1.2, ge=0.6, le=2.5)
    railing: Literal["bars", "glass", "solid"] = "bars"


class GoalSpec(Wire):
    """The object that marks the customer's window, and where: `corners` counts the corners that a clockwise lap passes
    between the starting facade and the goal's."""

    kind: Name
    colour: Name
    floor: int = Field(ge=1, le=60)
    corners: int = Field(default=0, ge=0, le=31)
    column: int | None = Field(default=None, ge=0, le=99)
    on: PlaceOn | None = None
    scale: float = Field(default=1.0, ge=0.5, le=2.0)


class DecoySpec(Wire):
    """Something that could be taken for the goal: `colour` is the goal's class in another colour, `kind` another class
    in the goal's colour, `floor` the very same object some floors away, `neighbour` the same object at another
    building. `corners`, `column` and what it is may be fixed; what is null the seed decides."""

    like: Literal["colour", "kind", "floor", "neighbour"]
    kind: Name | None = None
    colour: Name | None = None
    corners: int | None = Field(default=None, ge=0, le=31)
    column: int | None = Field(default=None, ge=0, le=99)


class Surroundings(Wire):
    """What stands around. Neighbours keep `gap_m` from the target's walls; trees, cars and lamps stay outside the ring
    in which the drone laps, except for shrubs below a metre at the foot of the walls."""

    neighbours: Literal["none", "street", "ring"] = "none"
    gap_m: float = Field(default=28.0, ge=22.0, le=60.0)
    trees: int = Field(default=10, ge=0, le=60)
    shrubs: int = Field(default=6, ge=0, le=40)
    cars: int = Field(default=3, ge=0, le=20)
    lamps: bool = True
    surface: Literal["grass", "paving", "asphalt", "gravel"] = "grass"


class SceneSpec(Wire):
    """One scene's plan. `rotation` (radians, counter-clockwise) turns the whole street."""

    name: Name
    kind: BuildingKind
    footprint: FootprintSpec = FootprintSpec()
    floors: int = Field(ge=1, le=40)
    family: Family | None = None
    pagoda: bool = False
    balconies: BalconySpec | None = None
    goal: GoalSpec
    decoys: tuple[DecoySpec, ...] = Field(default=(), max_length=8)
    clutter: int = Field(default=6, ge=0, le=200)
    surroundings: Surroundings = Surroundings()
    start_facade: int = Field(default=0, ge=0, le=31)
    start_distance_m: float = Field(default=9.0, ge=8.0, le=10.0)
    sky: Literal["clear", "cloudy", "overcast", "dusk"] | None = None
    rotation: Radians = 0.0


class UnbuildableScene(ValueError):
    """The plan asks for something that cannot stand; the message says what, and what would be possible."""
