"""orchestrator: what its pages show beside the deliveries themselves.

GET  /v1/overview                           Overview
GET  /v1/deliveries/{id}/drone              DroneSeen; 404 while no drone flies
GET  /v1/deliveries/{id}/street             StreetPlan; 404 where no scene is known
GET  /v1/deliveries/{id}/tracking           Tracking, for the delivery's customer
GET  /v1/deliveries/{id}/tracking/street    StreetPlan
GET  /v1/deliveries/{id}/tracking/picture   the picture of the stop, JPEG
GET  /v1/order-options                      OrderOptions
POST /v1/readings                           Reading; ReadingQuestion
"""

from typing import Literal

from pydantic import AwareDatetime, Field

from contracts.base import Metres, ModelName, Name, Unit, Wire
from contracts.fleet import FleetVehicle
from contracts.geometry import Point2, Pose
from contracts.llm_parser import Exchange, ParseAnswer
from contracts.orchestrator import DeliveryStatus, OpenQuestion, OutcomeName, Phase
from contracts.vehicle import VehicleState


class DeliveryLine(Wire):
    """A delivery as a list shows it. `outcome` and `message`: how it ended; `question`: what is asked now."""

    id: Name
    status: DeliveryStatus
    phase: Phase
    request: str
    scene: str | None
    created: AwareDatetime
    started: AwareDatetime | None
    ended: AwareDatetime | None
    priority: int
    vehicle: Name | None
    flights: int
    question: str | None
    outcome: OutcomeName | None
    message: str | None


class DroneSeen(Wire):
    """A drone as it told itself at `time`."""

    time: AwareDatetime
    state: VehicleState


class FlightSeen(Wire):
    """A delivery in the air, with what was asked for. `drone`: null where its vehicle does not tell, with the reason in
    `problem`. `street`: the key of the street that it flies in (`StreetPlan.key`), null where none is known. `stop`:
    where a record that is being written has the drone last; null where vehicles are asked themselves, and before
    take-off."""

    delivery: Name
    request: str
    drone: DroneSeen | None
    problem: str | None
    street: Name | None
    stop: Pose | None = None


class Overview(Wire):
    """The system at `time`. `counts`: of all deliveries by status. `deliveries`: the newest of those asked for, `next`
    as in DeliveryList. `asking`: the newest of all deliveries that wait for an answer, whatever was asked for."""

    time: AwareDatetime
    counts: dict[DeliveryStatus, int]
    deliveries: tuple[DeliveryLine, ...]
    next: Name | None
    asking: tuple[DeliveryLine, ...]
    flights: tuple[FlightSeen, ...]
    vehicles: tuple[FleetVehicle, ...]


class StreetBuilding(Wire):
    """A building as a prism. `target`: the one that is delivered to."""

    footprint: tuple[Point2, ...]
    height_m: Metres
    floor_height_m: Metres
    target: bool


class StreetRoad(Wire):
    start: Point2
    end: Point2
    width_m: Metres


class StreetPlan(Wire):
    """A street from above, for people: never part of what a mission knows. `key` is the same for equal streets."""

    key: Name
    name: str
    buildings: tuple[StreetBuilding, ...]
    roads: tuple[StreetRoad, ...]
    start: Point2


class Span(Wire):
    """From and to, seconds: between these lie eight of ten earlier deliveries."""

    least_s: float = Field(ge=0.0)
    most_s: float = Field(ge=0.0)


class Outlook(Wire):
    """How long it may take. `ahead`: deliveries that are flown before it, null once it flies. `flight`: from take-off
    to the stop, by `deliveries` earlier ones; null where too few are known."""

    ahead: int | None
    flight: Span | None
    deliveries: int


class CustomersDrone(Wire):
    """Where the drone was at `time`."""

    time: AwareDatetime
    pose: Pose
    battery: Unit | None


class Tracking(Wire):
    """What the customer of a delivery is shown. `question`: what they are asked; `drone`: null where none flies, or
    where it does not tell where it is (`silent`); `held_up`: a service or a model that it needs is away and waited for;
    `picture`: there is one of the stop."""

    time: AwareDatetime
    request: str
    status: DeliveryStatus
    phase: Phase
    created: AwareDatetime
    started: AwareDatetime | None
    ended: AwareDatetime | None
    question: OpenQuestion | None
    drone: CustomersDrone | None
    silent: bool
    held_up: bool
    outlook: Outlook
    outcome: OutcomeName | None
    picture: bool


class SampleOption(Wire):
    name: Name
    title: str
    difficulty: Literal["easy", "moderate", "hard"]
    request: str


class NamedOption(Wire):
    """`label`: for people; `usual`: what is taken where nothing is chosen."""

    name: ModelName
    label: str
    usual: bool = False


class OrderOptions(Wire):
    """What a delivery may be given beside its request. `scenes`: a simulator is part of the fleet, which needs a scene
    or a sample; `own_place`: so is a vehicle that flies where it stands. `models` is null where the gateway does not
    say."""

    samples: tuple[SampleOption, ...]
    models: tuple[NamedOption, ...] | None
    searches: tuple[NamedOption, ...]
    vehicles: tuple[FleetVehicle, ...]
    scenes: bool
    own_place: bool


class ReadingQuestion(Wire):
    """How would this request be understood? `exchanges`: what was asked and answered since. `model` is the vision
    model, which may never have learnt to see the thing."""

    request: str = Field(min_length=1, max_length=4000, pattern=r"\S")
    exchanges: tuple[Exchange, ...] = Field(default=(), max_length=8)
    model: ModelName | None = None


class Reading(Wire):
    """`question`: what a delivery would ask before take-off; null where nothing is open. `known`: whether the vision
    model knows the object, null where it was not asked or does not say."""

    answer: ParseAnswer
    question: str | None
    known: bool | None = None
