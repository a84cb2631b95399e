"""What a mixture does to a scene: sensors, light, weather, wind, where the drone starts, and the row of houses."""

import math
from typing import NamedTuple

import numpy as np

from contracts.geometry import Point2, Point3
from contracts.scene import Air, Building, Light, Scene, Start, Wind, WindowPlace
from contracts.scene_layout import columns_of
from evaluation.scene_generator.footprints import distance_to_outline
from evaluation.scene_generator.scene_plan import SceneSpec, UnbuildableScene
from evaluation.task_set.furniture import furnished
from evaluation.task_set.mixture import Mixture, StartName, drawn
from evaluation.task_set.street_life import with_street_life

_ROOM_M = {"wall": 0.9, "other": 2.0}
_BETWEEN_M = 0.02
_APART_COLUMNS = (2, 4)
"""Between the two windows of an ambiguous request: another window, and near enough that whoever finds one sees both."""


class RealScene(NamedTuple):
    """`start` says which kind of start it is."""

    scene: Scene
    start: StartName


def real_scene(scene: Scene, spec: SceneSpec, mixture: Mixture, rng: np.random.Generator) -> RealScene:
    """The scene as the mixture has it, without the twin or the absence. Raises UnbuildableScene where its start is
    hemmed in."""
    terraced = rng.random() < mixture.terraced and spec.footprint.shape == "rectangle" and spec.goal.corners == 0
    if terraced and spec.surroundings.neighbours != "ring":
        scene = _in_a_row(scene, spec)
    if rng.random() < mixture.same_clothes:
        scene = _alike(scene)
    start = drawn({str(k): v for k, v in mixture.start.items()}, rng)
    sensors = drawn(dict(mixture.sensors), rng)
    real = scene.model_copy(
        update={
            "start": _started(scene, spec, start, rng),
            "sensors": None if sensors == "perfect" else sensors,
            "light": light_of(scene.light, drawn({str(k): v for k, v in mixture.light.items()}, rng), rng),
            "air": Air(
                **weather_of(drawn({str(k): v for k, v in mixture.weather.items()}, rng), rng),
                wind=_wind(drawn({str(k): v for k, v in mixture.wind.items()}, rng), rng),
            ),
        }
    )
    if mixture.furnished and rng.random() < mixture.furnished:
        real = furnished(real, rng)
    if mixture.traffic and rng.random() < mixture.traffic:
        real = with_street_life(real, rng)
    names: dict[str, StartName] = {name: name for name in mixture.start}
    return RealScene(Scene.model_validate(real.model_dump()), names[start])


def with_twin(scene: Scene, rng: np.random.Generator) -> Scene:
    """A second object like the goal, at another window of the same wall, floor and kind, a few windows on: a drone that
    looks at the one sees the other. Raises UnbuildableScene."""
    goal = next(o for o in scene.objects if o.id == scene.goal)
    place = goal.place
    assert isinstance(place, WindowPlace)
    target = scene.building(scene.target)
    others = [o.place for o in scene.objects if isinstance(o.place, WindowPlace)]
    same = [p for p in others if (p.building, p.floor) == (place.building, place.floor)]
    taken = {(p.facade, p.column) for p in same}
    balconied = {(facade, column) for plan in target.balconies for facade in plan.facades for column in plan.columns}
    nearest, farthest = _APART_COLUMNS
    spots = [
        column
        for column in range(columns_of(target, place.facade))
        if (place.facade, column) not in taken
        and nearest <= abs(column - place.column) <= farthest
        and ((place.facade, column) in balconied) == ((place.facade, place.column) in balconied)
    ]
    if not spots:
        raise UnbuildableScene(f"{scene.name} has no window for a second {goal.kind} on floor {place.floor}")
    there = place.model_copy(update={"column": spots[int(rng.integers(len(spots)))]})
    twin = goal.model_copy(update={"id": "twin", "place": there})
    return scene.model_copy(update={"objects": (*scene.objects, twin)})


def _in_a_row(scene: Scene, spec: SceneSpec) -> Scene:
    """A house like the target on either side of it, wall to wall; what stood there goes."""
    target = scene.building(scene.target)
    count = len(target.footprint)
    a, b = target.footprint[spec.start_facade], target.footprint[(spec.start_facade + 1) % count]
    length = math.dist((a.x, a.y), (b.x, b.y)) + _BETWEEN_M
    along = ((b.x - a.x) / math.dist((a.x, a.y), (b.x, b.y)), (b.y - a.y) / math.dist((a.x, a.y), (b.x, b.y)))
    row = tuple(_moved(target, f"row-{k + 1}", along, way * length) for k, way in enumerate((-1.0, 1.0)))
    ground = scene.ground
    free = {
        "trees": tuple(t for t in ground.trees if _clear(t.position, row, t.crown_m + 0.5)),
        "cars": tuple(c for c in ground.cars if _clear(c.position, row, 3.0)),
        "lamps": tuple(p for p in ground.lamps if _clear(p, row, 1.0)),
    }
    return scene.model_copy(update={"buildings": (*scene.buildings, *row), "ground": ground.model_copy(update=free)})


