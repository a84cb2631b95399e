"""One task of a set: a delivery to fly, with the truth by which it is judged."""

import hashlib
from typing import Literal

from pydantic import Field

from contracts.base import Metres, Name, Wire
from contracts.geometry import Point3
from contracts.scene import BuildingKind, Scene
from evaluation.scene_generator.scene_plan import Difficulty
from evaluation.task_set.mixture import StartName

Category = Literal["tools", "containers", "household", "food", "furniture", "posters", "toys", "ornaments"]


class Task(Wire):
    """One delivery to fly. Everything after `scene` is truth: for judging and statistics, never for a mission.

    `target` is the goal window's centre (or the goal object's, where it stands free), metres ENU; `target_height_m` its
    height. `shortest_*` is the shortest collision-free way from the start to a place where the delivery would succeed.
    `clearance_m` is what that way keeps from the walls, the drone's own where there is room; null in sets of the first
    edition, which begin with 0.8 m. `start`: which kind of start a mixture drew; `ambiguous`: a second object fits the
    request, so that the right end is to say so. `corners` counts the building's corners between the starting facade and
    the target's, the shorter way round; `difficulty` follows from it."""

    id: Name
    seed: int = Field(ge=0)
    request: str
    template: str
    style: str
    scene: Scene
    building: Name
    building_kind: BuildingKind
    footprint: str
    floors: int
    floor: int
    object: str
    object_kind: Name
    object_colour: Name
    category: Category
    target: Point3
    target_height_m: float
    floor_height_m: float
    corners: int
    difficulty: Difficulty
    shortest_horizontal_m: Metres
    shortest_spatial_m: Metres
    start: StartName | None = Field(default=None, exclude_if=lambda start: start is None)
    ambiguous: bool = Field(default=False, exclude_if=lambda twin: not twin)
    clearance_m: Metres | None = Field(default=None, exclude_if=lambda clearance: clearance is None)

    @property
    def content(self) -> str:
        """A SHA-256 of all but the names of task and scene, which `tasks generate --name` sets."""
        scene = self.scene.model_copy(update={"name": "-"})
        nameless = self.model_copy(update={"id": "-", "scene": scene})
        return hashlib.sha256(nameless.model_dump_json().encode()).hexdigest()

    @property
    def absent(self) -> bool:
        """Is the object not there at all? Then the right end is that it was not found."""
        return self.scene.goal is None
