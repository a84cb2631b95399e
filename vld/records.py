"""What the task set and the evaluation write down: tasks, flown episodes, runs."""

from typing import Annotated, Any, Literal

from pydantic import Field

from contracts.base import Metres, Name, Wire
from contracts.geometry import Point3
from contracts.orchestrator import DeliveryResult, MissionSettings
from contracts.scene import BuildingKind, Scene
from vld.scene_plan import Difficulty

Category = Literal["tools", "containers", "household", "food", "furniture", "posters", "toys", "ornaments"]
Reason = Literal[
    "success",
    "parse",
    "floor",
    "missed_object",
    "wrong_object",
    "lost_building",
    "blocked",
    "collision",
    "timeout",
    "unreadable",
    "unreachable",
    "error",
]
"""Why an episode ended as it did: the failure taxonomy, and `success`."""


class Task(Wire):
    """One delivery to fly. Everything after `scene` is truth: for judging and statistics, never for a mission.

    `target` is the goal window's centre (or the goal object's, where it stands free), metres ENU; `target_height_m` its
    height. `shortest_*` is the shortest collision-free way from the start to a place where the delivery would succeed.
    `corners` counts the building's corners between the starting facade and the target's, the shorter way round;
    `difficulty` follows from it.
    """

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

    @property
    def absent(self) -> bool:
        """Is the object not there at all? Then the right end is that it was not found."""
        return self.scene.goal is None


class EpisodeRecord(Wire):
    """One task as flown by one arm. `error` is set, and `result` null, where the episode itself broke: it counts as a
    failure and stays in every denominator. `folder` holds its pictures, where the run keeps them."""

    task: Name
    reason: Reason
    result: DeliveryResult | None
    error: str | None = None
    started: str
    wall_s: Annotated[float, Field(ge=0)]
    render_s: Annotated[float, Field(ge=0)] = 0.0
    model_s: Annotated[float, Field(ge=0)] = 0.0
    folder: str | None = None

    @property
    def success(self) -> bool:
        return self.reason == "success"


class RunSettings(Wire):
    """Everything needed to fly a run again."""

    tasks: str
    checksum: str
    count: int
    backend: Name
    mission: MissionSettings
    oracle: dict[str, float] = {}
    workers: int
    versions: dict[str, str]
    renderer: str | None = None
    model: dict[str, Any] = {}
