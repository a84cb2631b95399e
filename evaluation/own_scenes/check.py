"""What is wrong with a scene, found before anybody flies in it: all that is, with what would be right."""

import math
from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

from contracts.near import did_you_mean
from contracts.scene import Scene, SceneObject, WindowPlace
from contracts.scene_layout import floor_outline, goal_window, wall_height_m, window_of
from contracts.sim import CatalogueEntry
from evaluation.own_scenes.starts import FARTHEST_M, NEAREST_M, faced_wall
from evaluation.scene_generator.footprints import distance_to_outline, outlines_gap
from evaluation.sim_client import SimClient, SimulatorFault
from evaluation.task_set.proof import NotSolvable, prove
from evaluation.task_set.shortest import OWN_CLEARANCE_M, SECOND

Weight = Literal["error", "warning"]
NARROW_M = 2 * OWN_CLEARANCE_M + 1.0
"""Between two buildings: the drone can't pass with its clearance to both, and a metre to steer in."""


class Problem(NamedTuple):
    """`error`: it can't be flown in; `warning`: it can, but most likely not as it was meant."""

    weight: Weight
    text: str


def problems_of(scene: Scene, simulator: SimClient) -> list[Problem]:
    """Everything that is found, errors first; a scene without errors is also flown through once, with the truth, where
    it has a goal. Raises SimulatorFault where the simulator can't be asked."""
    entries = {entry.kind: entry for entry in simulator.catalogue().entries}
    found = [*_objects(scene, entries), *_start(scene), *_goal(scene), *_neighbours(scene)]
    if not any(problem.weight == "error" for problem in found):
        found += _flown(scene, simulator)
    return sorted(found, key=lambda problem: problem.weight)


def _objects(scene: Scene, entries: Mapping[str, CatalogueEntry]) -> Iterator[Problem]:
    for thing in scene.objects:
        entry = entries.get(thing.kind)
        if entry is None:
            near = did_you_mean(thing.kind, entries)
            yield Problem(
                "error", f"object {thing.id}: the catalogue has no {thing.kind!r}{near}; it has {', '.join(entries)}"
            )
        else:
            yield from _of_its_class(thing, entry)
        if isinstance(thing.place, WindowPlace):
            yield from _window(scene, thing, thing.place)


def _of_its_class(thing: SceneObject, entry: CatalogueEntry) -> Iterator[Problem]:
    if thing.colour not in entry.colours:
        yield Problem(
            "error",
            f"object {thing.id}: a {thing.kind} does not come in {thing.colour!r}"
            f"{did_you_mean(thing.colour, entry.colours)}; it comes in {', '.join(entry.colours)}",
        )
    on = thing.place.on if isinstance(thing.place, WindowPlace) else "free"
    if on not in entry.places:
        yield Problem(
            "warning", f"object {thing.id}: a {thing.kind} is made for {', '.join(entry.places)}, not for {on}"
        )


def _window(scene: Scene, thing: SceneObject, place: WindowPlace) -> Iterator[Problem]:
    try:
        slot = window_of(scene, place)
    except ValueError as error:
        yield Problem("error", f"object {thing.id}: {error}")
        return
    if place.on == "balcony" and slot.balcony is None:
        yield Problem(
            "error",
            f"object {thing.id}: its window has no balcony; put it on the sill, or give building {place.building} "
            f"balconies at facade {place.facade}, column {place.column}",
        )


def _start(scene: Scene) -> Iterator[Problem]:
    start = scene.start.position
    for building in scene.buildings:
        outline = floor_outline(building, 1)
        if start.z < wall_height_m(building) and distance_to_outline((start.x, start.y), outline) == 0.0:
            yield Problem("error", f"start: ({start.x:g}, {start.y:g}) is inside building {building.id}")
    wall = faced_wall(scene, (start.x, start.y), scene.start.yaw)
    if wall is None or wall.building != scene.target:
        seen = "nothing" if wall is None else f"building {wall.building}"
        yield Problem(
            "warning", f"start: the drone faces {seen}, not the target {scene.target}; turn start.yaw towards it"
        )
    elif not NEAREST_M <= wall.away_m <= FARTHEST_M:
        best = f"from {NEAREST_M:g} to {FARTHEST_M:g} m floors are counted best"
        yield Problem("warning", f"start: {wall.away_m:.1f} m before the wall; {best}")


def _goal(scene: Scene) -> Iterator[Problem]:
    goal = scene.goal_object()
    if goal is None:
        yield Problem("warning", "goal: none is named, so nobody judges: a delivery ends as stopped_not_judged")
        return
    if not isinstance(goal.place, WindowPlace):
        yield Problem("warning", f"goal: {goal.id} stands free and at no window")
        return
    if goal.place.building != scene.target:
        yield Problem("warning", f"goal: {goal.id} is at building {goal.place.building}, the target is {scene.target}")
    for other in scene.objects:
        place = other.place
        alike = (other.kind, other.colour) == (goal.kind, goal.colour) and other.id != goal.id
        if alike and isinstance(place, WindowPlace) and place.floor == goal.place.floor:
            where = f"facade {place.facade}, column {place.column} of building {place.building}"
            yield Problem("warning", f"goal: {other.id} is the same thing on the same floor, at {where}")


def _neighbours(scene: Scene) -> Iterator[Problem]:
    target = scene.building(scene.target)
    for other in scene.buildings:
        if other.id == target.id:
            continue
        gap_m = outlines_gap(floor_outline(target, 1), floor_outline(other, 1))
        if gap_m < NARROW_M:
            said = "touch" if math.isclose(gap_m, 0.0, abs_tol=0.01) else f"are {gap_m:.1f} m apart"
            need = f"the drone flies between them from {NARROW_M:.1f} m"
            yield Problem("warning", f"building {other.id} and the target {said}: {need}")


def _flown(scene: Scene, simulator: SimClient) -> list[Problem]:
    """What the simulator says of it, and whether the goal can be delivered to."""
    try:
        simulator.close(simulator.open(scene).id)
    except SimulatorFault as error:
        return [Problem("error", str(error))]
    if goal_window(scene) is None:
        return []
    try:
        prove(scene, simulator, SECOND)
    except NotSolvable as error:
        return [Problem("warning", f"goal: it can't be delivered to: {error}")]
    return []
