"""The scene document: everything the simulator needs to rebuild a street bit for bit.

Ground plans are in metres, ENU. A footprint runs counter-clockwise seen from above; facade k is the edge from
vertex k to vertex k + 1 and its outward normal points to the right of that direction. Floors count from 1 at the
ground. `contracts.scene_layout` says where windows and balconies lie.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from contracts.base import Name, Radians, Rgb, Wire
from contracts.footprint import footprint_problem
from contracts.geometry import Point2, Point3
from contracts.scene_street import Awnings, Fences, Hedges, Poles, Signs, Wires, low_awning
from contracts.scene_traffic import Traffic, same_names
from contracts.sensor_profiles import sensor_names

SCHEMA_KEY = "$schema"
BuildingKind = Literal["low_rise", "high_rise", "villa", "cultural"]


class FacadeStyle(Wire):
    """What the walls are made of; `accent` colours bands, doors, columns or eaves, as the kind of building has them."""

    wall: Literal["plaster", "brick", "concrete", "panel", "stone", "wood", "lacquer"] = "plaster"
    wall_colour: Rgb = "#d8cfc0"
    trim_colour: Rgb = "#f2efe8"
    frame_colour: Rgb = "#e8e8e6"
    accent_colour: Rgb = "#7a4a36"
    string_courses: bool = True


class WindowGrid(Wire):
    """The same grid of windows on every floor and facade; sizes in metres.

    `pitch_m` is the spacing of columns, `margin_m` the wall kept free at both ends of a facade, `sill_m` the height
    of the sill above its floor, `reveal_m` how deep the pane lies behind the wall, `ledge_m` how far the sill juts out.
    """

    width_m: float = Field(default=1.4, ge=0.4, le=4.0)
    height_m: float = Field(default=1.5, ge=0.4, le=4.0)
    sill_m: float = Field(default=0.9, ge=0.0, le=2.0)
    pitch_m: float = Field(default=3.0, ge=1.2, le=10.0)
    margin_m: float = Field(default=0.8, ge=0.2, le=10.0)
    reveal_m: float = Field(default=0.18, ge=0.05, le=0.5)
    ledge_m: float = Field(default=0.3, ge=0.05, le=0.6)
    shape: Literal["rectangle", "arched", "lattice", "french"] = "rectangle"
    curtains: float = Field(default=0.6, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.width_m + 0.2 > self.pitch_m:
            raise ValueError("windows overlap: pitch_m must be at least width_m + 0.2")
        return self


class BalconyPlan(Wire):
    """Balconies in front of the windows of these facades and columns, on every floor from `from_floor` up."""

    facades: tuple[int, ...] = ()
    columns: tuple[int, ...] = ()
    from_floor: int = Field(default=2, ge=1, le=60)
    depth_m: float = Field(default=1.3, ge=0.6, le=2.5)
    railing: Literal["bars", "glass", "solid"] = "bars"


class Building(Wire):
    """One building. `setback_m` moves each floor's walls inward by so much against the floor below (pagodas);
    it needs a convex footprint."""

    id: Name
    kind: BuildingKind
    footprint: tuple[Point2, ...] = Field(min_length=3, max_length=32)
    floors: int = Field(ge=1, le=60)
    floor_height_m: float = Field(default=3.0, ge=2.3, le=6.0)
    style: FacadeStyle = FacadeStyle()
    windows: WindowGrid = WindowGrid()
    balconies: tuple[BalconyPlan, ...] = Field(default=(), max_length=16)
    roof: Literal["flat", "gable", "hip", "pagoda", "hall"] = "flat"
    setback_m: float = Field(default=0.0, ge=0.0, le=2.0)
    awnings: Awnings = ()
    signs: Signs = ()

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if problem := footprint_problem([(p.x, p.y) for p in self.footprint]):
            raise ValueError(f"building {self.id}: {problem}")
        if self.windows.sill_m + self.windows.height_m > self.floor_height_m - 0.1:
            raise ValueError(f"building {self.id}: sill_m + height_m must stay 0.1 m below floor_height_m")
        if problem := low_awning(self.awnings, self.windows.sill_m + self.windows.height_m, self.floor_height_m):
            raise ValueError(f"building {self.id}: {problem}")
        return self


class WindowPlace(Wire):
    """At a window: on the sill's ledge, on the balcony's floor in front of it, on the wall beside it, in the pane
    (posters), or hung from the lintel. `offset_m` shifts along the facade, positive in the facade's direction."""

    at: Literal["window"] = "window"
    building: Name
    facade: int = Field(ge=0, le=31)
    floor: int = Field(ge=1, le=60)
    column: int = Field(ge=0, le=99)
    on: Literal["sill", "balcony", "wall", "pane", "hang"] = "sill"
    offset_m: float = Field(default=0.0, ge=-2.0, le=2.0)


class FreePlace(Wire):
    """Anywhere: `position` is the middle of the object's underside."""

    at: Literal["free"] = "free"
    position: Point3


class SceneObject(Wire):
    """A thing of the catalogue. `yaw` turns it about its upright axis, against facing straight out of the facade
    (or, for a free place, against facing east)."""

    id: Name
    kind: Name
    colour: Name
    place: Annotated[WindowPlace | FreePlace, Field(discriminator="at")]
    scale: float = Field(default=1.0, ge=0.5, le=2.0)
    yaw: Radians = 0.0


class Tree(Wire):
    position: Point2
    height_m: float = Field(default=6.0, ge=1.0, le=25.0)
    crown_m: float = Field(default=1.8, ge=0.3, le=8.0)
    kind: Literal["broadleaf", "conifer", "shrub"] = "broadleaf"


