"""What the events of a delivery tell, one model a kind; `contracts.events` has the events themselves."""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AliasChoices, AliasPath, ConfigDict, Field, JsonValue

from contracts.base import Metres, Name, Unit, Wire
from contracts.cameras import Camera, default_rig
from contracts.depth_assist import ApproachAnswer, DirectionPoint, ExploreDrawing, PlanPoint, ViewpointAnswer
from contracts.flight_limits import GuardAction, RefusalReason
from contracts.geometry import Point2, Point3, PointLabel, Pose
from contracts.llm_parser import ParseAnswer
from contracts.orchestrator import DeliveryResult, OpenQuestion
from contracts.sim import Verdict
from contracts.vlm_gateway import BuildingBoxAnswer, ChooseDirectionAnswer, FindObjectAnswer, FloorCountAnswer, Match

Seconds = Annotated[float, Field(ge=0.0)]


def _from_explore(name: str) -> Any:
    return Field(default=None, validation_alias=AliasChoices(name, AliasPath("explore", name)))


class NoData(Wire):
    """The event's message says all."""


class ParsedData(Wire):
    """What the parser made of the customer's words."""

    request: str
    answer: ParseAnswer
    seconds: Seconds


class AnswerData(Wire):
    """What the customer says to a question of the mission."""

    question: str
    text: str


class PlacedData(Wire):
    """The drone is at its start. `vehicle` is its name, which records of version 0.1 call `episode`; `vehicle_kind`
    what it says that it is."""

    vehicle: Name = Field(validation_alias=AliasChoices("vehicle", "episode"))
    vehicle_kind: str = ""
    pose: Pose
    cameras: tuple[Name, ...] = ()


class StandOffData(Wire):
    """How far the facade is ahead, and how much of its height one picture spans from there."""

    stand_off_m: Metres
    span_m: Metres
    pose: Pose


class FacadeBand(Wire):
    """The stretch of facade that one picture shows, from `lower_m` to `upper_m` above ground, seen from `camera_m`;
    `number` counts from 1 at the ground."""

    number: int = Field(ge=1)
    lower_m: float
    upper_m: float
    camera_m: float


class BandDecision(Wire):
    """With `Climb` the band to look at next, with `Recount` the one to count again; null for the whole building."""

    band: FacadeBand | None
    floors_counted: float


class FinalHeightDecision(Wire):
    """The height to fly to, by floors `floor_height_m` high."""

    height_m: float
    floor_height_m: float
    floors_counted: float


class FloorNotFoundDecision(Wire):
    """The facade ends below the floor; `best_guess_m`: the topmost counted floor's windows, null without any."""

    floors_counted: float
    facade_top_m: float
    best_guess_m: float | None


FloorDecision: TypeAlias = BandDecision | FinalHeightDecision | FloorNotFoundDecision
FloorDecisionName = Literal["Climb", "FinalHeight", "Recount", "FloorNotFound"]


class FloorCountData(Wire):
    """One floor count and what eq. 3 makes of it. `band` is null for a picture of the whole building. `floors_new`: the
    floors that are new in this band, after the answer was held against the rows of windows; null without a readable
    answer."""

    pose: Pose
    band: FacadeBand | None
    facade_top_m: float | None
    floors_new: int | None
    floors_wanted: int | None
    answer: FloorCountAnswer
    decision: FloorDecisionName
    detail: FloorDecision
    seconds: Seconds


class BuildingBoxData(Wire):
    """Where the building is in the front picture, at the final height."""

    pose: Pose
    answer: BuildingBoxAnswer
    seconds: Seconds


class HeightCheckData(Wire):
    """One more count at the final height. `row_m`: how high the row of windows level with the camera is, null where
    none is; `floor_seen`: its floor, counted from the ground, null where that is too far beneath; `confirmed`:
    a row is there, and nothing says that it is another floor's; null where the answer tells no rows."""

    pose: Pose
    floor_wanted: int | None
    floor_seen: int | None
    row_m: float | None
    confirmed: bool | None
    answer: FloorCountAnswer
    seconds: Seconds


class JudgedMatch(Match):
    """A match and what depth says of it. `place` and `distance_m` are null without depth in the box; `rejected`: why it
    can't be the window asked for, null if it can; `accepted`: it is the one that the mission goes by."""

    place: Point3 | None
    distance_m: Metres | None
    accepted: bool
    rejected: str | None


def picture_name(camera: Camera) -> str:
    """The short name of a camera's picture in an event: where it looks, degrees right of the nose and up or down."""
    heading, pitch = round(camera.heading_deg), round(camera.pitch_deg)
    if pitch:
        return f"view{heading:+d}{'up' if pitch > 0 else 'down'}{abs(pitch)}"
    return "view" if heading == 0 else f"view{heading:+d}"


