"""The stages of a mission as values: what happens next, and what that needs to know.

docs/mission.md draws what leads from one to the other; `mission.advance` says which function acts in each.
"""

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from contracts.base import Metres, Radians, Unit, Wire
from contracts.geometry import Point3, Pose
from contracts.orchestrator import OpenQuestion, OutcomeName
from navigation.floor_localization import Band, WindowRows


class Extent(NamedTuple):
    """How wide and high a thing is that fills a box, in metres."""

    width_m: float
    height_m: float


class Seen(Wire):
    """The thing as one look saw it: where, from where, how surely, how large (null where depth does not tell);
    `claimable`: surely enough to be claimed."""

    place: Point3
    seen_from: Pose
    confidence: Unit
    extent: Extent | None
    claimable: bool


class Approach(Wire):
    """An approach under way. `first`: the sighting that began it; `last`: the latest; `ever_claimable`: one of them
    was sure enough; `surest`: the highest confidence but the latest's. Of leg number `legs`, the one flown last:
    `reaches_stop`, it ends where the drone is to stop; `goes_aside`, it leads to where the thing shows another side.
    `put_right`: a leg led from one stop to another."""

    first: Seen
    last: Seen
    ever_claimable: bool
    surest: Unit = 0.0
    legs: int = 0
    asides: int = 0
    reaches_stop: bool = False
    goes_aside: bool = False
    put_right: bool = False


class ReadRequest(Wire):
    """Ask the parser for floor and object."""

    at: Literal["read_request"] = "read_request"


class Ended(Wire):
    """The mission is over: its outcome, and why, for a person."""

    at: Literal["ended"] = "ended"
    outcome: OutcomeName
    message: str


class NeedsAnswer(Wire):
    """Wait for what the customer says to the question; without an answer the mission is `unanswered`."""

    at: Literal["needs_answer"] = "needs_answer"
    question: OpenQuestion
    unanswered: Ended


class Preflight(Wire):
    """Has the vision model ever learnt to see the object? Asked while the drone stands."""

    at: Literal["preflight"] = "preflight"


class PlaceDrone(Wire):
    """Get the vehicle, take off where it stands on the ground."""

    at: Literal["place_drone"] = "place_drone"


class TakeStand(Wire):
    """Find the building and stand square before it, where nothing hangs over the drone. `moves`: flights made for it;
    `looked_behind`: what the drone turned its back to was looked at; `first_yaw`: where it looked before, and
    `first_m` how far off what it saw there was, null for nothing; `behind`: the drone has its back to that, because
    there was nothing near; `turned_back`: it looks there again, and what stands
    beside has turned out to be nothing; `backs_off_m`: turned away, it is to fly so far; `aside`: it has left a place
    over which something hung."""

    at: Literal["take_stand"] = "take_stand"
    moves: int = 0
    looked_behind: bool = False
    first_yaw: Radians | None = None
    first_m: Metres | None = None
    behind: bool = False
    turned_back: bool = False
    backs_off_m: Metres = 0.0
    aside: bool = False


class MeasureStandOff(Wire):
    """How far is the facade ahead?"""

    at: Literal["measure_stand_off"] = "measure_stand_off"


class BandCount(Wire):
    """What counting one band of the facade needs: its place, the floors counted below it, the window rows of the band
    below, and how often in a row the model said nothing."""

    stand_off_m: Metres
    band: Band
    floors_below: float = 0.0
    rows_below: WindowRows | None = None
    silent: int = 0


class CountBand(BandCount):
    """Count the floors of a band."""

    at: Literal["count_band"] = "count_band"


class CountBandFromNearer(BandCount):
    """Count the floors of a band whose facade steps back, from the stand-off that the band was made for."""

    at: Literal["count_band_from_nearer"] = "count_band_from_nearer"


class WholeBuilding(Wire):
    """The direct count: `home` is where the drone left the facade, `retreats` how often it has backed off since."""

    stand_off_m: Metres
    home: Pose
    retreats: int = 0


