"""One step of a mission under way: what its stages do to the world, and the state that comes of it.

The state is a value; `Step.state` is the latest one, replaced at every change, so that a step that is broken off still
tells how far it came.
"""

import time
from collections.abc import Awaitable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from contracts.event_data import EventData, MoveData, NoData, RefusedData, TurnData
from contracts.flight_limits import FlightLimits, GuardAction
from contracts.geometry import Point3, Pose
from contracts.llm_parser import ParseAnswer
from contracts.orchestrator import MissionSettings, ModelCalls, OutcomeName, Phase, Stop
from contracts.vehicle import Move, Observation, VehicleCapabilities, VehicleState
from contracts.vlm_gateway import Answer, Role
from mission.customer import Customer
from mission.frames import FINAL, FlightRefused
from mission.guard import GuardedVehicle, guarded
from mission.held_log import HeldLog
from mission.looks import Look, Sight, look_of, navigation_camera
from mission.model_calls import Reply, ask
from mission.passing import way_over
from mission.placement import Placement
from mission.places import point_of, spoken
from mission.policies.base import AnyPolicy
from mission.ports import Ports
from mission.record import Log, Pictures
from mission.state import MissionState, PlannedFlight
from mission.wording import with_article

MAX_REFUSALS = 4
"""After so many refusals in a row no plan will do."""
_KEPT = ("calls", "seconds", "guard", "vehicle")  # a vehicle that was placed is to be watched, and given back
LOOKS_AGAIN = 2
"""A look that can't be trusted is made again so often."""
_DONE: dict[GuardAction, str] = {
    "none": "is left to whoever flies it",
    "hold": "holds where it is",
    "return": "flew back and landed",
    "land": "landed where it was",
}

T = TypeVar("T")
A = TypeVar("A", bound=Answer | ParseAnswer)


class MissionEnd(Exception):
    """The mission is over: its outcome, and why, for a person."""

    def __init__(self, outcome: OutcomeName, message: str) -> None:
        super().__init__(message)
        self.outcome = outcome
        self.message = message


@dataclass(frozen=True)
class Drone:
    """The vehicle that is flown, behind the flight guard, and what it says that it is."""

    vehicle: GuardedVehicle
    capabilities: VehicleCapabilities

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(camera.name for camera in self.capabilities.cameras)

    @property
    def front(self) -> str:
        """The camera that looks ahead. Raises MissionEnd (failed) where none does."""
        ahead = next((camera for camera in self.capabilities.cameras if camera.looks_ahead), None)
        if ahead is None:
            raise MissionEnd("failed", "the drone has no level camera that looks ahead: no floor can be counted")
        return ahead.name

    @property
    def front_up_m(self) -> float:
        """How far the camera that looks ahead sits above the drone's centre."""
        return next(c.offset.up_m for c in self.capabilities.cameras if c.name == self.front)

    @property
    def level(self) -> tuple[str, ...]:
        """The cameras that see the horizon."""
        return tuple(c.name for c in self.capabilities.cameras if navigation_camera(c).is_level)

    def within(self, reach_deg: float) -> tuple[str, ...]:
        """The cameras whose headings lie within that of the nose."""
        return tuple(c.name for c in self.capabilities.cameras if abs(c.heading_deg) <= reach_deg)


@dataclass(frozen=True)
class MissionContext:
    """What a mission is flown with: the services, where the drone comes from, every setting, the log. None of it is
    part of the state; whoever carries a mission on brings its own. `limits`: of every flight. `customer` is null where
    nobody can be asked, `drone` before it has been looked up."""

    ports: Ports
    placement: Placement
    settings: MissionSettings
    policy: AnyPolicy
    log: Log
    limits: FlightLimits = field(default_factory=FlightLimits)
    customer: Customer | None = None
    drone: Drone | None = None

    async def with_drone(self, state: MissionState) -> "MissionContext":
        """The same with the state's vehicle at hand. Raises PortError."""
        if self.drone is not None or state.vehicle is None:
            return self
        vehicle = await guarded(await self.placement.resume(state.vehicle), self.limits, state.guard_memory)
        return replace(self, drone=Drone(vehicle, await vehicle.connect()))