def _moved(building: Building, name: str, along: tuple[float, float], by_m: float) -> Building:
    footprint = tuple(
        Point2(x=round(p.x + along[0] * by_m, 3), y=round(p.y + along[1] * by_m, 3)) for p in building.footprint
    )
    return building.model_copy(update={"id": name, "footprint": footprint})


def _clear(point: Point2, buildings: tuple[Building, ...], room_m: float) -> bool:
    return all(distance_to_outline((point.x, point.y), _plan(building)) >= room_m for building in buildings)


def _plan(building: Building) -> tuple[tuple[float, float], ...]:
    return tuple((p.x, p.y) for p in building.footprint)


def _alike(scene: Scene) -> Scene:
    """The neighbours in the target's clothes, as far as they are of its kind."""
    target = scene.building(scene.target)
    dressed = tuple(
        b.model_copy(update={"style": target.style}) if b.kind == target.kind and b.id != target.id else b
        for b in scene.buildings
    )
    return scene.model_copy(update={"buildings": dressed})


def _started(scene: Scene, spec: SceneSpec, start: str, rng: np.random.Generator) -> Start:
    here, yaw = scene.start.position, scene.start.yaw
    off_m = {"near": float(rng.uniform(1.5, 3.0)), "far": float(rng.uniform(25.0, 38.0))}.get(start)
    turn = 0.0
    if start == "oblique":
        turn = float(rng.choice((-1.0, 1.0))) * math.radians(float(rng.uniform(30.0, 50.0)))
    if start == "away":
        turn = math.pi + math.radians(float(rng.uniform(-30.0, 30.0)))
    back_m = 0.0 if off_m is None else off_m - spec.start_distance_m
    x, y = round(here.x - math.cos(yaw) * back_m, 3), round(here.y - math.sin(yaw) * back_m, 3)
    for building in scene.buildings:
        room = _ROOM_M["wall" if building.id == scene.target or building.id.startswith("row-") else "other"]
        if distance_to_outline((x, y), _plan(building)) < room or _inside((x, y), _plan(building)):
            raise UnbuildableScene(f"{scene.name}: a {start} start is hemmed in by {building.id}")
    half = scene.ground.half_size_m - 2.0
    trees = any(math.hypot(t.position.x - x, t.position.y - y) < t.crown_m + 1.0 for t in scene.ground.trees)
    cars = any(math.hypot(c.position.x - x, c.position.y - y) < 4.0 for c in scene.ground.cars)
    if trees or cars or max(abs(x), abs(y)) > half:
        raise UnbuildableScene(f"{scene.name}: a {start} start is not in the open")
    return Start(position=Point3(x=x, y=y, z=here.z), yaw=round(math.remainder(yaw + turn, math.tau), 6))


def _inside(point: tuple[float, float], plan: tuple[tuple[float, float], ...]) -> bool:
    crossings = 0
    for (ax, ay), (bx, by) in zip(plan, plan[1:] + plan[:1], strict=True):
        if (ay > point[1]) != (by > point[1]) and point[0] < (bx - ax) * (point[1] - ay) / (by - ay) + ax:
            crossings += 1
    return crossings % 2 == 1


def light_of(light: Light, name: str, rng: np.random.Generator) -> Light:
    """The light by day as it is, or that of a dusk or a night."""
    lit = round(float(rng.uniform(0.2, 0.5)), 2)
    if name == "night":
        return light.model_copy(update={"sky": "night", "lit_windows": lit, "exposure": 1.8})
    if name == "dusk":
        low = round(float(rng.uniform(0.06, 0.25)), 3)
        return light.model_copy(update={"sky": "dusk", "lit_windows": lit, "sun_elevation": low, "exposure": 0.8})
    return light.model_copy(update={"sky": "clear" if light.sky == "dusk" else light.sky})


def weather_of(name: str, rng: np.random.Generator) -> dict[str, float]:
    """What of `Air` that weather sets."""
    if name == "fog":
        return {"visibility_m": round(float(rng.uniform(60.0, 250.0)), 0)}
    return {"rain_mm_h": round(float(rng.uniform(2.0, 25.0)), 1)} if name == "rain" else {}


def _wind(name: str, rng: np.random.Generator) -> Wind:
    if name == "calm":
        return Wind()
    speed, gusts = ((2.0, 4.0), (0.4, 1.0)) if name == "breeze" else ((5.0, 8.0), (1.0, 2.0))
    return Wind(
        speed_m_s=round(float(rng.uniform(*speed)), 1),
        towards=round(float(rng.uniform(0.0, math.tau)), 2),
        gusts_m_s=round(float(rng.uniform(*gusts)), 1),
    )
