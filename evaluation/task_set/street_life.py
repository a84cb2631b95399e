"""People, cars and birds for a generated street, on ways that lead past what stands there."""

from collections.abc import Iterable

import numpy as np
import shapely
import shapely.affinity
import shapely.ops

from contracts.geometry import Point2, Point3
from contracts.scene import Car, Road, Scene
from contracts.scene_layout import wall_height_m
from contracts.scene_traffic import Bird, Mover, MovingCar, Person

_ALONG_M = 40.0
"""So far to both sides of the target people walk up and down a pavement."""
_PERSON_ROOM_M, _CAR_ROOM_M, _BIRD_ROOM_M = 0.35, 1.2, 1.5
_TRUNK_M, _LAMP_M, _START_M = 0.4, 0.15, 2.5
_BARRIER_M = 0.4
"""Half of a hedge's width, or of a fence's."""
_DRIVEN_SHARE = 0.65
_COATS = ("#3b5a78", "#a03c32", "#4f6b3a", "#6d4a7a", "#2f2f33", "#c9b48a", "#d9a514")
_PAINTS = ("#7d8790", "#b8bcc0", "#2f3a46", "#8c3b34", "#e4e4e0", "#3b5a78")
_PLUMES = ("#3a3d42", "#c9ccd0", "#6b5a48")


def with_street_life(scene: Scene, rng: np.random.Generator) -> Scene:
    """Two to five people on each street's pavements, up to three round the target, up to three birds, cars in about two
    lanes of three, where none are parked any more. What would run into something that stands there is left out."""
    movers: list[Mover] = []
    for road in scene.ground.roads:
        for lane in _driven_in(road, rng):
            parked = tuple(car for car in scene.ground.cars if _outline(car).distance(lane) >= _CAR_ROOM_M)
            scene = scene.model_copy(update={"ground": scene.ground.model_copy(update={"cars": parked})})
            movers += _in_lane(scene, lane, rng)
        movers += _on_pavements(scene, road, rng)
    movers += _round_the_target(scene, rng)
    counts = {"person": 0, "car": 0, "bird": 0}
    named: list[Mover] = []
    for mover in movers:
        counts[mover.kind] += 1
        named.append(mover.model_copy(update={"id": f"{mover.kind}-{counts[mover.kind]}"}))
    return scene.model_copy(update={"traffic": tuple(named)})


def _on_pavements(scene: Scene, road: Road, rng: np.random.Generator) -> Iterable[Mover]:
    middle = _target(scene).centroid
    along = shapely.LineString([(road.start.x, road.start.y), (road.end.x, road.end.y)])
    here = along.project(middle)
    part = shapely.ops.substring(along, max(0.0, here - _ALONG_M), min(along.length, here + _ALONG_M))
    for _ in range(int(rng.integers(2, 6))):
        off_m = road.width_m / 2 + road.pavement_m * float(rng.uniform(0.2, 0.8))
        way = part.parallel_offset(off_m, "left" if rng.random() < 0.5 else "right")
        person = _person(way, rng)
        if road.pavement_m >= 1.0 and _is_open(scene, way, _PERSON_ROOM_M):
            yield person


def _driven_in(road: Road, rng: np.random.Generator) -> Iterable[shapely.LineString]:
    """Lanes, each in the direction of its cars, which keep to the right."""
    a, b = (road.start.x, road.start.y), (road.end.x, road.end.y)
    for start, end in ((a, b), (b, a)):
        if rng.random() < _DRIVEN_SHARE:
            yield shapely.LineString([start, end]).parallel_offset(road.width_m / 4, "right")


def _in_lane(scene: Scene, lane: shapely.LineString, rng: np.random.Generator) -> Iterable[Mover]:
    """One car, or two half a round apart at one speed."""
    speed, phase = round(float(rng.uniform(5.0, 10.0)), 1), float(rng.uniform())
    for number in range(int(rng.integers(1, 3))):
        paint = str(rng.choice(_PAINTS))
        if _is_open(scene, lane, _CAR_ROOM_M):
            later = round((phase + 0.5 * number) % 1.0, 3)
            yield MovingCar(id="car", way=_points(lane), speed_m_s=speed, phase=later, colour=paint)