class Step:
    """One step: `state` begins as the one given and ends as the next; what is `settled` is never done again."""

    def __init__(self, state: MissionState, context: MissionContext) -> None:
        self.state = self.settled = state
        self._log = HeldLog(context.log)
        self.context = context
        self.ports, self.settings, self.policy = context.ports, context.settings, context.policy

    def update(self, **changes: object) -> None:
        """Replaces fields of the state."""
        assert changes.keys() <= MissionState.model_fields.keys(), changes.keys()
        self.state = self.state.model_copy(update=changes)

    def settle(self) -> None:
        """What was done so far stands."""
        self._log.tell()
        self.settled = self.state

    def unsettle(self) -> None:
        """Back to what stands, but for what calls have cost and shown the guard, and for the vehicle."""
        self._log.drop()
        self.state = self.settled.model_copy(update={name: getattr(self.state, name) for name in _KEPT})

    @property
    def drone(self) -> Drone:
        """Raises RuntimeError before it has been placed."""
        if self.context.drone is None:
            raise RuntimeError("the drone has not been placed yet")
        return self.context.drone

    @property
    def flown(self) -> VehicleState:
        """The vehicle after its last flight. Raises RuntimeError before it has been placed."""
        if self.state.drone is None:
            raise RuntimeError("the drone has not been placed yet")
        return self.state.drone

    @property
    def pose(self) -> Pose:
        return self.flown.pose

    @property
    def just_rose(self) -> bool:
        """Was the last move straight up, out of reach of who walks by? Who came to rest too low does not try again."""
        return self.state.rose_at == self.flown.moves

    @property
    def thing(self) -> str:
        """What is looked for, with its article, for a person."""
        return with_article(self.state.object or "object")

    def write(self, message: str, data: EventData, pictures: Pictures | None = None) -> None:
        """One event of the phase under way."""
        self.update(events=self.state.events + 1)
        self._log.write(self.state.events, self.state.phase, message, data, pictures)

    def enter(self, phase: Phase, message: str) -> None:
        """The next phase begins."""
        self.update(phase=phase)
        self.write(message, NoData())

    def count_stop(self) -> None:
        """This stop carries a model query; several queries at the same place are one stop."""
        if self.state.counted_at != (moves := self.flown.moves):
            stop = Stop(phase=self.state.phase, pose=self.pose)
            self.update(counted_at=moves, steps=self.state.steps + 1, stops=(*self.state.stops, stop))

    def spend(self, part: str, seconds: float) -> None:
        """Adds wall time to a part."""
        spent = self.state.seconds
        self.update(seconds=spent | {part: spent.get(part, 0.0) + seconds})

    async def timed(self, part: str, call: Awaitable[T]) -> T:
        """Awaits the call and adds its wall time to a part."""
        started = time.perf_counter()
        try:
            return await call
        finally:
            self.spend(part, time.perf_counter() - started)

    async def ask(self, role: Role, call: Awaitable[A]) -> Reply[A]:
        """Asks a model and counts the call, whatever its end. Raises PortError."""

        def count(calls: ModelCalls) -> None:
            self.update(calls=self.state.calls | {role: calls})

        reply = await ask(call, self.state.calls.get(role, ModelCalls()), count)
        self.spend(role, reply.seconds)
        return reply

    async def observe(self, cameras: Sequence[str]) -> Observation:
        """These cameras' views of one moment. Raises MissionEnd (stopped_by_guard) where they are frozen, stale or
        blind, looked at again as well; PortError."""
        vehicle = self.drone.vehicle
        seen = await self.timed("observe", vehicle.observe(cameras))
        for _ in range(LOOKS_AGAIN):
            if vehicle.distrust is None:
                break
            seen = await self.timed("observe", vehicle.observe(cameras))
        if vehicle.distrust is not None:
            await self.stop(vehicle.distrust, (), f"the flight guard stops the mission: {vehicle.distrust.message}")
        for part, seconds in seen.timings_s.items():
            self.spend(part, seconds)
        self.update(guard=self.drone.vehicle.memory)
        return seen

    async def look(self, cameras: Sequence[str] | None = None) -> Look:
        """One observation by these cameras, or by all. Raises PortError."""
        wanted = self.drone.cameras if cameras is None else tuple(cameras)
        seen = await self.observe(wanted)
        return look_of(seen, wanted, self.drone.vehicle.memory.reach_m)

    async def look_ahead(self) -> Sight:
        """The view along the nose. Raises PortError."""
        return (await self.look((self.drone.front,))).sights[self.drone.front]

    def plan_flight(self, path: Sequence[Point3], yaw: float | None, why: str) -> None:
        """The next step begins with this flight."""
        self.update(flight=PlannedFlight(move=Move(path=tuple(path), yaw=yaw), why=why))

    async def fly(self, flight: PlannedFlight) -> None:
        """One move, recorded; one that the guard refuses is recorded as well, and not flown. `state.flight` is what is
        flown before the stage goes on, null afterwards for the most part. Raises MissionEnd (collision) where the drone
        hit something, (stopped_by_guard) where no other flight would be let happen either, or too many were refused;
        PortError."""
        before, move = self.flown, flight.move
        try:
            done = await self.timed("move", self.drone.vehicle.fly(before.moves + 1, move))
        except FlightRefused as refusal:
            if refusal.reason != "passer_by" or not self._rise(flight, refusal):
                await self._refused(flight, refusal)
            return
        self.update(guard=self.drone.vehicle.memory, refusals=0 if move.path else self.state.refusals)
        trail = (*self.state.trail, *move.path[:-1], point_of(done.pose)) if move.path else self.state.trail
        self.update(drone=done.vehicle, arrived=done.reached, trail=trail)
        self.update(flight=self.state.interrupted if done.reached else None, interrupted=None)
        kind, waited_s = MoveData if move.path else TurnData, self.drone.vehicle.waited_s
        self.write(
            flight.why + ("" if done.reached else f"; stopped early{f' by {done.hit}' if done.hit else ''}"),
            kind(
                number=done.number,
                start=before.pose,
                to=done.pose,
                path=move.path,
                reached=done.reached,
                collided=done.collided,
                hit=done.hit,
                path_m=round(done.path_m, 3),
                flight_s=round(done.flight_s, 3),
                waited_s=round(waited_s, 3),
            ),
        )
        if done.collided or done.vehicle.collided:
            hit = f" with {done.hit}" if done.hit else ""
            raise MissionEnd("collision", f"the drone collided{hit} at {spoken(done.pose)} ({flight.why})")

    def _rise(self, flight: PlannedFlight, refusal: FlightRefused) -> bool:
        """Plans to fly over who walks by; not where the drone is above them already, can't rise or rose just now."""
        vehicle, move = self.drone.vehicle, flight.move
        if self.pose.z >= vehicle.low_m or self.just_rose or not vehicle.can_rise:
            return False
        refused = RefusedData(reason=refusal.reason, at=refusal.at, path=move.path, action="none")
        self.write(f"{refusal.message}: over them ({flight.why})", refused)
        up, over = way_over(flight, self.pose, vehicle.low_m)
        self.update(flight=up, interrupted=over, rose_at=self.flown.moves + 1)
        return True

    async def _refused(self, flight: PlannedFlight, refusal: FlightRefused) -> None:
        """The guard has spoken: another plan may do better, unless nothing would. Raises MissionEnd
        (stopped_by_guard), PortError."""
        said = f"the flight guard refused: {refusal.message} ({flight.why})"
        path = flight.move.path
        self.update(flight=None, interrupted=None, arrived=False, refusals=self.state.refusals + 1)
        if refusal.reason in FINAL or self.state.refusals >= MAX_REFUSALS:
            await self.stop(refusal, path, said)
        self.write(said, RefusedData(reason=refusal.reason, at=refusal.at, path=path, action="none"))

    async def stop(self, refusal: FlightRefused, path: tuple[Point3, ...], said: str) -> None:
        """Brings the drone where it may stay. Raises MissionEnd (stopped_by_guard), PortError."""
        vehicle = self.drone.vehicle
        action = await vehicle.end(refusal.reason)
        self.write(said, RefusedData(reason=refusal.reason, at=refusal.at, path=path, action=action))
        self.update(drone=await vehicle.state(), guard=vehicle.memory)
        raise MissionEnd("stopped_by_guard", f"stopped for safety: {refusal.message}; the drone {_DONE[action]}")
