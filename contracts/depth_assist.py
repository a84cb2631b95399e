"""depth_assist: viewpoint selection, safe distances, approach. Equation numbers are the paper's."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from contracts.base import Metres, Name, Unit, Wire
from contracts.cameras import MAX_CAMERAS, Camera
from contracts.geometry import Box, Point2, Point3, PointLabel, Pose
from contracts.images import DepthMap
from contracts.keep_out import AllKeepOuts

Positive = Annotated[float, Field(gt=0.0, le=10_000.0)]


class ViewDepth(Wire):
    """One camera's depth, in the size of the camera's pictures."""

    camera: Camera
    depth: DepthMap

    @model_validator(mode="after")
    def _same_size(self) -> Self:
        camera, depth = self.camera, self.depth
        if (camera.width, camera.height) != (depth.width, depth.height):
            raise ValueError(
                f"camera {camera.name} takes {camera.width} x {camera.height} pixels; its depth map has "
                f"{depth.width} x {depth.height}"
            )
        return self


class ViewpointConstants(Wire):
    """Free constants of eq. 4-6. `d_max_m` is where the search of `d_max` starts; each step without a valid split
    raises it by `d_max_step_m` up to `d_max_limit_m`, and a valid split resets it.

    Why these values: delta must exceed what belongs to a facade (balconies up to 2.5 m, setbacks, the notches of an L)
    and stay below the width of a street. A facade flown along at 8-10 m fills the view to about 22 degrees from the
    direction of flight within 25 m; what is left up to the vanishing point is about two slices. A larger d_max lets
    the drone drift away from the building before the side view calls it back. On isolated squares of 10-40 m, 3:1
    rectangles and L shapes, from 8, 9 and 10 m, every delta of 4-8 m with every d_max of 15-30 m laps all of them.
    """

    slices: int = Field(default=20, ge=4, le=200)
    delta_m: Positive = 6.0
    d_max_m: Positive = 25.0
    d_max_step_m: Metres = 10.0
    d_max_limit_m: Positive = 60.0
    max_over: int = Field(default=2, ge=0, le=200)
    sensor_range_m: Positive = 60.0


class ViewpointSettings(ViewpointConstants):
    """How a view is picked: by eq. 4-6, by chance, or always the one along the building."""

    policy: Literal["paper", "random", "default"] = "paper"
    direction: Literal["clockwise", "counterclockwise"] = "clockwise"


class ViewpointQuestion(Wire):
    """Level views alone are looked at. `building_box`, of the view that looks ahead, crops the rows (its y-range only);
    `d_max_m` is the value that the last answer handed back, null
    at the first step; `seed` serves the `random` policy."""

    views: tuple[ViewDepth, ...] = Field(min_length=1, max_length=MAX_CAMERAS)
    building_box: Box | None = None
    settings: ViewpointSettings = ViewpointSettings()
    d_max_m: Positive | None = None
    seed: int = Field(default=0, ge=0, le=2**63 - 1)


class Split(Wire):
    """One candidate split after slice `j` (1..slices - 1), counted from the open side: from the picture's left flying
    clockwise, from its right flying counter-clockwise. `difference_m` is open side minus facade side (eq. 4),
    `variance_m2` the sum of squared deviations within both parts (eq. 5), `over` how many facade slices lie beyond
    d_max."""

    j: int
    difference_m: float
    variance_m2: float
    over: int
    valid: bool


class ViewScore(Wire):
    """`slice_means_m` from the picture's left to its right, whatever the direction; null where no pixel was valid."""

    camera: Name
    heading_deg: float
    slice_means_m: tuple[float | None, ...]
    splits: tuple[Split, ...]
    best_j: int | None


class ViewpointAnswer(Wire):
    """The view chosen. `reason`: `split` (eq. 6 chose), `no_split` (the default view, d_max raised for the next step),
    or the ablation `random` / `default`. `d_max_next_m` goes into the next question."""

    camera: Name
    heading_deg: float
    reason: Literal["split", "no_split", "random", "default"]
    d_max_m: float
    d_max_next_m: float
    views: tuple[ViewScore, ...]


class SafeDistanceSettings(Wire):
    """`corridor`: how far the drone, as a ball grown by `clearance_m`, flies before it would touch a return, at most
    `l_max_m`; where something lies nearer than that already, the ball is grown by as much as there is room, but by
    `tight_clearance_m` at least. `bare`: eq. 7 as printed, the one pixel's distance."""

    variant: Literal["corridor", "bare"] = "corridor"
    l_max_m: Positive = 10.0
    drone_radius_m: Positive = 0.35
    clearance_m: Metres = 1.5
    tight_clearance_m: Metres = 0.5
    sensor_range_m: Positive = 60.0


class SafeDistancesQuestion(Wire):
    """`view` must be level; `others`: further views of the same moment; the corridors of the outer points leave the
    picture of `view`, and only other cameras see what stands there, overhead or underneath. With the drone's `height_m`
    above ground, the ground is no obstacle of a corridor above it."""

    view: ViewDepth
    others: tuple[ViewDepth, ...] = Field(default=(), max_length=MAX_CAMERAS)
    height_m: Metres | None = None
    settings: SafeDistanceSettings = SafeDistanceSettings()


