"""orchestrator: deliveries, their settings, their events, their results."""

from typing import Annotated, Any, Literal, Self

from pydantic import AwareDatetime, BeforeValidator, ConfigDict, Field, JsonValue, field_validator, model_validator

from contracts.base import Metres, ModelName, Name, Unit, Wire
from contracts.cameras import Rig, default_rig, flyable, shipped_rig
from contracts.depth_assist import ApproachSettings
from contracts.flight_limits import FlightLimits
from contracts.geometry import Pose
from contracts.scene import Scene
from contracts.sensor_profiles import SensorFault, SensorsOrName
from contracts.sim import Flight, Verdict

OutcomeName = Literal[
    "delivered",
    "stopped_not_judged",
    "wrong_window",
    "not_in_front",
    "collision",
    "object_not_found",
    "request_incomplete",
    "request_unreadable",
    "object_unknown",
    "no_building",
    "floor_not_found",
    "answer_unreadable",
    "blocked",
    "stopped_by_guard",
    "model_unreachable",
    "service_unreachable",
    "vehicle_lost",
    "deadline_passed",
    "cancelled",
    "failed",
]
DeliveryStatus = Literal["waiting", "flying", "needs_answer", "done"]
Phase = Literal["parse", "place", "floors", "explore", "approach", "claim", "done"]
QuestionTopic = Literal["request", "unknown_object"]
Positive = Annotated[float, Field(gt=0.0, le=1_000.0)]
MAX_LATENCIES = 1000
MAX_PRIORITY = 9


class SightingSettings(Wire):
    """When a sighting is believed. With `look-again` it is a candidate: the drone flies nearer and asks again; what is
    seen a second time, one of both times surely enough, is claimed, anything else dropped, and the search goes on. With
    `claim-at-first-sight`, the paper's way, the first sighting that may be claimed is flown to and claimed.

    `claim_confidence`: from which a sighting may be claimed; null: what the model says of itself, or any that it
    names. `candidate_confidence`: from which one is worth a nearer look. `sure_confidence`: from which one made from
    near needs no second look. Every look counts as a step."""

    policy: Literal["look-again", "claim-at-first-sight"] = "look-again"
    claim_confidence: Unit | None = None
    candidate_confidence: Unit = 0.3
    sure_confidence: Unit = 0.9


class SearchSettings(Wire):
    """The search policy by name, null for the default one, and beside the name its own settings; which there are, the
    policy says. Results are recorded with all of them written out."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, JsonValue] = Field(init=False)

    policy: Name | None = None

    @property
    def constants(self) -> dict[str, JsonValue]:
        """The policy's own settings, as far as they are given."""
        return dict(self.__pydantic_extra__)


def _rig_by_name(given: object) -> object:
    """A shipped rig's name stands for it. Raises ValueError for a name that none has."""
    return shipped_rig(given) if isinstance(given, str) else given


RigOrName = Annotated[Rig, BeforeValidator(_rig_by_name, json_schema_input_type=Rig | Name)]


class MissionSettings(Wire):
    """Every free constant of a mission, recorded with its result. Null models mean the gateway's default per role.
    `rig`: the cameras of a simulated drone, as a document or by a shipped rig's name; `image_size`: the longer side of
    every camera's pictures in pixels, null as the rig says. `limits`: narrower ones than the operator's, whose own
    always hold. `sensors`: what a simulated drone senses with, as a
    document or by a shipped profile's name, null as the scene says; `faults`: of its sensors, for tests.
    `ground_floor`: how a plain "first floor" counts, as in `ParseQuestion`; null as the parser is set up."""

    floors: Literal["stepwise", "direct-count"] = "stepwise"
    band_reading: Literal["upper_edge", "camera_height"] = "upper_edge"
    viewpoint: SearchSettings = SearchSettings()
    approach: ApproachSettings = ApproachSettings()
    sightings: SightingSettings = SightingSettings()
    flight: Flight = Flight()
    parser_model: ModelName | None = None
    vision_model: ModelName | None = None
    ground_floor: Literal[0, 1] | None = None
    max_exploration_steps: int = Field(default=30, ge=1, le=200)
    max_bands: int = Field(default=12, ge=1, le=50)
    take_off_height_m: Metres = 1.5
    fallback_turn_deg: float = Field(default=30.0, ge=1.0, le=180.0)
    max_model_failures: int = Field(default=3, ge=0, le=20)
    rig: RigOrName = Field(default_factory=default_rig)
    image_size: int | None = Field(default=None, ge=64, le=1600)
    limits: FlightLimits | None = None
    sensors: SensorsOrName = None
    faults: tuple[SensorFault, ...] = Field(default=(), max_length=16)
    seed: int = Field(default=0, ge=0, le=2**31 - 1)

    @property
    def rig_flown(self) -> Rig:
        """The rig with pictures of the size asked for."""
        return self.rig if self.image_size is None else self.rig.scaled_to(self.image_size)

    @model_validator(mode="after")
    def _can_be_flown(self) -> Self:
        flyable(self.rig_flown)
        return self

    @model_validator(mode="before")
    @classmethod
    def _policies_have_their_own(cls, given: object) -> object:
        """Raises ValueError for what only some search policies have."""
        misplaced = [
            name for name in ("choice", "safe_distances", "explore") if isinstance(given, dict) and name in given
        ]
        if misplaced:
            raise ValueError(
                f"{misplaced[0]} is a setting of a search policy: give it under viewpoint, beside the name of a policy "
                "that has it"
            )
        return given