class Car(Wire):
    position: Point2
    yaw: Radians = 0.0
    colour: Rgb = "#8a8f98"


class Road(Wire):
    """A straight road between two points, with pavements on both sides."""

    start: Point2
    end: Point2
    width_m: float = Field(default=7.0, ge=2.0, le=40.0)
    pavement_m: float = Field(default=2.0, ge=0.0, le=10.0)


class Ground(Wire):
    surface: Literal["grass", "paving", "asphalt", "gravel"] = "grass"
    half_size_m: float = Field(default=120.0, ge=20.0, le=500.0)
    roads: tuple[Road, ...] = Field(default=(), max_length=16)
    trees: tuple[Tree, ...] = Field(default=(), max_length=200)
    cars: tuple[Car, ...] = Field(default=(), max_length=100)
    lamps: tuple[Point2, ...] = Field(default=(), max_length=100)
    hedges: Hedges = ()
    fences: Fences = ()
    poles: Poles = ()
    wires: Wires = ()


class Light(Wire):
    """`sun_azimuth` in radians counter-clockwise from east, `sun_elevation` above the horizon; by night it is the
    moon's. `lit_windows`: the share of windows with light behind them; where there is any, and by night, street lamps
    burn. `glass`: panes show a fixed picture of a sky, or reflect the one that there is, by angle."""

    sun_azimuth: Radians = 0.9
    sun_elevation: float = Field(default=0.8, ge=0.05, le=1.57)
    sky: Literal["clear", "cloudy", "overcast", "dusk", "night"] = "clear"
    exposure: float = Field(default=1.0, ge=0.3, le=2.0)
    lit_windows: float = Field(default=0.0, ge=0.0, le=1.0, exclude_if=lambda share: share == 0.0)
    glass: Literal["painted", "reflecting"] = Field(default="painted", exclude_if=lambda glass: glass == "painted")

    @property
    def lamps_burn(self) -> bool:
        return self.sky == "night" or self.lit_windows > 0.0


class Wind(Wire):
    """`speed_m_s` on the mean, blowing `towards` (radians counter-clockwise from east), with gusts whose standard
    deviation is `gusts_m_s` in each direction of the plan, half of that upwards and downwards."""

    speed_m_s: float = Field(default=0.0, ge=0.0, le=30.0)
    towards: Radians = 0.0
    gusts_m_s: float = Field(default=0.0, ge=0.0, le=15.0)


class Air(Wire):
    """Weather. `visibility_m`: at which fog leaves 5 % of a contrast (the meteorological optical range); null: no fog.
    Only a drone that flies by dynamics feels the wind (`contracts.sim.Flight.model`)."""

    visibility_m: float | None = Field(default=None, ge=10.0, le=100_000.0)
    rain_mm_h: float = Field(default=0.0, ge=0.0, le=150.0)
    wind: Wind = Wind()


CALM = Air()
"""Dry, clear and still."""


class Start(Wire):
    """Where the drone stands, in metres; `yaw` faces a facade of the target building."""

    position: Point3
    yaw: Radians


class Scene(Wire):
    """`target` names the building that is delivered to. `goal` names the object that marks the customer's window:
    it serves judging only and no part of a mission ever reads it. `sensors` names the shipped profile that the drone
    senses with, where nobody chooses another; null: perfect ones."""

    version: Literal[1] = 1
    name: Name
    seed: int = Field(default=0, ge=0, le=2**31 - 1)
    buildings: tuple[Building, ...] = Field(min_length=1, max_length=32)
    target: Name
    objects: tuple[SceneObject, ...] = Field(default=(), max_length=400)
    goal: Name | None = None
    ground: Ground = Ground()
    light: Light = Light()
    air: Air = Field(default=CALM, exclude_if=lambda air: air == CALM)
    start: Start
    sensors: Name | None = Field(default=None, exclude_if=lambda name: name is None)
    traffic: Traffic = Field(default=(), exclude_if=lambda movers: not movers)

    @model_validator(mode="before")
    @classmethod
    def _may_name_its_schema(cls, given: object) -> object:
        """`$schema` is for editors, and no part of the scene."""
        if isinstance(given, dict) and SCHEMA_KEY in given:
            return {name: value for name, value in given.items() if name != SCHEMA_KEY}
        return given

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        ids = [b.id for b in self.buildings]
        names = [o.id for o in self.objects]
        if len(set(ids)) != len(ids) or len(set(names)) != len(names):
            raise ValueError("ids of buildings and of objects must be unique")
        if twice := same_names(self.traffic):
            raise ValueError(f"ids of traffic must be unique; more than one mover is called {', '.join(twice)}")
        if self.target not in ids:
            raise ValueError(f"target {self.target!r} is not a building of the scene; there are {ids}")
        if self.sensors is not None and self.sensors not in sensor_names():
            raise ValueError(f"there is no sensor profile {self.sensors!r}; there are {', '.join(sensor_names())}")
        if self.goal is not None and self.goal not in names:
            raise ValueError(f"goal {self.goal!r} is not an object of the scene")
        for o in self.objects:
            if isinstance(o.place, WindowPlace) and o.place.building not in ids:
                raise ValueError(
                    f"object {o.id!r} is placed at building {o.place.building!r}, which is not in the scene"
                )
        return self

    def goal_object(self) -> SceneObject | None:
        """The thing that marks the customer's window; null where the scene has no goal."""
        return next((thing for thing in self.objects if thing.id == self.goal), None)

    def building(self, building_id: str) -> Building:
        """The building of that id. Raises KeyError."""
        for building in self.buildings:
            if building.id == building_id:
                return building
        raise KeyError(building_id)