class LookedView(Wire):
    """One camera's view in a look; `picture`: the short name of its picture among the event's, `depth`: that of its
    depth drawn for people (`mission.depth_pictures`), null where the camera has none."""

    camera: Camera
    picture: str
    depth: str | None = None


def _default_views() -> tuple[LookedView, ...]:
    return tuple(LookedView(camera=camera, picture=picture_name(camera)) for camera in default_rig().cameras)


class LookData(Wire):
    """One look with all cameras for the object. `views`: those of the default rig where a record of version 0.1 does
    not tell. `sightings` are the answer's matches that are sure enough to be worth a
    judgement; `returns`: plan points where depth hit something, for drawing."""

    exploration_step: int = Field(ge=0)
    pose: Pose
    object: str | None
    answer: FindObjectAnswer
    views: tuple[LookedView, ...] = Field(default_factory=_default_views)
    sightings: tuple[JudgedMatch, ...] = ()
    returns: tuple[PlanPoint, ...] = ()
    render_s: Seconds
    seconds: Seconds

    @property
    def accepted(self) -> JudgedMatch | None:
        """The sighting that the mission goes by."""
        return next((s for s in self.sightings if s.accepted), None)


class DirectionData(Wire):
    """The way on by the paper's rule: the view (eq. 4-6), its five points (eq. 7), those `offered` to the choice model,
    and the one flown to; `label` is null where the drone turns on the spot instead, `by` says who chose or why not.
    `answer` is null where no model was asked."""

    exploration_step: int = Field(ge=0)
    camera: Name
    heading_deg: float
    viewpoint: ViewpointAnswer
    points: tuple[DirectionPoint, ...]
    offered: tuple[PointLabel, ...]
    label: PointLabel | None
    by: str
    answer: ChooseDirectionAnswer | None
    seconds: Seconds | None = None


class SearchData(Wire):
    """The way on by a search policy, in a form that every policy can tell: the facade as it knows it, for drawing, the
    share of it that was inspected, and where it flies next, each null where it does not tell. `details` are the
    policy's own. Records of version 0.1 have the contour explorer's answer as `explore`."""

    exploration_step: int = Field(ge=0)
    policy: Name | None = None
    drawing: ExploreDrawing | None = _from_explore("drawing")
    inspected_share: Unit | None = _from_explore("inspected_share")
    stop: Point2 | None = _from_explore("stop")
    details: dict[str, JsonValue] = Field(default={}, validation_alias=AliasChoices("details", "explore"))


class MoveData(Wire):
    """One flight, from `start` (on the wire: `from`) along `path` to `to`; `reached` is false where something stopped
    it early. `path_m` and `flight_s` are of this move; `waited_s`: so long it was put off before that, for who walked
    or drove by, 0 where a step that had flown it was done again."""

    model_config = ConfigDict(serialize_by_alias=True, validate_by_name=True)

    number: int = Field(ge=1)
    start: Pose = Field(alias="from")
    to: Pose
    path: tuple[Point3, ...]
    reached: bool
    collided: bool
    hit: str | None
    path_m: Metres
    flight_s: Seconds
    waited_s: Seconds = 0.0

    @property
    def corners(self) -> tuple[Point3, ...]:
        """The places flown over between `start` and `to`, as far as they are known."""
        return self.path[:-1] if self.reached else ()


class TurnData(MoveData):
    """A turn on the spot: a move without a path."""


class ApproachData(Wire):
    """The next leg to the window; `confirmed`: the object was seen a second time, surely enough to be claimed."""

    answer: ApproachAnswer
    max_leg_m: Metres
    confirmed: bool


class LostData(Wire):
    """An approach was given up: what was seen at `place` did not stand up, or the way to it is not free (`blocked`)."""

    place: Point3
    blocked: bool


class RefusedData(Wire):
    """The flight guard refused a flight along `path`, and where on it; `action`: what it had the drone do instead,
    `none` where another plan is worth trying."""

    reason: RefusalReason
    at: Point3 | None
    path: tuple[Point3, ...]
    action: GuardAction


class OutageData(Wire):
    """A machine that the next step needs is away, and waited for, or back after `waited_s` (`over`)."""

    why: str
    waited_s: Seconds
    over: bool


EventData: TypeAlias = (
    NoData
    | ParsedData
    | OpenQuestion
    | AnswerData
    | PlacedData
    | StandOffData
    | FloorCountData
    | HeightCheckData
    | BuildingBoxData
    | LookData
    | DirectionData
    | SearchData
    | MoveData
    | TurnData
    | ApproachData
    | LostData
    | RefusedData
    | OutageData
    | Verdict
    | DeliveryResult
)
