"""The vehicle's contract on a drone behind an autopilot: numbered moves, its state, its looks.

Calls that fly begin an activity, which goes on when its caller hangs up; a second flight has to wait, a stop has not.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace

from contracts.geometry import Pose
from contracts.vehicle import (
    FlightMode,
    Move,
    MoveProgress,
    MoveResult,
    Observation,
    VehicleCapabilities,
    VehicleState,
)
from episode_kit.cameras import chosen_cameras
from service_kit.errors import Conflict, Unavailable
from services.mavlink_vehicle.activity import Activity, over
from services.mavlink_vehicle.course import course, distance_m
from services.mavlink_vehicle.drone import Drone
from services.mavlink_vehicle.flight_ends import Hit, Interrupted, Stopped, TakenOver
from services.mavlink_vehicle.frames import Alignment, Enu
from services.mavlink_vehicle.link import CommandRefused, LinkLost
from services.mavlink_vehicle.moves import Moves
from services.mavlink_vehicle.report import Flown, Odometer, battery_of, health_of
from services.mavlink_vehicle.task import Task
from services.mavlink_vehicle.telemetry import NoPose

log = logging.getLogger("mavlink_vehicle")

COUNT_EVERY_S = 0.5
SET_POINT_TRUSTED_M = 1.0
"""A course begins at the set-point, unless the vehicle is farther off than this."""


class Vehicle:
    """One drone, one mission at a time (`begin`)."""

    def __init__(self, drone: Drone, task: Task) -> None:
        self.drone = drone
        self.task = task
        self._telemetry = drone.telemetry
        self._moves = Moves()
        self._odometer = Odometer()
        self._activity = Activity(drone, self._odometer)
        self._begin = asyncio.Lock()
        self._looks = 0
        self._trouble: str | None = None
        self.collided: str | None = None

    async def begin(self, task: Task) -> None:
        """Another mission: what is flown yet is stopped, moves count from 1. On the ground its frame begins anew, for
        an estimate wanders while a vehicle stands."""
        await self._activity.stop()
        self.task = task if self._telemetry.in_air else replace(task, alignment=None)
        self._moves, self._looks = Moves(), 0
        self._odometer.reset()
        self._trouble = self.collided = None

    async def run(self) -> None:
        """Counts the time in the air until it is cancelled."""
        while True:
            self._odometer.tick(self._telemetry)
            await asyncio.sleep(COUNT_EVERY_S)

    async def close(self) -> None:
        """Nothing more is commanded: what the vehicle does then is its autopilot's own failsafe."""
        await self._activity.close()

    @property
    def busy(self) -> bool:
        """A flight is under way."""
        return self._activity.busy

    @property
    def grounded(self) -> bool:
        """Stands on the ground, or is on its way from there or to there."""
        return not self._telemetry.in_air or self._activity.doing in ("taking_off", "landing", "returning")

    def pose_at(self, time_s: float) -> Pose:
        """Raises NoPose."""
        return self._aligned.pose(self._telemetry.poses.at(time_s))

    def state(self) -> VehicleState:
        """As it measures itself, also on the way. Raises Unavailable before it has said where it is."""
        telemetry, odometer = self._telemetry, self._odometer
        pose = self._pose()
        return VehicleState(
            id=self.task.name,
            mode=self._mode(),
            pose=pose,
            battery=battery_of(telemetry, self.task.body.reserve),
            health=health_of(telemetry, self.drone.control.taken, self.collided, self._trouble),
            moves=self._moves.number,
            path_m=odometer.path_m,
            path_horizontal_m=odometer.horizontal_m,
            flight_s=odometer.flight_s,
            collided=self.collided is not None,
            time_s=telemetry.clock(),
        )

    def capabilities(self) -> VehicleCapabilities:
        return VehicleCapabilities(
            kind=self.drone.link.firmware,
            cameras=self.task.cameras.carried,
            radius_m=self.task.body.radius_m,
            max_speed_m_s=self.task.limits.speed_m_s,
            cancels_moves=True,
            lands=True,
        )

    async def observe(self, names: Sequence[str] | None, *, depth: bool) -> Observation:
        """Raises BadQuestion, Unavailable."""
        chosen = chosen_cameras(self.task.cameras.carried, names)
        try:
            seen = await self.task.cameras.look(chosen, self.pose_at, depth=depth)
        except NoPose as error:
            raise Unavailable(f"no picture without a place: {error}", code="no_pose") from None
        self._looks += 1
        return Observation(
            vehicle=self.task.name,
            number=self._looks,
            pose=seen.pose,
            time_s=seen.time_s,
            views=seen.views,
            timings_s=seen.timings_s,
        )

    async def take_off(self, height_m: float) -> VehicleState:
        """A vehicle that flies stays where it is. Raises Conflict, Unavailable."""
        async with self._begin:
            self._must_rest("taking off")
            if self._telemetry.in_air:
                self._must_be_ours()
                return self.state()
            flight = self._activity.start("taking_off", self._took_off(height_m))
        return await self._over(flight)

    async def move(self, number: int, move: Move) -> MoveResult:
        """Flies it, and answers when it is over. Raises Conflict, Unavailable."""
        async with self._begin:
            moves = self._moves  # another mission may begin meanwhile
            known = moves.known(number, move)
            if isinstance(known, MoveResult):
                return known
            if known is None:
                self._must_rest(f"move {number}")
                self._must_be_ours()
                if not self._telemetry.in_air:
                    raise Conflict("the vehicle stands on the ground; POST .../take-off first", code="landed")
                moves.begin(number, move)
                self._activity.start("moving", self._moved(moves, number, move))
            flight = self._activity.under_way
        await self._over(flight)
        return moves.result(number)

    def progress(self, number: int) -> MoveProgress:
        """Raises NotFound."""
        return self._moves.progress(number, self._pose())

    async def cancel(self, number: int) -> MoveResult:
        """Stops it on the way; one that is over stays what it is, the next number is used up. Raises NotFound."""
        moves = self._moves
        if number == moves.number + 1 and not self.busy:
            moves.begin(number, None)
            moves.end(self._result(number, Flown(), cancelled=True))
        if moves.under_way and number == moves.number:
            await self._activity.stop()
        return moves.result(number)

    async def hold(self) -> VehicleState:
        """Stops on the way. Raises Conflict where somebody else flies it, Unavailable."""
        await self._activity.stop()
        return await self._flown_alone("holding", self.drone.hold)

    async def return_home(self) -> VehicleState:
        """Stops on the way first. Raises Conflict, Unavailable."""
        await self._activity.stop()
        return await self._flown_alone("returning", self.drone.return_to_launch)

    async def land(self) -> VehicleState:
        """Stops on the way first. Raises Conflict, Unavailable."""
        await self._activity.stop()
        return await self._flown_alone("landing", self.drone.land)

    async def _flown_alone(self, doing: FlightMode, flight: Callable[[], Awaitable[None]]) -> VehicleState:
        async with self._begin:
            self._must_rest(doing)
            if not self._telemetry.in_air:
                return self.state()
            self._must_be_ours()
            begun = self._activity.start(doing, flight())
        return await self._over(begun)

    async def _took_off(self, height_m: float) -> None:
        start = await self.drone.armed()  # where it stands is told anew when it is armed
        if self.task.alignment is None:
            self.task.alignment = self.task.alignment_at(start)
        await self.drone.take_off(start, height_m)

    async def _moved(self, moves: Moves, number: int, move: Move) -> None:
        before, begun_s = self._odometer.reading(), self._telemetry.clock()
        hit: str | None = None
        reached = stopped = False
        try:
            if not self.drone.control.ours:
                await self.drone.take_over(self._local())
            wanted = course(self._set_out(), move.path, move.yaw, self.task.limits)
            await self.drone.fly(wanted, self._aligned, moves.flown)
            reached = True
        except Stopped:
            stopped = True
        except Hit:
            hit = self.collided
        except TakenOver as error:
            log.warning("move %d ended: %s", number, error)
        except (Interrupted, CommandRefused, LinkLost) as error:
            self._trouble = str(error)
            log.warning("move %d ended: %s", number, error)
        finally:
            self._odometer.note(self._telemetry)
            flown = self._odometer.reading().since(before)._replace(flight_s=self._telemetry.clock() - begun_s, hit=hit)
            self._activity.doing = None
            moves.end(self._result(number, flown, cancelled=stopped, reached=reached))

    def _set_out(self) -> Pose:
        """Where a course begins: the set-point, so that it does not jump, or the vehicle where it was blown off."""
        here, aim = self._pose(), self.drone.set_points.aim_at
        wanted = here if aim is None else self._aligned.pose(aim)
        return wanted if distance_m(here, wanted) <= SET_POINT_TRUSTED_M else here

    async def _over(self, flight: asyncio.Task[None] | None) -> VehicleState:
        """Raises Conflict, Unavailable."""
        if flight is not None:
            await over(flight)
        return self.state()

    def _must_rest(self, what: str) -> None:
        if self._activity.busy:
            raise Conflict(
                f"{what} has to wait: the vehicle is on its way; let it arrive, or stop it with POST .../hold",
                code="move_under_way",
            )

    def _must_be_ours(self) -> None:
        if self._telemetry.lost:
            raise Unavailable(self.drone.link.silence, code="link_lost")
        if self.drone.control.in_hand() == "taken":
            why = self.drone.control.taken or f"somebody else flies it: its mode is {self._telemetry.mode.upper()}"
            raise Conflict(why, code="manual_control")

    def _mode(self) -> FlightMode:
        if self._telemetry.lost:
            return "lost"
        if self._telemetry.in_air and self.drone.control.in_hand() == "taken":
            return "manual"
        if self._activity.doing is not None:
            return self._activity.doing
        return "holding" if self._telemetry.in_air else "landed"

    def _result(self, number: int, flown: Flown, *, cancelled: bool = False, reached: bool = False) -> MoveResult:
        state = self.state()
        return MoveResult(
            number=number,
            pose=state.pose,
            reached=reached,
            cancelled=cancelled,
            collided=flown.hit is not None,
            hit=flown.hit,
            path_m=flown.path_m,
            flight_s=max(0.0, flown.flight_s),
            vehicle=state,
        )

    @property
    def _aligned(self) -> Alignment:
        if self.task.alignment is not None:
            return self.task.alignment
        home = self._telemetry.home if self._telemetry.in_air else None
        return self.task.alignment_at(home or self._local())

    def _local(self) -> Enu:
        last = self._telemetry.poses.last
        if last is None:
            raise Unavailable(self._nowhere(), code="no_pose")
        return last.place

    def _pose(self) -> Pose:
        return self._aligned.pose(self._local())

    def _nowhere(self) -> str:
        if not self.drone.link.found:
            return self.drone.link.silence
        missing = ", ".join(self._telemetry.missing)
        return f"the autopilot has not said where it is yet; it lacks {missing}{self._telemetry.last_words}"
