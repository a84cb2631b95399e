"""A scene document made ready to be flown in: checked, built into triangles, solids and a picture of its own.

Scenes are kept by their content, because many episodes fly in the same one and building it takes far longer than a
move. What is kept never changes, so episodes that share it stay isolated.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contracts.geometry import Point2, Point3
from contracts.scene import Building, Scene, WindowPlace
from contracts.scene_layout import columns_of, floor_outline, wall_height_m, window_of
from episode_kit.judge import Thing
from episode_kit.kinematics import Vector
from navigation.polygon import inside
from service_kit.errors import BadQuestion
from services.sim.geometry.scene_mesh import SceneMesh, UnknownObject
from services.sim.traffic import Traffic, check_traffic
from services.sim.truth import WayHome
from services.sim.world import Blueprint, World

MAX_WINDOWS = 12_000
"""A scene of more windows than this would take a minute and a gigabyte to build."""

SceneBuilder = Callable[[Scene], SceneMesh]


@dataclass(frozen=True, eq=False)
class ReadyScene:
    """A scene, built. `things` are its objects by id."""

    key: str
    scene: Scene
    mesh: SceneMesh
    blueprint: Blueprint
    things: dict[str, Thing]

    @cached_property
    def way_home(self) -> WayHome:
        """Made when the truth is first asked for: most episodes never do."""
        return WayHome(self.scene, self.things)


def scene_key(scene: Scene) -> str:
    """The same for equal documents and for no others."""
    return hashlib.sha256(scene.model_dump_json().encode()).hexdigest()


def make_ready(scene: Scene, build: SceneBuilder) -> ReadyScene:
    """Checks and builds a scene. Raises BadQuestion for what can't be built, saying what could."""
    check(scene)
    try:
        mesh = build(scene)
    except UnknownObject as error:
        raise BadQuestion(str(error), code="unknown_object") from None
    except ValueError as error:
        raise BadQuestion(f"the scene can't be built: {error}", code="bad_scene") from None
    solids = [solid for solid in mesh.solids if len(solid.faces)]
    roof_m = max((float(solid.positions[:, 2].max()) for solid in solids), default=0.0)
    blueprint = Blueprint(solids, scene.ground.half_size_m, roof_m)
    return ReadyScene(scene_key(scene), scene, mesh, blueprint, _things(scene, mesh))


def _on_ground(what: str, places: Sequence[Point2 | Point3], half: float) -> None:
    farthest_m = max(max(abs(p.x), abs(p.y)) for p in places)
    if farthest_m > half:
        raise BadQuestion(
            f"{what} reaches {farthest_m:g} m from the origin; the ground ends at {half:g} m (ground.half_size_m)",
            code="bad_scene",
        )


def _check_furniture(scene: Scene, half: float) -> None:
    ground = scene.ground
    places: list[tuple[str, Point2 | Point3]] = [("poles", pole.position) for pole in ground.poles]
    places += [("hedges", end) for hedge in ground.hedges for end in (hedge.start, hedge.end)]
    places += [("fences", end) for fence in ground.fences for end in (fence.start, fence.end)]
    places += [("wires", end) for wire in ground.wires for end in (wire.start, wire.end)]
    for name, place in places:
        if max(abs(place.x), abs(place.y)) > half:
            raise BadQuestion(
                f"ground.{name}: ({place.x:g}, {place.y:g}) lies outside; the ground ends at {half:g} m "
                "(ground.half_size_m)",
                code="bad_scene",
            )


def check(scene: Scene) -> None:
    """What the document's own type can't see. Raises BadQuestion."""
    half = scene.ground.half_size_m
    windows = 0
    for mover in scene.traffic:
        _on_ground(f"the way of {mover.id}", mover.way, half)
    check_traffic(scene)
    _check_furniture(scene, half)
    for building in scene.buildings:
        _on_ground(f"building {building.id}", building.footprint, half)
        windows += _windows_of(building)
    if windows > MAX_WINDOWS:
        raise BadQuestion(
            f"the scene has {windows} windows; at most {MAX_WINDOWS} are built: fewer or smaller buildings, or a "
            "wider windows.pitch_m",
            code="scene_too_large",
        )
    for o in scene.objects:
        if isinstance(o.place, WindowPlace):
            try:
                slot = window_of(scene, o.place)
            except ValueError as error:
                raise BadQuestion(f"object {o.id}: {error}", code="no_such_window") from None
            if o.place.on == "balcony" and slot.balcony is None:
                raise BadQuestion(
                    f"object {o.id} is on the balcony of a window that has none: facade {slot.facade}, floor "
                    f"{slot.floor}, column {slot.column} of building {slot.building}; put it on the sill, or give "
                    "the building a balcony there",
                    code="no_such_window",
                )


def check_start(ready: ReadyScene, world: World) -> None:
    """Raises BadQuestion where the drone would start in a building, in the ground, or touching something."""
    start = ready.scene.start.position
    position: Vector = (start.x, start.y, start.z)
    for building in ready.scene.buildings:
        if start.z < wall_height_m(building) and _inside(start.x, start.y, building, start.z):
            raise BadQuestion(
                f"the drone would start inside building {building.id}, at ({start.x:g}, {start.y:g}, {start.z:g}); "
                "start.position must be in the open air",
                code="bad_start",
            )
    touched = world.touching(position)
    half = ready.blueprint.half_size_m
    outside = max(abs(start.x), abs(start.y)) > half or not 0.0 < start.z < ready.blueprint.ceiling_m
    if touched or outside:
        where = "be outside the world" if outside else f"touch {touched}"
        raise BadQuestion(
            f"the drone would {where} at its start ({start.x:g}, {start.y:g}, {start.z:g}); it is a sphere of radius "
            f"{world.radius_m:g} m and the world reaches {half:g} m from the origin and "
            f"{ready.blueprint.ceiling_m:g} m up",
            code="bad_start",
        )
    met = Traffic(ready.scene, world.radius_m, lambda: 0).strikes(position, 0.0, 0.0)
    if met is not None:
        raise BadQuestion(
            f"{met} of the traffic would touch the drone at its start ({start.x:g}, {start.y:g}, {start.z:g}); give it "
            "another phase or another way",
            code="bad_start",
        )


def _windows_of(building: Building) -> int:
    try:
        return building.floors * sum(columns_of(building, f) for f in range(len(building.footprint)))
    except ValueError as error:
        raise BadQuestion(str(error), code="bad_scene") from None


def _inside(x: float, y: float, building: Building, z: float) -> bool:
    floor = min(building.floors, max(1, math.floor(z / building.floor_height_m) + 1))
    return bool(inside([(x, y)], floor_outline(building, floor))[0])


def _things(scene: Scene, mesh: SceneMesh) -> dict[str, Thing]:
    order = np.argsort(mesh.part_of, kind="stable")
    sorted_parts = mesh.part_of[order]
    things = {}
    for o in scene.objects:
        part = mesh.part("object", o.id).id
        first, last = np.searchsorted(sorted_parts, (part, part + 1))
        own = mesh.mesh.positions[order[first:last]]
        middle = (own.min(axis=0) + own.max(axis=0)) / 2
        things[o.id] = Thing(part, (float(middle[0]), float(middle[1]), float(middle[2])))
    return things