class DeliveryQuestion(Wire):
    """Bring it there: `request` in the customer's words, in `scene` or at a shipped `sample` (whose own request is
    used if none is given) in a simulator; with neither, a vehicle of the fleet flies where it stands.
    `answers`: given beforehand to the questions that it may ask, in their order; what is asked beyond them waits
    for the customer. `answer_within_s`: how long the customer's answer to a question is waited for; null: as the
    deployment is set up; 0: nobody is asked. `vehicle`: of the fleet, the only one that may fly it. Of the
    deliveries that wait, the one of the highest `priority` is flown first, of equal ones the oldest; none takes off
    before its `not_before`, and one that has not ended by its `deadline` ends then, in the air as well."""

    request: str | None = Field(default=None, min_length=1, max_length=4000)
    scene: Scene | None = None
    sample: Name | None = None
    backend: ModelName | None = None
    answers: tuple[Annotated[str, Field(min_length=1, max_length=1000, pattern=r"\S")], ...] = Field(
        default=(), max_length=8
    )
    answer_within_s: float | None = Field(default=None, ge=0.0, le=86_400.0)
    vehicle: Name | None = None
    priority: int = Field(default=0, ge=0, le=MAX_PRIORITY)
    not_before: AwareDatetime | None = None
    deadline: AwareDatetime | None = None
    settings: MissionSettings = MissionSettings()

    @model_validator(mode="after")
    def _can_be_in_time(self) -> Self:
        if self.not_before is not None and self.deadline is not None and self.deadline <= self.not_before:
            raise ValueError("deadline: give a time after not_before")
        return self


class OpenQuestion(Wire):
    """What the customer is asked before a delivery goes on: about the `request`, which leaves something open, or for
    something else at the window than an `unknown_object`. Without an answer `answer_by` the delivery ends."""

    topic: QuestionTopic
    text: str = Field(min_length=1, max_length=500)
    answer_by: AwareDatetime


class CustomerAnswer(Wire):
    """What the customer says to the question of a delivery."""

    text: str = Field(min_length=1, max_length=1000, pattern=r"\S")


class ModelCalls(Wire):
    """Counts of one role's model calls, by what the cache did and how they ended. `latencies_s`: what each call took
    that the cache did not answer, in the order asked, the first thousand. `models`: who answered, as they call
    themselves, in the order in which they first did."""

    calls: int = 0
    cache_hits: int = 0
    unreadable: int = 0
    refused: int = 0
    unreachable: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    seconds: float = 0.0
    latencies_s: tuple[float, ...] = Field(default=(), max_length=MAX_LATENCIES)
    models: tuple[str, ...] = ()


class Stop(Wire):
    """Where the drone stood when a model was asked, and what for."""

    phase: Phase
    pose: Pose


class DeliveryResult(Wire):
    """How a delivery ended. `steps` counts every stop with a model query, `stops` says where they were; `timings_s` is
    wall time by part. `rig` and `sensors`: the cameras of a simulated drone, and its sensor profile with its version.
    `inspected_share`: of the facade on that floor, where the search policy tells."""

    outcome: OutcomeName
    message: str
    steps: int
    exploration_steps: int
    path_m: float
    path_horizontal_m: float
    flight_s: float
    floor: int | None
    object: str | None
    final_height_m: float | None
    pose: Pose | None
    verdict: Verdict | None
    timings_s: dict[str, float]
    model_calls: dict[str, ModelCalls]
    renderer: str | None
    rig: Name | None = None
    sensors: Name | None = None
    stops: tuple[Stop, ...] = ()
    search_policy: Name | None = None
    inspected_share: Annotated[float, Field(ge=0.0, le=1.0)] | None = None

    @field_validator("outcome", mode="before")
    @classmethod
    def _of_version_0_2(cls, outcome: Any) -> Any:
        """A stop that nobody judges was called delivered then."""
        return "stopped_not_judged" if outcome == "delivered_not_judged" else outcome


class Delivery(Wire):
    """One delivery as it stands. `result` is null until `status` is `done`; `question` is what the customer is asked
    while it is `needs_answer`. `created`, `started` and `ended` are when it was asked for, when it got its vehicle and
    when it was over, in UTC. `scene`: null where a vehicle flies on its own. `vehicle`: of the fleet, the one that
    flies or flew it; `flights`: how often it was begun to be flown, more than once where a vehicle was lost."""

    id: Name
    status: DeliveryStatus
    phase: Phase
    request: str
    scene: str | None
    created: str
    started: str | None = None
    ended: str | None = None
    priority: int = 0
    vehicle: Name | None = None
    flights: int = 0
    folder: str | None
    question: OpenQuestion | None = None
    result: DeliveryResult | None = None


class DeliveryList(Wire):
    """A page. `next`: the `before` of the page that follows; null on the last one."""

    deliveries: tuple[Delivery, ...]
    next: Name | None = None


class StatusMessage(Wire):
    """What a webhook is sent when a delivery's status has changed; `type` is `delivery.` and the status."""

    type: str
    timestamp: AwareDatetime
    data: Delivery


class Sample(Wire):
    """A delivery that ships with the project."""

    name: Name
    title: str
    difficulty: Literal["easy", "moderate", "hard"]
    request: str
    scene: Scene