def _round_the_target(scene: Scene, rng: np.random.Generator) -> Iterable[Mover]:
    target, top_m = _target(scene), wall_height_m(scene.building(scene.target))
    for _ in range(int(rng.integers(0, 4))):
        way = _ring(target, float(rng.uniform(2.5, 7.0)), int(rng.integers(4)))
        person = _person(shapely.LineString(way.coords[:-1]), rng)
        if _is_open(scene, way, _PERSON_ROOM_M):
            yield person
    for _ in range(int(rng.integers(0, 4))):
        ring = _ring(target, float(rng.uniform(4.0, 10.0)), int(rng.integers(4)))
        heights = rng.uniform(0.4 * top_m + 2.0, top_m + 4.0, len(ring.coords) - 1).round(1)
        bird = Bird(
            id="bird",
            way=tuple(Point3(x=p.x, y=p.y, z=float(z)) for p, z in zip(_points(ring)[:-1], heights, strict=True)),
            speed_m_s=round(float(rng.uniform(5.0, 11.0)), 1),
            phase=round(float(rng.uniform()), 3),
            colour=str(rng.choice(_PLUMES)),
        )
        if all(ring.distance(_plan(scene, b.id)) >= _BIRD_ROOM_M for b in scene.buildings):
            yield bird


def _person(way: shapely.LineString, rng: np.random.Generator) -> Person:
    return Person(
        id="person",
        way=_points(way),
        speed_m_s=round(float(rng.uniform(0.9, 1.6)), 2),
        phase=round(float(rng.uniform()), 3),
        height_m=round(float(rng.uniform(1.2, 1.95)), 2),
        colour=str(rng.choice(_COATS)),
    )


def _ring(target: shapely.Polygon, off_m: float, first: int) -> shapely.LineString:
    """The corners of a rectangle about the target, from its corner `first` round to it again."""
    corners = list(target.minimum_rotated_rectangle.buffer(off_m, join_style="mitre").exterior.coords)[:-1]
    corners = corners[first:] + corners[:first]
    return shapely.LineString([*corners, corners[0]])


def _is_open(scene: Scene, way: shapely.LineString, room_m: float) -> bool:
    """Nothing stands on the way, and it leads neither off the ground nor over the start."""
    half, start, ground = scene.ground.half_size_m, scene.start.position, scene.ground
    posts = [(lamp.x, lamp.y, _LAMP_M) for lamp in ground.lamps]
    posts += [(tree.position.x, tree.position.y, _TRUNK_M) for tree in ground.trees if tree.kind != "shrub"]
    posts += [(tree.position.x, tree.position.y, tree.crown_m) for tree in ground.trees if tree.kind == "shrub"]
    posts += [(pole.position.x, pole.position.y, _LAMP_M) for pole in ground.poles]
    posts += [(start.x, start.y, _START_M)]
    barriers = [
        shapely.LineString([(b.start.x, b.start.y), (b.end.x, b.end.y)]) for b in (*ground.hedges, *ground.fences)
    ]
    return (
        max(map(abs, way.bounds)) <= half
        and all(way.distance(_plan(scene, b.id)) >= room_m for b in scene.buildings)
        and all(way.distance(_outline(car)) >= room_m for car in ground.cars)
        and all(way.distance(barrier) >= room_m + _BARRIER_M for barrier in barriers)
        and all(way.distance(shapely.Point(x, y)) >= room_m + wide_m for x, y, wide_m in posts)
    )


def _outline(car: Car) -> shapely.Polygon:
    """Of a parked one, on the plan."""
    turned = shapely.affinity.rotate(shapely.box(-2.15, -0.9, 2.15, 0.9), car.yaw, (0, 0), use_radians=True)
    return shapely.affinity.translate(turned, car.position.x, car.position.y)


def _target(scene: Scene) -> shapely.Polygon:
    return _plan(scene, scene.target)


def _plan(scene: Scene, building: str) -> shapely.Polygon:
    return shapely.Polygon([(p.x, p.y) for p in scene.building(building).footprint])


def _points(way: shapely.LineString) -> tuple[Point2, ...]:
    return tuple(Point2(x=round(x, 2), y=round(y, 2)) for x, y in way.coords)