class BackOff(WholeBuilding):
    """Turned away from the building: how far is the way free?"""

    at: Literal["back_off"] = "back_off"


class RiseWithDistance(WholeBuilding):
    """Farther off: climb as high as the drone is away, so that the picture reaches the ground."""

    at: Literal["rise_with_distance"] = "rise_with_distance"


class FindTop(WholeBuilding):
    """Is the top of the facade in sight?"""

    at: Literal["find_top"] = "find_top"


class CountWhole(WholeBuilding):
    """Count all floors in one picture: the direct count, or before a stepwise one says that there is no such floor.
    `top_m`: how high the building is, above ground."""

    at: Literal["count_whole"] = "count_whole"
    top_m: Metres
    top_seen: bool
    silent: int = 0


class ConfirmHeight(Wire):
    """At the final height: is it that of the floor asked for? `stand_off_m`: of the facade that was counted;
    `counted_m`: the height that was counted first, where one more count has led here from it."""

    at: Literal["confirm_height"] = "confirm_height"
    stand_off_m: Metres
    counted_m: float | None = None


class BoxBuilding(Wire):
    """At the final height: which part of the picture is the building?"""

    at: Literal["box_building"] = "box_building"


AfterClimb = Annotated[CountBand | FindTop | CountWhole | ConfirmHeight | BoxBuilding, Field(discriminator="at")]
Attempt = Literal["from_here", "from_farther_off"]


class ClimbTo(Wire):
    """Straight up or down to `to_m` above ground, then `then`. `seen_m`: the height to which the last flight of it led,
    where that was not all the way."""

    to_m: float
    why: str
    then: AfterClimb
    attempt: Attempt = "from_here"
    seen_m: float | None = None


class Climb(ClimbTo):
    """Climb or sink."""

    at: Literal["climb"] = "climb"


class CheckClimb(ClimbTo):
    """Was the way up or down free?"""

    at: Literal["check_climb"] = "check_climb"


class LookRound(Wire):
    """One exploration step: is the object in sight? If not, where to next?"""

    at: Literal["look_round"] = "look_round"


class LeaveBlocked(Wire):
    """Back where a thing was seen that no way led to: go on with the search, to try it from elsewhere."""

    at: Literal["leave_blocked"] = "leave_blocked"


class ApproachStage(Wire):
    """A stage of the approach; each of them begins with a look after the flight."""

    approach: Approach


class FaceCandidate(ApproachStage):
    """A candidate so near that no leg is worth it: look at it face to face."""

    at: Literal["face_candidate"] = "face_candidate"


class CheckCandidate(ApproachStage):
    """A candidate, not confirmed yet: is it seen again, and surely enough?"""

    at: Literal["check_candidate"] = "check_candidate"


class CloseIn(ApproachStage):
    """Confirmed: looks on the way tell where it is, no more whether."""

    at: Literal["close_in"] = "close_in"


class SqueezeIn(ApproachStage):
    """Confirmed, and the usual clearance ends too far off: the last metre with less of it."""

    at: Literal["squeeze_in"] = "squeeze_in"


class ClaimWindow(Wire):
    """In front of the window: say so."""

    at: Literal["claim_window"] = "claim_window"
    place: Point3


Stage = Annotated[
    ReadRequest
    | NeedsAnswer
    | Preflight
    | PlaceDrone
    | TakeStand
    | MeasureStandOff
    | Climb
    | CheckClimb
    | CountBand
    | CountBandFromNearer
    | BackOff
    | RiseWithDistance
    | FindTop
    | CountWhole
    | ConfirmHeight
    | BoxBuilding
    | LookRound
    | LeaveBlocked
    | FaceCandidate
    | CheckCandidate
    | CloseIn
    | SqueezeIn
    | ClaimWindow
    | Ended,
    Field(discriminator="at"),
]