class DirectionPoint(Wire):
    """Point k of 5 at x = k/6 of the width, on the horizon. `bearing_deg` is relative to the nose, positive to the
    right; `distance_m` how far one may fly along it; `nearest_return_m` what limits it, null if nothing does."""

    label: PointLabel
    x: Unit
    y: Unit
    bearing_deg: float
    distance_m: Metres
    nearest_return_m: float | None
    corridor_half_width_m: float


class SafeDistancesAnswer(Wire):
    points: tuple[DirectionPoint, ...]


class ApproachSettings(Wire):
    """The drone stops `stop_distance_m` in front of the thing in the box along the facade's normal, farther out where
    a railing or ledge needs it, and keeps `clearance_m` beyond its own radius all the way. It keeps its height while
    that is within `height_slack_m` of the thing's."""

    drone_radius_m: Positive = 0.35
    clearance_m: Metres = 0.6
    stop_distance_m: Positive = 1.5
    height_slack_m: Metres = 0.75
    sensor_range_m: Positive = 60.0


class ApproachQuestion(Wire):
    """`pose` is the drone's measured pose when the view was taken; `others`: further views of the same moment, for what
    lies beside the way. `max_leg_m` caps the flight, so that a far target is approached in several looks. `keep_out`:
    what no way may lead into."""

    view: ViewDepth
    others: tuple[ViewDepth, ...] = Field(default=(), max_length=MAX_CAMERAS)
    box: Box
    pose: Pose
    settings: ApproachSettings = ApproachSettings()
    max_leg_m: Positive = 40.0
    keep_out: AllKeepOuts = ()


class ApproachAnswer(Wire):
    """`target`: the thing's place by depth (its z is the height above ground). `facing_yaw`: towards the facade it
    stands at, along the facade's estimated normal; `plane_share` is how much of the surroundings lies on the plane that
    was fitted, 0 where none fitted and the facade is taken to face the drone. `path`: waypoints in flying order; empty
    with `clear` where nothing stands in the way but no camera looks along it: turn to `facing_yaw` and look again.
    `reached`: the path ends at `stop` rather than at a cut-off leg. `target_distance_m`: level, from the drone.
    `free_distance_m`: how much of the straight line towards `stop` is free. `status` other than `clear` comes with an
    empty path: `blocked` where no free way was seen, `no_depth` where nothing is measured in the box. `aside`: with
    `blocked`, a free way to a place that looks at the thing from another side, where there is one."""

    status: Literal["clear", "blocked", "no_depth"]
    target: Point3 | None = None
    facing_yaw: float | None = None
    plane_share: float | None = None
    stop: Point3 | None = None
    path: tuple[Point3, ...] = ()
    aside: tuple[Point3, ...] = ()
    reached: bool = False
    target_distance_m: float | None = None
    free_distance_m: float | None = None


class ExploreSettings(Wire):
    """Free constants of the contour explorer. A move is at most `l_max_m` long, at least `min_move_m`, and keeps
    `clearance_m` beyond the drone's radius, `tight_clearance_m` where there is no more room. Facade counts as inspected
    that a stop saw from up to `inspect_range_m` and at most `inspect_incidence_deg` from its normal: what the
    recogniser can be trusted with."""

    l_max_m: Positive = 10.0
    min_move_m: Positive = 1.0
    drone_radius_m: Positive = 0.35
    clearance_m: Metres = 1.5
    tight_clearance_m: Metres = 0.95
    sensor_range_m: Positive = 60.0
    inspect_range_m: float = Field(default=11.5, ge=4.0, le=40.0)
    inspect_incidence_deg: float = Field(default=62.0, ge=20.0, le=80.0)


class ExploreQuestion(Wire):
    """The views of one moment and the measured pose they were taken at; the level ones make the map, all of them check
    the way. `map` is what the last answer handed back, null at the first step, when the target building lies ahead,
    within `building_box`'s width in the view that looks ahead, if there is one. `keep_out`: what no way may lead
    into."""

    views: tuple[ViewDepth, ...] = Field(min_length=1, max_length=MAX_CAMERAS)
    pose: Pose
    map: str | None = Field(default=None, min_length=4, max_length=1024 * 1024)
    building_box: Box | None = None
    settings: ExploreSettings = ExploreSettings()
    keep_out: AllKeepOuts = ()


PlanPoint = tuple[float, float]
"""East and north in metres, for drawing."""


class ExploreDrawing(Wire):
    """The map's facade as plan points, a cell of `cell_m` each, and the way planned beyond the next stop."""

    cell_m: float
    inspected: tuple[PlanPoint, ...]
    uninspected: tuple[PlanPoint, ...]
    expected: tuple[PlanPoint, ...]
    way: tuple[PlanPoint, ...]


class ExploreAnswer(Wire):
    """`move`: fly level to `stop`, `distance_m` away at `bearing_deg` (from the nose, positive to the right), and turn
    to `yaw`; `turn`: stay and turn to `yaw`; `done`: nothing is left that can be reached and seen. `gain_m` is how
    much facade the place `way_m` ahead will show. `inspected_share`: of the facade known or expected so far. `map`
    goes into the next question."""

    status: Literal["move", "turn", "done"]
    reason: str
    stop: Point2 | None
    bearing_deg: float
    distance_m: Metres
    yaw: float
    gain_m: Metres
    way_m: Metres
    inspected_share: Unit
    step: int
    map: str
    drawing: ExploreDrawing
