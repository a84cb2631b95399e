"""The state of a mission: one frozen value that holds all that the mission knows between two stops.

Written as JSON after a stop, it lets another process carry the mission on (`Mission.go_on`). `stage` says what happens
next.
"""

from typing import Literal
from uuid import uuid4

from pydantic import JsonValue

from contracts.base import Metres, Name, Radians, Unit, Wire
from contracts.flight_limits import RefusalReason
from contracts.geometry import Box, Point3, Pose
from contracts.llm_parser import Exchange
from contracts.orchestrator import ModelCalls, Phase, Stop
from contracts.sim import Verdict
from contracts.vehicle import Move, Observation, VehicleState
from mission.stages import Ended, ReadRequest, Stage


class Dismissed(Wire):
    """A sighting that did not stand up to a nearer look: where it is, where it was made from, how sure it was."""

    place: Point3
    seen_from: Pose
    confidence: Unit


class LostSighting(Wire):
    """Why the last approach was given up; `blocked`: the way to the thing is not free."""

    why: str
    blocked: bool


class PlannedFlight(Wire):
    """The next flight: the next step begins with it. Its number follows from the vehicle's state, so that the same
    state flies the same move; `why` is for people."""

    move: Move
    why: str


class LookUnderWay(Wire):
    """A look for which the drone turns on the spot, because its cameras don't see all that the look needs: the yaw it
    set out from and comes back to, the turns still to be looked towards (degrees to the right of that yaw), and what
    was seen so far."""

    yaw: Radians
    turns_deg: tuple[float, ...]
    seen: tuple[Observation, ...] = ()


class Outage(Wire):
    """A machine that the next step needs is away: `why` it could not be done the last time, how often it was tried,
    and for how long it has been waited for, `waited_s`, the times in which no process carried the mission on left
    out."""

    why: str
    tries: int = 1
    waited_s: float = 0.0


class Trouble(Wire):
    """Why no flight may follow the last one."""

    reason: RefusalReason
    message: str


class GuardMemory(Wire):
    """What the flight guard knows of a mission's earlier flights: where it started, and with which share of a full
    battery (`charge`), how high reaches what depth has shown beside the drone, how far the depth sensors have shown
    that they reach, whether anybody was seen to walk or drive by (`passers_by`), the corners of the way flown, where
    the drone was left (`stands`), and what was amiss with its last flight (`trouble`)."""

    home: Pose
    charge: float | None = None
    top_m: float | None = None
    reach_m: Metres = 0.0
    passers_by: bool = False
    flown: tuple[Point3, ...] = ()
    stands: Pose | None = None
    trouble: Trouble | None = None


class MissionState(Wire):
    """All that a mission knows between two stops. `key` names the delivery: a trial is begun with it, once.

    `exchanges` are the questions that were put to the customer, with the answers.
    `vehicle` is the drone's name, `renderer` who draws its pictures in a simulator, `drone` its state after the last
    flight. `flight` is flown before `stage` goes on, and after it `interrupted`, which had to wait; `arrived`: the last
    one came to its end. `trail`: the corners flown since the search or the facade was left, to go back along. `memory`
    is the search policy's own; `looking`: a look that takes several stops. `height_confirmed`: whether a look at the
    final height showed the row of windows asked for, null where nothing tells. `start_remark`: what was amiss where the
    drone began, for the customer. `guard`: what the flight guard remembers, null before there is a drone; `refusals`:
    flights that it has refused since the last one it let happen; `rose_at`: the number of the last move that was
    planned straight up, out of reach of who walks by. `outage`: the next step was tried before, and put off.
    `silent_looks` counts useless answers in a row,
    `approaches` those begun and given up. `elsewhere`: where else such a thing was seen, for the customer; `another`:
    where a second one was surely seen, at another window that the request fits as well. `at_foot`: a building stood
    near ahead where the drone began; `no_building`: the yaws in which what looked like a facade had no floor, or not
    the one asked for; `too_low`: what was found of the latter. `counted_at`: the number of moves when a stop was
    counted last, for several questions at one place are one stop. `events`: the number of the
    last event; `seconds`: wall time by part."""

    version: Literal[1] = 1
    key: Name
    request: str
    exchanges: tuple[Exchange, ...] = ()
    stage: Stage = ReadRequest()
    phase: Phase = "parse"
    floor: int | None = None
    object: str | None = None
    vehicle: Name | None = None
    renderer: str | None = None
    drone: VehicleState | None = None
    flight: PlannedFlight | None = None
    interrupted: PlannedFlight | None = None
    arrived: bool = True
    trail: tuple[Point3, ...] = ()
    final_height_m: float | None = None
    floor_height_m: float | None = None
    height_confirmed: bool | None = None
    building_box: Box | None = None
    memory: dict[str, JsonValue] = {}
    looking: LookUnderWay | None = None
    guard: GuardMemory | None = None
    refusals: int = 0
    rose_at: int = -1
    outage: Outage | None = None
    exploration_steps: int = 0
    silent_looks: int = 0
    approaches: int = 0
    dismissed: tuple[Dismissed, ...] = ()
    elsewhere: dict[str, str] = {}
    another: Point3 | None = None
    at_foot: bool = False
    no_building: tuple[Radians, ...] = ()
    too_low: str | None = None
    start_remark: str | None = None
    lost: LostSighting | None = None
    steps: int = 0
    stops: tuple[Stop, ...] = ()
    counted_at: int = -1
    calls: dict[str, ModelCalls] = {}
    seconds: dict[str, float] = {}
    events: int = 0
    claimed: Point3 | None = None
    verdict: Verdict | None = None

    @property
    def guard_memory(self) -> GuardMemory | None:
        """For a guard that looks the drone up anew: while a flight is under way it may be anywhere on it."""
        if self.guard is None or (self.flight is None and self.interrupted is None):
            return self.guard
        return self.guard.model_copy(update={"stands": None})

    @property
    def over(self) -> bool:
        return isinstance(self.stage, Ended)


def begin(request: str, key: str | None = None) -> MissionState:
    """The state before the first step; without a `key`, one that nobody had before."""
    return MissionState(key=key or f"mission-{uuid4().hex}", request=request)
