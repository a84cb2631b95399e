"""The people and cars of one episode, as far as they run into its drone; birds make way."""

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from contracts.scene import Scene
from contracts.scene_traffic import Bird, Mover
from episode_kit.drone import LOOK_S
from episode_kit.encounters import STEP_S, Met
from episode_kit.kinematics import Vector
from service_kit.errors import BadQuestion
from services.sim.geometry.courses import courses_of


class Traffic:
    """`looks`: how many were taken so far; the clock goes on with each."""

    def __init__(self, scene: Scene, radius_m: float, looks: Callable[[], int]) -> None:
        self._courses = courses_of(scene)
        self._radius_m = radius_m
        self._looks = looks

    def met(self, places: NDArray[np.float64], time_s: NDArray[np.float64]) -> Met | None:
        """As `episode_kit.encounters.Movers` has it."""
        return self._first(places, time_s + self._looks() * LOOK_S)

    def strikes(self, place: Vector, from_s: float, until_s: float) -> str | None:
        """What runs into a drone that stays at `place` between these two times of the vehicle's clock."""
        times = np.linspace(from_s, until_s, 1 + int(np.ceil((until_s - from_s) / STEP_S)))
        met = self._first(np.tile(place, (len(times), 1)), times)
        return None if met is None else met.name

    def _first(self, places: NDArray[np.float64], clock_s: NDArray[np.float64]) -> Met | None:
        found: Met | None = None
        for course in self._courses:
            touching = np.flatnonzero(course.clearance_m(places, clock_s) < self._radius_m)
            if len(touching) and (found is None or touching[0] < found.at):
                found = Met(int(touching[0]), course.mover.id)
        return found


def check_traffic(scene: Scene) -> None:
    """Raises BadQuestion for a way that on foot or wheels leads into a building."""
    for mover in scene.traffic:
        if not isinstance(mover, Bird) and (building := _in_the_way(scene, mover)) is not None:
            raise BadQuestion(
                f"the way of {mover.id} leads into building {building}; the ways of people and cars stay outside",
                code="bad_scene",
            )


def _in_the_way(scene: Scene, mover: Mover) -> str | None:
    way = shapely.LineString([(p.x, p.y) for p in mover.way])
    for building in scene.buildings:
        if way.intersects(shapely.Polygon([(p.x, p.y) for p in building.footprint])):
            return building.id
    return None
